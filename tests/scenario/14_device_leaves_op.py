"""A device leaves OP by itself while all drives move. Its inputs still return as usual.
The AL status in every cycle shows it. The error has the AL status code of the device.
"""

import pytest

import catenary as cat
from catenary.errors import StateError
from catenary.virtual.faults import power_cycle
from tests.scenario.cell import SAFE_OP, Cell

INIT = 1
SYNC_ERROR = 0x001A


@pytest.mark.parametrize("position", [0, 1, 3])
def test_the_error_names_the_device_and_the_reason(cell: Cell, position: int) -> None:
    arm = cell.drives()
    with pytest.raises(StateError) as caught, cat.Loop(arm) as loop:
        home = arm.actual.position.copy()
        for cycle in loop:
            arm.target.position[:] = home + cycle.time
            if cycle.number == 100:
                cell.segment.core.show_al_status(position, SAFE_OP | 0x10, SYNC_ERROR)
            assert cycle.number < 105
    error = caught.value
    assert (error.position, error.actual, error.code) == (position, SAFE_OP, SYNC_ERROR)
    assert "0x001A" in str(error)
    assert error.log is not None
    cell.assert_safe()


def test_a_short_power_loss_of_a_device_ends_the_loop(cell: Cell) -> None:
    """Fewer cycles are lost than the limit, and the coupler has no process data that are missed.

    Found by the soak test: `python -m benchmarks soak --minutes 1 --seed 52`.
    """
    arm = cell.drives()
    with pytest.raises(StateError) as caught, cat.Loop(arm) as loop:
        home = arm.actual.position.copy()
        cell.segment.inject(power_cycle(0, at=cell.segment.time + 0.1, for_=1.7e-3))
        for cycle in loop:
            arm.target.position[:] = home + 0.1 * cycle.time
            assert cycle.number < 150
    assert (caught.value.position, caught.value.actual) == (0, INIT)
    assert "switched off and on" in str(caught.value.hint)
    cell.assert_safe()
