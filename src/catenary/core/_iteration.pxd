from libc.stdint cimport int64_t, uint32_t, uint64_t

from catenary.core._engine cimport Engine
from catenary.core._handover cimport actual_header_t

cdef class Cycle:
    cdef Engine engine
    cdef actual_header_t *header
    cdef int64_t first_ns
    cdef uint64_t first_number

cdef class Iteration:
    cdef Engine engine
    cdef Cycle cycle
    cdef object judge
    cdef object beside
    cdef list movers
    cdef uint32_t trouble
    cdef int al_status
    cdef public object commit_lock
    cdef int commit_if_free(self) except -1
    cpdef int step_movers(self) except -1
