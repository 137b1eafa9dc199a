from libc.stdint cimport uint32_t, uint64_t

from catenary.core._cycle cimport cycle_t
from catenary.core._histogram cimport histogram_t
from catenary.core._memory cimport cat_memory

cdef class Figures:
    """Log records and histograms of a cycle."""
    cdef cycle_t *cycle
    cdef histogram_t *spare
    cdef cat_memory memory     # memory of the histograms
    cdef cat_memory log_memory
    cdef uint64_t log_cycles
    cdef int attach(self, cycle_t *cycle, uint64_t log_cycles, uint32_t log_axes) except -1
    cdef bytes log(self)
    cdef dict histograms(self)
    cdef list counts(self, str phase)
    cdef void reset(self) noexcept
