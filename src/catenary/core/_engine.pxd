from libc.stdint cimport int64_t, uint32_t

from catenary.core._axes cimport Axes
from catenary.core._cycle cimport cycle_t
from catenary.core._frames cimport Frames
from catenary.core._handover cimport Handover, actual_header_t, handover_t
from catenary.core._histogram cimport histogram_t
from catenary.core._lane cimport Lane
from catenary.core._thread cimport cat_scheduling, thread_t

cdef struct engine_t:
    cycle_t cycle
    thread_t thread
    int error                  # why the native thread ended by itself
    uint32_t done              # it has ended

cdef class Engine:
    cdef engine_t e
    cdef handover_t *h
    cdef Frames frames
    cdef Lane lane
    cdef Axes axes
    cdef Handover handover
    cdef object law
    cdef dict _buffers
    cdef cat_scheduling scheduling_before
    cdef bint saved_scheduling
    cdef histogram_t *spare_histograms
    cdef bint virtual          # the link's time is virtual: everything in the caller's thread
    cdef bint native           # the cycle runs in its own thread
    cdef bint running
    cdef bint emitted          # inline: the frames of this cycle are on their way
    cdef int64_t lead          # inline: how long before the instant Python's thread wakes [ns]
    cdef object rehearsal      # called in the lead
    cdef int64_t left          # when `next` returned [ns]; -1: no application since

    cdef connect(self, plan)
    cdef uint32_t step(self, int64_t timeout_ns=*) except? 0xFFFFFFFF
    cdef actual_header_t *actual_header(self) noexcept
    cdef void inline_outputs(self, bint application) noexcept nogil
    cdef int inline_inputs(self) except -1
    cdef int lockstep(self) except -1
    cdef uint32_t step_native(self, int64_t timeout_ns) except? 0xFFFFFFFF
    cdef void commit(self, bint hold) noexcept
    cdef int await_cycle(self, int64_t timeout_ns) except -1
    cdef uint32_t hold(self, int64_t cycles, bint until_stopped,
                       int64_t deadline) except? 0xFFFFFFFF
    cdef uint32_t hold_native(self, int64_t cycles) except? 0xFFFFFFFF
    cdef uint32_t hold_here(self, int64_t cycles) except? 0xFFFFFFFF
    cdef void take_commanded(self) noexcept
    cdef int interrupted(self, int rc) except -1
    cdef int spend_cycle(self) except -1
    cdef int interrupted_wait(self, int64_t until) except -1
    cdef int64_t now_ns(self) noexcept
