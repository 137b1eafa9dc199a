"""CiA 402 state machine of the MainDevice in plain Python, IEC 61800-7-201 §6.

`core/_cia402.pyx` is the compiled equivalent. The same tables test both. The state machine of the
virtual servo is separate code, so that each tests the other.
"""

from __future__ import annotations

from enum import IntEnum

from catenary.wire.cia402 import (
    DISABLE_OPERATION,
    DISABLE_VOLTAGE,
    ENABLE_OPERATION,
    FAULT_RESET,
    QUICK_STOP,
    SHUTDOWN,
    SWITCH_ON,
    AxisState,
    Controlword,
)


class RequestedState(IntEnum):
    """Requested state of an axis; the values are those of the core."""

    DISABLED = 0
    ENABLED = 1
    QUICK_STOP = 2
    RESET = 3  # disabled, with a fault reset


# Command for (state, requested state). The default is DISABLE_VOLTAGE. It does nothing in states
# that the drive leaves on its own (transitions 0, 14), leaves a quick stop (12), and clears bit 7
# in a fault.
TOWARDS: dict[tuple[AxisState, RequestedState], Controlword] = {
    (AxisState.READY_TO_SWITCH_ON, RequestedState.DISABLED): SHUTDOWN,  # stays
    (AxisState.SWITCHED_ON, RequestedState.DISABLED): SHUTDOWN,  # transition 6
    (
        AxisState.OPERATION_ENABLED,
        RequestedState.DISABLED,
    ): DISABLE_OPERATION,  # transition 5, ramp of 0x605C
    (AxisState.SWITCH_ON_DISABLED, RequestedState.ENABLED): SHUTDOWN,  # transition 2
    (AxisState.READY_TO_SWITCH_ON, RequestedState.ENABLED): SWITCH_ON,  # transition 3
    (AxisState.SWITCHED_ON, RequestedState.ENABLED): ENABLE_OPERATION,  # transition 4
    (AxisState.OPERATION_ENABLED, RequestedState.ENABLED): ENABLE_OPERATION,  # stays
    (AxisState.FAULT, RequestedState.ENABLED): FAULT_RESET,  # transition 15
    (AxisState.READY_TO_SWITCH_ON, RequestedState.QUICK_STOP): QUICK_STOP,  # transition 7
    (AxisState.SWITCHED_ON, RequestedState.QUICK_STOP): QUICK_STOP,  # transition 10
    (
        AxisState.OPERATION_ENABLED,
        RequestedState.QUICK_STOP,
    ): QUICK_STOP,  # transition 11, by 0x605A
    (
        AxisState.QUICK_STOP_ACTIVE,
        RequestedState.QUICK_STOP,
    ): QUICK_STOP,  # stays; transition 16 would start a motion
    (AxisState.READY_TO_SWITCH_ON, RequestedState.RESET): SHUTDOWN,
    (AxisState.SWITCHED_ON, RequestedState.RESET): SHUTDOWN,
    (AxisState.OPERATION_ENABLED, RequestedState.RESET): DISABLE_OPERATION,
    (AxisState.FAULT, RequestedState.RESET): FAULT_RESET,
}


def controlword_towards(
    state: AxisState | None, requested_state: RequestedState, previous: int
) -> int:
    """Return the command bits (0 to 3 and 7) for the next transition towards a requested state.

    Before a fault reset (a rising edge of bit 7), the other command bits are cleared.

    Args:
        state: present state of the drive; None if the statusword does not encode a valid state.
        requested_state: requested state.
        previous: previous controlword.
    """
    if state is None:
        return DISABLE_VOLTAGE.value
    command = TOWARDS.get((state, requested_state), DISABLE_VOLTAGE)
    if command is FAULT_RESET and previous & 0x000F:
        return DISABLE_VOLTAGE.value
    return command.value
