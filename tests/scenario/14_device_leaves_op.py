"""A device leaves OP by itself while everything moves; its inputs go on coming back as if nothing
had happened. The AL status that rides in every cycle tells: the error has the device's own code.
"""

import pytest

import catenary as cat
from catenary.errors import StateError
from catenary.virtual.faults import power_cycle
from tests.scenario.cell import SAFE_OP, Cell

INIT = 1
SYNC_ERROR = 0x001A


@pytest.mark.parametrize("position", [0, 1, 3])
def test_the_device_and_its_reason_are_told(cell: Cell, position: int) -> None:
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


def test_one_that_was_off_for_a_moment_has_forgotten_its_address(cell: Cell) -> None:
    """So short that fewer cycles are lost than the loop endures; the coupler has no process data
    that would be missed. (Found by the soak: `python -m benchmarks soak --minutes 1 --seed 52`.)"""
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
