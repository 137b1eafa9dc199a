# cython: boundscheck=False, wraparound=False, cdivision=True
"""Set-points written in advance: a bounded ring with one row per cycle.

One thread writes rows (`written`), the cycle takes them (`taken`). Neither waits for the other.
`dry` counts the cycles without a row since the first row was taken. Budget: 10 ns for three axes.
"""

from libc.stdint cimport uint32_t, uint64_t
from libc.string cimport memcpy

from catenary.core._handover cimport target_t
from catenary.core._memory cimport cat_memory_free, memory_take
from catenary.core._native cimport cat_load_acquire64, cat_store_release64

cdef enum:
    ROWS_MAX = 1 << 20
    QUANTITIES = 3


cdef inline double *row_of(stream_t *s, uint64_t number) noexcept nogil:
    return s.rows + (number % s.capacity) * s.axes * QUANTITIES


cdef bint stream_take(stream_t *s, target_t *target) noexcept nogil:
    """Use the next row as the set-points. Return False if there is none."""
    cdef size_t size = s.axes * sizeof(double)
    cdef const double *row
    if cat_load_acquire64(&s.written) == s.taken:
        if s.taken:
            s.dry += 1
        return False
    row = row_of(s, s.taken)
    memcpy(target.position, row, size)
    memcpy(target.velocity, row + s.axes, size)
    memcpy(target.torque, row + 2 * s.axes, size)
    target.header.seen = s.seen[s.taken % s.capacity]
    cat_store_release64(&s.taken, s.taken + 1)
    return True


cdef class Stream:
    def __cinit__(self, uint32_t axes, uint32_t capacity):
        if axes == 0 or not 1 <= capacity <= ROWS_MAX:
            raise ValueError(f"a stream of {capacity} rows for {axes} axes: it needs 1 to {ROWS_MAX} rows and an axis")
        self.c.axes = axes
        self.c.capacity = capacity
        cdef size_t count = <size_t>axes * capacity * QUANTITIES
        self.c.rows = <double *>memory_take(&self.memory, count, sizeof(double))
        self.c.seen = <uint64_t *>memory_take(&self.memory, capacity, sizeof(uint64_t))

    def write(self, bytes rows not None, uint64_t seen):
        """Append as many rows as there is room for; return their number.

        Args:
            rows: Rows of 3·axes float64.
            seen: The cycle whose actual values the writer had read. A position is valid only for
                axes that were followed in that cycle.

        Raises:
            ValueError: The size is not a multiple of a row.
        """
        cdef stream_t *s = &self.c
        cdef size_t size = s.axes * QUANTITIES * sizeof(double)
        cdef const char *source = rows
        cdef uint64_t count = len(rows) // size
        cdef uint64_t room = s.capacity - (s.written - cat_load_acquire64(&s.taken))
        cdef uint64_t number
        if count * size != <size_t>len(rows):
            raise ValueError(f"{len(rows)} bytes are not whole rows of {s.axes * QUANTITIES} numbers ({size} bytes)")
        count = min(count, room)
        for number in range(count):
            memcpy(row_of(s, s.written + number), source + number * size, size)
            s.seen[(s.written + number) % s.capacity] = seen
        cat_store_release64(&s.written, s.written + count)
        return count

    @property
    def waiting(self):
        return self.c.written - cat_load_acquire64(&self.c.taken)

    @property
    def taken(self):
        return cat_load_acquire64(&self.c.taken)

    @property
    def capacity(self):
        return self.c.capacity

    @property
    def dry(self):
        return self.c.dry

    def __dealloc__(self):
        cat_memory_free(&self.memory)
