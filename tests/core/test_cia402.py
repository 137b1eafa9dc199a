"""The compiled CiA 402 step on the standard's tables."""

import pytest

from catenary.core import (
    REQUEST_DISABLED,
    REQUEST_ENABLED,
    REQUEST_QUICK_STOP,
    REQUEST_RESET,
    controlword_towards,
    state_of,
)
from catenary.wire import cia402
from catenary.wire.cia402 import AxisState

REQUESTS = (REQUEST_DISABLED, REQUEST_ENABLED, REQUEST_QUICK_STOP, REQUEST_RESET)


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
    ("start", "requested_state", "path"),
    [
        (AxisState.SWITCH_ON_DISABLED, REQUEST_ENABLED, [2, 3, 4]),
        (AxisState.FAULT, REQUEST_ENABLED, [1, 2, 3, 4]),
        (AxisState.FAULT, REQUEST_RESET, [1]),
        (AxisState.FAULT, REQUEST_DISABLED, []),
        (AxisState.FAULT, REQUEST_QUICK_STOP, []),
        (AxisState.QUICK_STOP_ACTIVE, REQUEST_ENABLED, [1, 2, 3, 4]),
        (AxisState.QUICK_STOP_ACTIVE, REQUEST_QUICK_STOP, []),
        (AxisState.OPERATION_ENABLED, REQUEST_QUICK_STOP, [5]),
        (AxisState.OPERATION_ENABLED, REQUEST_DISABLED, [3, 2]),
        (AxisState.OPERATION_ENABLED, REQUEST_RESET, [3, 2]),
        (AxisState.READY_TO_SWITCH_ON, REQUEST_QUICK_STOP, [1]),
        (AxisState.SWITCHED_ON, REQUEST_QUICK_STOP, [1]),
        (AxisState.SWITCH_ON_DISABLED, REQUEST_DISABLED, []),
        (AxisState.NOT_READY_TO_SWITCH_ON, REQUEST_ENABLED, []),
        (AxisState.FAULT_REACTION_ACTIVE, REQUEST_ENABLED, []),
    ],
)
def test_the_words_lead_along_the_transitions(
    start: AxisState, requested_state: int, path: list[int]
) -> None:
    state, word, taken = start, 0x0F, []
    for _ in range(12):
        before, word = word, controlword_towards(state, requested_state, word)
        reached = next_states(state, word, before)
        assert len(reached) <= 1
        if reached and reached != {state}:
            state = reached.pop()
            taken.append(int(state))
    assert taken == path


def test_an_enabled_drive_that_fell_into_fault_sees_its_commands_cleared_before_the_reset() -> None:
    assert controlword_towards(AxisState.FAULT, REQUEST_ENABLED, 0x0F) == 0
    assert controlword_towards(AxisState.FAULT, REQUEST_ENABLED, 0x00) == 0x80
    assert controlword_towards(AxisState.FAULT, REQUEST_ENABLED, 0x80) == 0x80


def test_no_command_for_an_unknown_state() -> None:
    assert [controlword_towards(255, requested_state, 0) for requested_state in REQUESTS] == [
        0,
        0,
        0,
        0,
    ]


@pytest.mark.parametrize("requested_state", [-1, 4])
def test_an_unknown_request_is_refused(requested_state: int) -> None:
    with pytest.raises(ValueError, match="requested state"):
        controlword_towards(4, requested_state, 0)
