from libc.stdint cimport uint32_t, uint64_t

from catenary.core._handover cimport target_t
from catenary.core._memory cimport cat_memory

cdef struct stream_t:
    double *rows               # position, velocity, torque of all axes, one behind the other
    uint64_t *seen             # of each row: the cycle whose actual values its writer had read
    uint32_t axes
    uint32_t capacity          # rows
    uint64_t written           # rows so far; the writer's
    uint64_t taken             # rows so far; the cycle's
    uint64_t dry               # instants without a row, since the first one

cdef class Stream:
    """Owns the rows of set-points that wait for their instants."""
    cdef stream_t c
    cdef cat_memory memory

cdef bint stream_take(stream_t *s, target_t *target) noexcept nogil
