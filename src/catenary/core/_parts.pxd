from libc.stdint cimport int64_t, uint16_t, uint32_t, uint64_t

from catenary.core._axes cimport Axes
from catenary.core._clocks cimport Clock
from catenary.core._cycle cimport cycle_t
from catenary.core._frames cimport Frames
from catenary.core._handover cimport Handover, actual_header_t, handover_t
from catenary.core._histogram cimport histogram_t
from catenary.core._lane cimport Lane
from catenary.core._native cimport cat_image, cat_link
from catenary.core._thread cimport thread_t

cdef struct engine_t:
    cycle_t cycle
    thread_t thread
    int error                  # why the native thread ended by itself
    uint32_t done              # it has ended

cdef class Parts:
    cdef engine_t e
    cdef handover_t *h
    cdef Frames frames         # None: the image table came from outside
    cdef cat_image *image
    cdef const cat_link *link
    cdef tuple owners          # of the two tables
    cdef Lane lane
    cdef Axes axes
    cdef readonly Clock clock  # None: no distributed clocks
    cdef Handover handover
    cdef dict _buffers
    cdef histogram_t *spare_histograms
    cdef bint virtual          # the link's time is virtual: everything in the caller's thread
    cdef uint16_t device_count
    cdef uint64_t log_cycles
    cdef bint alone            # nobody else lives by that time: waits keep the GIL

    cdef connect(self, plan)
    cdef int64_t now_ns(self) noexcept
    cdef actual_header_t *actual_header(self) noexcept
