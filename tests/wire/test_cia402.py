"""CiA 402: states, words, transitions, modes."""

from __future__ import annotations

import pytest
from hypothesis import given

from catenary.wire import cia402
from catenary.wire.cia402 import (
    COMMANDS,
    STATE_CODING,
    TRANSITIONS,
    AxisState,
    Control,
    Mode,
    Status,
    state_of,
)
from tests.wire.strategies import u16


# CiA 402-2, figure "coding of the statusword", with bits that do not matter set as drives do
@pytest.mark.parametrize(
    ("statusword", "state"),
    [
        (0x0000, AxisState.NOT_READY_TO_SWITCH_ON),
        (0x0250, AxisState.SWITCH_ON_DISABLED),
        (0x0231, AxisState.READY_TO_SWITCH_ON),
        (0x0233, AxisState.SWITCHED_ON),
        (0x1637, AxisState.OPERATION_ENABLED),
        (0x0217, AxisState.QUICK_STOP_ACTIVE),
        (0x021F, AxisState.FAULT_REACTION_ACTIVE),
        (0x0218, AxisState.FAULT),
        (0x0238, AxisState.FAULT),
    ],
)
def test_states_of_statuswords(statusword, state):
    assert state_of(statusword) is state


@given(u16)
def test_at_most_one_state(statusword):
    matching = [
        state for state, (mask, value) in STATE_CODING.items() if statusword & mask == value
    ]
    assert len(matching) <= 1
    assert state_of(statusword) is (matching[0] if matching else None)


def test_a_statusword_without_a_valid_state():
    assert state_of(0x0001) is None  # ready to switch on, but in quick stop
    assert state_of(0x0022) is None


def test_the_numbers_of_states_are_fixed():
    # the core and the Views of the plan exchange them as bytes
    assert [state.value for state in AxisState] == list(range(8))
    assert AxisState.OPERATION_ENABLED == 4


# CiA 402-2, table "command coding"
@pytest.mark.parametrize(
    ("controlword", "names"),
    [
        (0x0006, {"shutdown"}),
        (0x0007, {"switch on", "disable operation"}),
        (0x000F, {"enable operation"}),
        (0x0000, {"disable voltage"}),
        (0x0002, {"quick stop"}),
        (0x0080, {"fault reset"}),
    ],
)
def test_command_of_a_controlword(controlword, names):
    assert {each.name for each in COMMANDS if each.matches(controlword)} == names


@given(u16)
def test_a_command_keeps_all_other_bits(controlword):
    for each in COMMANDS:
        applied = each.apply(controlword)
        assert each.matches(applied)
        assert applied & ~each.mask == controlword & ~each.mask & 0xFFFF


def test_the_table_has_all_transitions_in_order():
    assert [each.number for each in TRANSITIONS] == list(range(17))


def test_a_command_has_one_target_per_state():
    for state in AxisState:
        for command in COMMANDS:
            targets = [
                each.target
                for each in TRANSITIONS
                if each.source is state and command in each.commands
            ]
            assert len(targets) <= 1


def test_enabling_takes_three_commands():
    state, path = AxisState.SWITCH_ON_DISABLED, []
    for command in (cia402.SHUTDOWN, cia402.SWITCH_ON, cia402.ENABLE_OPERATION):
        [state] = [t.target for t in TRANSITIONS if t.source is state and command in t.commands]
        path.append(state)
    assert path == [
        AxisState.READY_TO_SWITCH_ON,
        AxisState.SWITCHED_ON,
        AxisState.OPERATION_ENABLED,
    ]


def test_supported_bits_of_modes():
    assert (Mode.CSP, Mode.CSV, Mode.CST) == (8, 9, 10)
    assert Mode.CSP.supported_bit == 0x80
    assert Mode.NONE.supported_bit == 0


def test_bits_that_belong_to_the_mode():
    state_machine = 0x008F | Control.HALT | Control.RESERVED_10
    assert 0xFFFF & ~state_machine == cia402.MODE_CONTROL_BITS
    assert cia402.FOLLOWS_COMMAND is Status.MODE_12
