from libc.stdint cimport uint32_t

from catenary.core._axes cimport axes_t, axis_t
from catenary.core._handover cimport target_t

cdef enum:  # share.jog.JogStatus
    MOVING = 1
    STOPPING = 2
    DONE = 3
    RELEASED = 4
    EXPIRED = 5
    AT_LIMIT = 6
    ENDED_STOPPED = 7
    REPLACED = 8
    REFUSED_NOT_ALLOWED = 16
    REFUSED_NOT_ENABLED = 17
    REFUSED_MODE = 18
    REFUSED_MOVING = 19
    REFUSED_STALE = 20
    REFUSED_INVALID = 21

cdef enum:  # share.jog.RequestStatus
    TAKEN = 1
    REFUSED_LOST = 22
    REFUSED_HANDOVER = 23

cdef void jog_take_requests(axes_t *x, const target_t *t) noexcept nogil
cdef void jog_judge(axes_t *x) noexcept nogil
cdef void jog_setpoint(axes_t *x, axis_t *a, const target_t *t, uint32_t i) noexcept nogil
