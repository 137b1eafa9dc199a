"""The CiA 402 step, compared with the state machine of the standard and with the compiled step."""

import pytest

from catenary import core
from catenary.drive.state_machine import RequestedState, controlword_towards
from catenary.wire.cia402 import COMMANDS, TRANSITIONS, AxisState, state_of

# Transitions of the drive, by the table of the standard (IEC 61800-7-201 table 29).
BY_ITSELF = {
    AxisState.NOT_READY_TO_SWITCH_ON: AxisState.SWITCH_ON_DISABLED,  # transition 1
    AxisState.FAULT_REACTION_ACTIVE: AxisState.FAULT,  # transition 14
}


def obey(state: AxisState, controlword: int, previous: int) -> AxisState:
    """Return the next state of a drive, by the transition table of the standard."""
    if state in BY_ITSELF:
        return BY_ITSELF[state]
    for transition in TRANSITIONS:
        if transition.source is not state or transition.number == 16:
            continue
        for command in transition.commands:
            edge = command.name != "fault reset" or not command.matches(previous)
            if command.matches(controlword) and edge:
                return transition.target
    return state


def walk(state: AxisState, requested_state: RequestedState, previous: int) -> list[AxisState]:
    """Return the states that a drive passes through towards a requested state."""
    path = [state]
    for _ in range(12):
        word = controlword_towards(state, requested_state, previous)
        state, previous = obey(state, word, previous), word
        if state is not path[-1]:
            path.append(state)
    return path


@pytest.mark.parametrize("state", AxisState)
@pytest.mark.parametrize("previous", [0x0000, 0x000F, 0x0007, 0x0080])
def test_every_state_can_be_enabled(state: AxisState, previous: int) -> None:
    if state is AxisState.FAULT and previous == 0x0080:
        pytest.skip("bit 7 was set before the fault: the core clears it while the fault reacts")
    assert walk(state, RequestedState.ENABLED, previous)[-1] is AxisState.OPERATION_ENABLED


@pytest.mark.parametrize(
    "state", set(AxisState) - {AxisState.FAULT, AxisState.FAULT_REACTION_ACTIVE}
)
def test_disabled_ends_without_power(state: AxisState) -> None:
    end = walk(state, RequestedState.DISABLED, 0)[-1]
    assert end in (AxisState.SWITCH_ON_DISABLED, AxisState.READY_TO_SWITCH_ON)


def test_a_fault_remains_until_a_reset_is_requested() -> None:
    assert (
        walk(AxisState.FAULT_REACTION_ACTIVE, RequestedState.DISABLED, 0x000F)[-1]
        is AxisState.FAULT
    )
    assert walk(AxisState.FAULT, RequestedState.QUICK_STOP, 0x000F)[-1] is AxisState.FAULT
    assert walk(AxisState.FAULT, RequestedState.RESET, 0x000F)[-1] is AxisState.SWITCH_ON_DISABLED


def test_a_quick_stop_remains_until_another_request() -> None:
    assert (
        walk(AxisState.OPERATION_ENABLED, RequestedState.QUICK_STOP, 0x000F)[-1]
        is AxisState.QUICK_STOP_ACTIVE
    )
    assert (
        walk(AxisState.QUICK_STOP_ACTIVE, RequestedState.DISABLED, 0x0002)[-1]
        is AxisState.SWITCH_ON_DISABLED
    )


def test_enabling_out_of_a_quick_stop_goes_through_the_whole_machine() -> None:
    path = walk(AxisState.QUICK_STOP_ACTIVE, RequestedState.ENABLED, 0x0002)
    assert path[1] is AxisState.SWITCH_ON_DISABLED
    assert path[-1] is AxisState.OPERATION_ENABLED


def test_only_commands_of_the_standard_are_sent() -> None:
    for state in AxisState:
        for requested_state in RequestedState:
            word = controlword_towards(state, requested_state, 0)
            assert any(command.matches(word) for command in COMMANDS)


def test_an_unknown_state_disables_the_voltage() -> None:
    assert controlword_towards(None, RequestedState.ENABLED, 0x000F) == 0


def test_the_compiled_twin_agrees_on_states() -> None:
    for statusword in range(1 << 16):
        state = state_of(statusword)
        assert core.state_of(statusword) == (255 if state is None else state)


@pytest.mark.parametrize("requested_state", RequestedState)
def test_the_compiled_twin_agrees_on_commands(requested_state: RequestedState) -> None:
    for previous in range(256):
        for state in AxisState:
            assert core.controlword_towards(
                state, requested_state, previous
            ) == controlword_towards(state, requested_state, previous)
        assert core.controlword_towards(255, requested_state, previous) == 0
