from libc.stdint cimport int8_t, uint8_t, uint16_t, uint32_t, uint64_t

from catenary.core._axes cimport axes_t, axis_t
from catenary.core._cia402 cimport ENABLED, OPERATION_ENABLED
from catenary.core._handover cimport target_t

cdef enum:  # modes of operation, 0x6060
    PROFILE_POSITION = 1
    PROFILE_VELOCITY = 3
    PROFILE_TORQUE = 4
    CSP = 8
    CSV = 9
    CST = 10

cdef enum:
    NO_QUANTITY = 0
    POSITION = 1
    VELOCITY = 2
    TORQUE = 3

cdef inline uint8_t quantity_of(int8_t mode) noexcept nogil:
    if mode == CSP or mode == PROFILE_POSITION:
        return POSITION
    if mode == CSV or mode == PROFILE_VELOCITY:
        return VELOCITY
    if mode == CST or mode == PROFILE_TORQUE:
        return TORQUE
    return NO_QUANTITY

cdef enum:
    MODE_BITS = 0x0270         # controlword bits 4, 5, 6, 9: the mode's, in OPERATION_ENABLED
    FREE_BITS = 0xF800         # 11 to 15: the manufacturer's, always
    OPERATE = 0x000F           # the command of an axis that works

cdef void guard_observe(axes_t *x, axis_t *a, uint8_t state_before,
                        uint64_t number) noexcept nogil
cdef void guard_take_request(axes_t *x, axis_t *a, const target_t *t, uint32_t i) noexcept nogil
cdef void guard_stop(axes_t *x) noexcept nogil
cdef uint16_t guard_lead(axes_t *x, axis_t *a, uint16_t bits) noexcept nogil
cdef void guard_setpoints(axes_t *x, axis_t *a, const target_t *t, uint32_t i,
                          bint fresh) noexcept nogil

cdef inline void guard_mode(axis_t *a, int8_t mode) noexcept nogil:
    """Takes the mode asked for over. Another one: what was written for the former counts no longer,
    and the new one is not followed before the drive shows it."""
    if mode != a.mode:
        a.mode = mode
        a.followed = 0

cdef inline void guard_request(axes_t *x, axis_t *a, const target_t *t, uint32_t i) noexcept nogil:
    """An axis that works and is asked nothing new has nothing to take over."""
    if t.request[i] != a.request or (a.goal == ENABLED and not a.followed):
        guard_take_request(x, a, t, i)

cdef inline bint guard_works(const axis_t *a) noexcept nogil:
    """It follows, and nothing else is wanted: its controlword is known."""
    return a.followed and a.goal == ENABLED and a.state == OPERATION_ENABLED and not a.clear_reset

cdef inline uint16_t guard_controlword(axes_t *x, axis_t *a, uint16_t bits) noexcept nogil:
    """Once a cycle: an edge of bit 7 is kept from being lost. Of an axis that works as often as one
    likes."""
    if not guard_works(a):
        return guard_lead(x, a, bits)
    a.command = OPERATE
    return OPERATE | (bits & (MODE_BITS | FREE_BITS))
