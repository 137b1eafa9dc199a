"""The compiled CiA 402 step on the standard's tables."""

import pytest

from catenary.core import (
    GOAL_DISABLED,
    GOAL_ENABLED,
    GOAL_QUICK_STOP,
    GOAL_RESET,
    controlword_towards,
    state_of,
)
from catenary.wire import cia402
from catenary.wire.cia402 import AxisState

GOALS = (GOAL_DISABLED, GOAL_ENABLED, GOAL_QUICK_STOP, GOAL_RESET)


def test_every_statusword_has_the_state_the_standard_codes() -> None:
    for statusword in range(0x10000):
        expected = cia402.state_of(statusword)
        assert state_of(statusword) == (255 if expected is None else expected)


def next_states(state: AxisState, controlword: int, before: int) -> set[AxisState]:
    """Where the standard's commands can lead, without what a drive does by itself."""
    edge = controlword & ~before & 0x80
    return {
        t.target
        for t in cia402.TRANSITIONS
        if t.source == state
        for command in t.commands
        if command.matches(controlword) and (command is not cia402.FAULT_RESET or edge)
    }


@pytest.mark.parametrize(
    ("start", "goal", "path"),
    [
        (AxisState.SWITCH_ON_DISABLED, GOAL_ENABLED, [2, 3, 4]),
        (AxisState.FAULT, GOAL_ENABLED, [1, 2, 3, 4]),
        (AxisState.FAULT, GOAL_RESET, [1]),
        (AxisState.FAULT, GOAL_DISABLED, []),
        (AxisState.FAULT, GOAL_QUICK_STOP, []),
        (AxisState.QUICK_STOP_ACTIVE, GOAL_ENABLED, [1, 2, 3, 4]),
        (AxisState.QUICK_STOP_ACTIVE, GOAL_QUICK_STOP, []),
        (AxisState.OPERATION_ENABLED, GOAL_QUICK_STOP, [5]),
        (AxisState.OPERATION_ENABLED, GOAL_DISABLED, [3, 2]),
        (AxisState.OPERATION_ENABLED, GOAL_RESET, [3, 2]),
        (AxisState.READY_TO_SWITCH_ON, GOAL_QUICK_STOP, [1]),
        (AxisState.SWITCHED_ON, GOAL_QUICK_STOP, [1]),
        (AxisState.SWITCH_ON_DISABLED, GOAL_DISABLED, []),
        (AxisState.NOT_READY_TO_SWITCH_ON, GOAL_ENABLED, []),
        (AxisState.FAULT_REACTION_ACTIVE, GOAL_ENABLED, []),
    ],
)
def test_the_words_lead_along_the_transitions(start: AxisState, goal: int, path: list[int]) -> None:
    state, word, taken = start, 0x0F, []
    for _ in range(12):
        before, word = word, controlword_towards(state, goal, word)
        reached = next_states(state, word, before)
        assert len(reached) <= 1
        if reached and reached != {state}:
            state = reached.pop()
            taken.append(int(state))
    assert taken == path


def test_an_enabled_drive_that_fell_into_fault_sees_its_commands_cleared_before_the_reset() -> None:
    assert controlword_towards(AxisState.FAULT, GOAL_ENABLED, 0x0F) == 0
    assert controlword_towards(AxisState.FAULT, GOAL_ENABLED, 0x00) == 0x80
    assert controlword_towards(AxisState.FAULT, GOAL_ENABLED, 0x80) == 0x80


def test_no_command_for_an_unknown_state() -> None:
    assert [controlword_towards(255, goal, 0) for goal in GOALS] == [0, 0, 0, 0]


@pytest.mark.parametrize("goal", [-1, 4])
def test_an_unknown_goal_is_refused(goal: int) -> None:
    with pytest.raises(ValueError, match="goal"):
        controlword_towards(4, goal, 0)
