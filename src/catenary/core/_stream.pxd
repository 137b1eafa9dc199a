from libc.stdint cimport uint32_t, uint64_t

from catenary.core._handover cimport target_t
from catenary.core._memory cimport cat_memory

cdef struct stream_t:
    double *rows               # position, velocity, torque of all axes, row after row
    uint64_t *seen             # per row: newest cycle of which its writer had read the actual values
    uint32_t axes
    uint32_t capacity          # number of rows
    uint64_t written           # number of rows written so far; only the writer changes it
    uint64_t taken             # number of rows taken so far; only the cycle changes it
    uint64_t dry               # number of cycles without a row, since the first row was taken

cdef class Stream:
    """Ring of set-points: one row per cycle start. One thread writes.

    A row contains position [rad], velocity [rad/s] and torque [N·m] of all axes, in this order.

    Args:
        axes: Number of axes.
        capacity: Maximum number of rows.

    Raises:
        ValueError: A number is out of range.
    """
    cdef stream_t c
    cdef cat_memory memory

cdef bint stream_take(stream_t *s, target_t *target) noexcept nogil
