from libc.stdint cimport uint8_t, uint16_t, uint32_t, uint64_t

from catenary.core._axes cimport axes_t, axis_t
from catenary.core._handover cimport target_t

cdef void guard_observe(axes_t *x, axis_t *a, bint valid, uint8_t state_before,
                        uint64_t number) noexcept nogil
cdef void guard_request(axes_t *x, axis_t *a, const target_t *t, uint32_t i) noexcept nogil
cdef void guard_stop(axes_t *x) noexcept nogil
cdef uint16_t guard_controlword(axes_t *x, axis_t *a, uint16_t bits) noexcept nogil
cdef void guard_setpoints(axes_t *x, axis_t *a, const target_t *t, uint32_t i,
                          bint fresh) noexcept nogil
