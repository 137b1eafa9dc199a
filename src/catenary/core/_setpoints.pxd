from libc.stdint cimport uint32_t

from catenary.core._axes cimport axes_t, axis_t
from catenary.core._handover cimport target_t

cdef void axis_setpoints(axes_t *x, axis_t *a, const target_t *t, uint32_t i,
                         bint fresh) noexcept nogil
