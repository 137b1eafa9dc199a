from libc.stdint cimport int64_t, uint32_t, uint64_t

from catenary.core._native cimport cat_link, cat_trigger

cdef struct trigger_t:
    cat_trigger *sends         # NULL: this loop triggers no others
    cat_trigger *awaits        # NULL: the clock starts the cycles of this loop
    uint32_t seen              # newest tick of `awaits` that was processed
    bint following             # the last cycle was triggered, or the grids agree
    uint64_t missed            # number of cycles that the clock started instead

cdef class TriggerBlock:
    cdef Py_buffer buffer
    cdef cat_trigger *c

cdef int64_t trigger_seek(trigger_t *t, int64_t next, int64_t period, int64_t present) noexcept nogil
cdef int trigger_await(trigger_t *t, const cat_link *link, int64_t next, int64_t period,
                       int64_t busy_wait, int64_t *start) noexcept nogil
