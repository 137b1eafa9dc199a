# cython: boundscheck=False, wraparound=False
"""CiA 402, IEC 61800-7-201 §6: statusword → state, (state, requested state) → controlword.

Two table look-ups, a few nanoseconds per axis. _guard.pyx decides when a requested state ends and
_setpoints.pyx which set-points are valid.
"""

from libc.stdint cimport uint8_t, uint16_t

REQUEST_DISABLED = DISABLED
REQUEST_ENABLED = ENABLED
REQUEST_QUICK_STOP = QUICK_STOP
REQUEST_RESET = RESET

CODING = (
    # mask, value of the statusword, state: IEC 61800-7-201 table 30
    (0x004F, 0x0000, NOT_READY_TO_SWITCH_ON),
    (0x004F, 0x0040, SWITCH_ON_DISABLED),
    (0x006F, 0x0021, READY_TO_SWITCH_ON),
    (0x006F, 0x0023, SWITCHED_ON),
    (0x006F, 0x0027, OPERATION_ENABLED),
    (0x006F, 0x0007, QUICK_STOP_ACTIVE),
    (0x004F, 0x000F, FAULT_REACTION_ACTIVE),
    (0x004F, 0x0008, FAULT),
)

COMMANDS = (
    # for disabled, enabled, quick stop, reset; transitions of IEC 61800-7-201 figure 5
    (0x00, 0x00, 0x00, 0x00),  # not ready to switch on: the drive leaves it by itself
    (0x00, 0x06, 0x00, 0x00),  # switch on disabled: stays, 2, stays, stays
    (0x06, 0x07, 0x02, 0x06),  # ready to switch on: stays, 3, 7, stays
    (0x06, 0x0F, 0x02, 0x06),  # switched on: 6, 4, 10, 6
    (0x07, 0x0F, 0x02, 0x07),  # operation enabled: 5 (ramp of 0x605C), stays, 11 (0x605A), 5
    (0x00, 0x00, 0x02, 0x00),  # quick stop active: 12, 12 (16 would move at once), stays, 12
    (0x00, 0x00, 0x00, 0x00),  # fault reaction active: the drive leaves it by itself
    (0x00, 0x80, 0x00, 0x80),  # fault: stays (and prepares the rising edge of bit 7), 15, stays, 15
)

cdef uint8_t[128] STATE_OF  # only the low seven bits of the statusword are used
cdef uint8_t[8][4] COMMAND_OF


cdef uint8_t cia402_state(uint16_t statusword) noexcept nogil:
    return STATE_OF[statusword & 0x7F]


cdef uint16_t cia402_command(uint8_t state, uint8_t requested_state, uint16_t previous) noexcept nogil:
    cdef uint16_t command
    if state > FAULT or requested_state > RESET:
        return 0
    command = COMMAND_OF[state][requested_state]
    if command == FAULT_RESET and previous & 0x0F:
        return 0  # clear the commands of an enabled drive before the reset
    return command


def state_of(int statusword):
    return cia402_state(<uint16_t>(statusword & 0xFFFF))


def controlword_towards(int state, int requested_state, int previous):
    if not 0 <= requested_state <= RESET:
        raise ValueError(
            f"requested state {requested_state}, must be 0 (disabled), 1 (enabled), 2 (quick stop) or 3"
            " (reset)"
        )
    return cia402_command(<uint8_t>(state & 0xFF), <uint8_t>requested_state, <uint16_t>(previous & 0xFFFF))


def _fill():
    for bits in range(128):
        STATE_OF[bits] = UNKNOWN_STATE
        for mask, value, state in CODING:
            if bits & mask == value:
                STATE_OF[bits] = state
    for state in range(8):
        for requested_state in range(4):
            COMMAND_OF[state][requested_state] = COMMANDS[state][requested_state]


_fill()
