"""A device does not reach a requested state, or refuses it with a reason.
The error names the device, the requested state and the reply. All devices are brought down.
"""

import pytest

import catenary as cat
from catenary.errors import StateError
from catenary.wire.al import AlState
from tests.scenario.cell import PRE_OP, Cell

NO_SYNC = 0x002D


@pytest.mark.parametrize("state", [AlState.SAFE_OP, AlState.OP])
def test_a_device_that_does_not_reach_a_state_is_named(cell: Cell, state: AlState) -> None:
    cell.servos[1].delay_state(state, None)
    with pytest.raises(StateError, match=rf"did not .*{state}.*: it is in") as caught:
        enter(cell)
    error = caught.value
    assert str(cell.subs[3].station) in str(error)
    assert (error.position, error.requested) == (3, state)
    assert error.actual < state
    comes_down(cell)


@pytest.mark.parametrize("state", [AlState.SAFE_OP, AlState.OP])
def test_a_refused_state_is_reported_with_its_code(cell: Cell, state: AlState) -> None:
    cell.servos[1].refuse_state(state, NO_SYNC)
    with pytest.raises(StateError, match="0x002D") as caught:
        enter(cell)
    error = caught.value
    assert (error.position, error.requested, error.code) == (3, state, NO_SYNC)
    assert error.hint
    comes_down(cell)


def test_a_device_that_refuses_once_is_accepted_later(cell: Cell) -> None:
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
