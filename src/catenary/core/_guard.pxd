from libc.stdint cimport int8_t, uint8_t, uint16_t, uint32_t, uint64_t

from catenary.core._axes cimport axes_t, axis_t
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

cdef void guard_observe(axes_t *x, axis_t *a, uint8_t state_before,
                        uint64_t number) noexcept nogil
cdef void guard_mode(axis_t *a, int8_t mode) noexcept nogil
cdef void guard_request(axes_t *x, axis_t *a, const target_t *t, uint32_t i) noexcept nogil
cdef void guard_stop(axes_t *x) noexcept nogil
cdef uint16_t guard_controlword(axes_t *x, axis_t *a, uint16_t bits) noexcept nogil
cdef void guard_setpoints(axes_t *x, axis_t *a, const target_t *t, uint32_t i,
                          bint fresh) noexcept nogil
