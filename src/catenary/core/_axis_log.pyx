# cython: boundscheck=False, wraparound=False, cdivision=True
"""Log of the values of every axis in every cycle: a ring of rows in the locked memory of the log.

A row contains the cycle number and one axis_record_t for each axis. The writer clears the number,
writes the records and stores the number again (release). A reader copies a row and checks that the
number is the same before and after the copy; otherwise the row belongs to another cycle. `rows`
NULL: no axis is logged. Budget: 10 ns for each axis.
"""

from libc.stdint cimport uint8_t, uint32_t, uint64_t

from catenary.core._handover cimport actual_t, target_t
from catenary.core._native cimport cat_fence, cat_load_acquire64, cat_store_release64

AXIS_FIELDS = [
    ("actual.position", "<f8"),
    ("actual.velocity", "<f8"),
    ("actual.torque", "<f8"),
    ("target.position", "<f8"),
    ("target.velocity", "<f8"),
    ("target.torque", "<f8"),
    ("commanded.position", "<f8"),
    ("commanded.velocity", "<f8"),
    ("commanded.torque", "<f8"),
    ("statusword", "<u2"),
    ("controlword", "<u2"),
    ("mode", "i1"),
    ("state", "u1"),
    ("reserved", "2u1"),
]


cdef inline uint8_t *row_of(const axis_log_t *log, uint64_t number) noexcept nogil:
    return log.rows + (number & log.mask) * log.row_size


cdef size_t axis_log_row_size(uint32_t axes) noexcept nogil:
    """Return the size of a row: the number, then a record for each axis."""
    return sizeof(uint64_t) + axes * sizeof(axis_record_t)


cdef void axis_log_put(axis_log_t *log, uint64_t number, const actual_t *actual,
                       const target_t *target) noexcept nogil:
    """Write the row of a cycle."""
    cdef uint8_t *row = row_of(log, number)
    cdef uint64_t *stamp = <uint64_t *>row
    cdef axis_record_t *r = <axis_record_t *>(row + sizeof(uint64_t))
    cdef uint32_t i
    cat_store_release64(stamp, 0)
    cat_fence()  # the number is cleared before the records change
    for i in range(log.axes):
        r[i].actual_position = actual.position[i]
        r[i].actual_velocity = actual.velocity[i]
        r[i].actual_torque = actual.torque[i]
        r[i].target_position = target.position[i]
        r[i].target_velocity = target.velocity[i]
        r[i].target_torque = target.torque[i]
        r[i].commanded_position = actual.commanded_position[i]
        r[i].commanded_velocity = actual.commanded_velocity[i]
        r[i].commanded_torque = actual.commanded_torque[i]
        r[i].statusword = actual.statusword[i]
        r[i].controlword = actual.controlword[i]
        r[i].mode = actual.mode[i]
        r[i].state = actual.state[i]
    cat_store_release64(stamp, number)


cdef bytes axis_log_row(const axis_log_t *log, uint64_t number):
    """Return the records of a cycle; None if the row was overwritten.

    If axes are not logged, return empty bytes.
    """
    cdef uint8_t *row
    cdef uint64_t *stamp
    if log.rows == NULL:
        return b""
    row = row_of(log, number)
    stamp = <uint64_t *>row
    if cat_load_acquire64(stamp) != number:
        return None
    copy = (<char *>row)[sizeof(uint64_t):log.row_size]
    cat_fence()  # before the number is read again
    return copy if cat_load_acquire64(stamp) == number else None
