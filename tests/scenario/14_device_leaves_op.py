"""A device leaves OP by itself while everything moves; its inputs go on coming back as if nothing
had happened. The AL status that rides in every cycle tells: the error has the device's own code.
"""

import pytest

import catenary as cat
from catenary.errors import StateError
from tests.scenario.cell import SAFE_OP, Cell

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
