"""A device does not go where it is asked to: it never gets there, or it says no and why.
The error names the device, what was asked and what came back; everybody comes down again.
"""

import pytest

import catenary as cat
from catenary.errors import StateError
from catenary.wire.al import AlState
from tests.scenario.cell import PRE_OP, Cell

NO_SYNC = 0x002D


@pytest.mark.parametrize("state", [AlState.SAFE_OP, AlState.OP])
def test_a_device_that_never_gets_there_is_named(cell: Cell, state: AlState) -> None:
    cell.servos[1].delay_state(state, None)
    with pytest.raises(StateError, match=rf"did not .*{state}.*: it is in") as caught:
        enter(cell)
    error = caught.value
    assert str(cell.subs[3].station) in str(error)
    assert (error.position, error.requested) == (3, state)
    assert error.actual < state
    comes_down(cell)


@pytest.mark.parametrize("state", [AlState.SAFE_OP, AlState.OP])
def test_a_device_that_says_no_is_told_with_its_code(cell: Cell, state: AlState) -> None:
    cell.servos[1].refuse_state(state, NO_SYNC)
    with pytest.raises(StateError, match="0x002D") as caught:
        enter(cell)
    error = caught.value
    assert (error.position, error.requested, error.code) == (3, state, NO_SYNC)
    assert error.hint
    comes_down(cell)


def test_the_device_may_change_its_mind(cell: Cell) -> None:
    cell.servos[1].refuse_state(AlState.OP, NO_SYNC)
    with pytest.raises(StateError):
        enter(cell)
    cell.servos[1].refuse_state(AlState.OP, None)
    with cat.Loop(cell.drives()):
        assert cell.states == [AlState.OP] * 4


def enter(cell: Cell) -> None:
    with cat.Loop(cell.drives()):
        pytest.fail("entered without a device")


def comes_down(cell: Cell) -> None:
    cell.let_pass(0.1)
    assert all(state & 0x0F <= PRE_OP for state in cell.states), cell.states
    assert "OPERATION ENABLED" not in cell.drive_states
