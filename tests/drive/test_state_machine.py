"""The CiA 402 step: its table against the standard's machine, and against its compiled twin."""

import pytest

from catenary import core
from catenary.drive.state_machine import Goal, controlword_towards
from catenary.wire.cia402 import COMMANDS, TRANSITIONS, State, state_of

# The drive's side, by the standard's own table of transitions (IEC 61800-7-201 table 29).
BY_ITSELF = {
    State.NOT_READY_TO_SWITCH_ON: State.SWITCH_ON_DISABLED,  # transition 1
    State.FAULT_REACTION_ACTIVE: State.FAULT,  # transition 14
}


def obey(state: State, controlword: int, previous: int) -> State:
    """What a drive does with a controlword, by the standard's table of transitions."""
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


def walk(state: State, goal: Goal, previous: int) -> list[State]:
    """The states a drive goes through when it is led towards a goal."""
    path = [state]
    for _ in range(12):
        word = controlword_towards(state, goal, previous)
        state, previous = obey(state, word, previous), word
        if state is not path[-1]:
            path.append(state)
    return path


@pytest.mark.parametrize("state", State)
@pytest.mark.parametrize("previous", [0x0000, 0x000F, 0x0007, 0x0080])
def test_every_state_can_be_enabled(state: State, previous: int) -> None:
    if state is State.FAULT and previous == 0x0080:
        pytest.skip("bit 7 was set before the fault: the core clears it while the fault reacts")
    assert walk(state, Goal.ENABLED, previous)[-1] is State.OPERATION_ENABLED


@pytest.mark.parametrize("state", set(State) - {State.FAULT, State.FAULT_REACTION_ACTIVE})
def test_disabled_ends_without_power(state: State) -> None:
    end = walk(state, Goal.DISABLED, 0)[-1]
    assert end in (State.SWITCH_ON_DISABLED, State.READY_TO_SWITCH_ON)


def test_a_fault_is_kept_until_somebody_asks() -> None:
    assert walk(State.FAULT_REACTION_ACTIVE, Goal.DISABLED, 0x000F)[-1] is State.FAULT
    assert walk(State.FAULT, Goal.QUICK_STOP, 0x000F)[-1] is State.FAULT
    assert walk(State.FAULT, Goal.RESET, 0x000F)[-1] is State.SWITCH_ON_DISABLED


def test_quick_stop_stays_until_told_otherwise() -> None:
    assert walk(State.OPERATION_ENABLED, Goal.QUICK_STOP, 0x000F)[-1] is State.QUICK_STOP_ACTIVE
    assert walk(State.QUICK_STOP_ACTIVE, Goal.DISABLED, 0x0002)[-1] is State.SWITCH_ON_DISABLED


def test_enabling_out_of_a_quick_stop_goes_through_the_whole_machine() -> None:
    path = walk(State.QUICK_STOP_ACTIVE, Goal.ENABLED, 0x0002)
    assert path[1] is State.SWITCH_ON_DISABLED
    assert path[-1] is State.OPERATION_ENABLED


def test_only_commands_of_the_standard_are_given() -> None:
    for state in State:
        for goal in Goal:
            word = controlword_towards(state, goal, 0)
            assert any(command.matches(word) for command in COMMANDS)


def test_an_unknown_state_gets_no_voltage() -> None:
    assert controlword_towards(None, Goal.ENABLED, 0x000F) == 0


def test_the_compiled_twin_agrees_on_states() -> None:
    for statusword in range(1 << 16):
        state = state_of(statusword)
        assert core.state_of(statusword) == (255 if state is None else state)


@pytest.mark.parametrize("goal", Goal)
def test_the_compiled_twin_agrees_on_commands(goal: Goal) -> None:
    for previous in range(256):
        for state in State:
            assert core.controlword_towards(state, goal, previous) == controlword_towards(
                state, goal, previous
            )
        assert core.controlword_towards(255, goal, previous) == 0
