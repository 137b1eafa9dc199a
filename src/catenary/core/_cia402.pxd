from libc.stdint cimport uint8_t, uint16_t

cdef enum:
    NOT_READY_TO_SWITCH_ON = 0
    SWITCH_ON_DISABLED = 1
    READY_TO_SWITCH_ON = 2
    SWITCHED_ON = 3
    OPERATION_ENABLED = 4
    QUICK_STOP_ACTIVE = 5
    FAULT_REACTION_ACTIVE = 6
    FAULT = 7
    UNKNOWN_STATE = 255

cdef enum:
    DISABLED = 0
    ENABLED = 1
    QUICK_STOP = 2
    RESET = 3

cdef enum:
    FAULT_RESET = 0x80  # controlword bit 7

cdef uint8_t cia402_state(uint16_t statusword) noexcept nogil
cdef uint16_t cia402_command(uint8_t state, uint8_t requested_state, uint16_t previous) noexcept nogil
