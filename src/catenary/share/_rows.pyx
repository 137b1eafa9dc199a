# cython: boundscheck=False, wraparound=False, cdivision=True
"""Rings of rows in shared memory (ring.h): read, write, and the sink table that a cycle calls.

Time budget of `put`: about 1 us for 33 axes. It copies some kilobytes into uncached memory and makes
one system call.
"""

from cpython.buffer cimport PyBUF_SIMPLE, PyBUF_WRITABLE, PyBuffer_Release, PyObject_GetBuffer
from cpython.bytearray cimport PyByteArray_AS_STRING
from cpython.bytes cimport PyBytes_AS_STRING, PyBytes_FromStringAndSize
from cpython.exc cimport PyErr_CheckSignals
from cpython.pycapsule cimport PyCapsule_GetContext, PyCapsule_New, PyCapsule_SetContext
from cpython.ref cimport Py_DECREF, Py_INCREF, PyObject
from libc.errno cimport EINTR
from libc.stdint cimport int64_t, uint8_t, uint32_t, uint64_t

cdef enum:
    COUNT_MAX = 1 << 24
    SIZE_MAX = 1 << 24


def memory_size(uint64_t count, uint64_t size):
    return sizeof(share_ring) + count * ring_stride(size)


def row_parts(uint64_t record_size, uint64_t actual_size, uint64_t target_size):
    actual_at = (record_size + 7) // 8 * 8
    target_at = actual_at + (actual_size + 7) // 8 * 8
    return 0, actual_at, target_at, target_at + (target_size + 7) // 8 * 8


cdef class Ring:
    def __cinit__(self, memory, uint64_t offset, uint64_t count, uint64_t size, *args, writable=False,
                  motion=None, jog=False):
        """Map the ring. Raises ValueError if it does not fit, or if a value is invalid."""
        PyObject_GetBuffer(memory, &self.buffer, PyBUF_WRITABLE if writable else PyBUF_SIMPLE)
        if not (1 <= count <= COUNT_MAX and 1 <= size <= SIZE_MAX) or count & (count - 1):
            raise ValueError(f"a ring cannot have {count} rows of {size} bytes")
        if offset % 64 or offset > <uint64_t>self.buffer.len:
            raise ValueError(f"a ring cannot begin at offset {offset} of {self.buffer.len} bytes")
        if memory_size(count, size) > <uint64_t>self.buffer.len - offset:
            raise ValueError(f"a ring of {count} rows of {size} bytes at offset {offset} does not"
                             f" fit in {self.buffer.len} bytes")
        self.view = ring_view(
            ring=<share_ring *>(<uint8_t *>self.buffer.buf + offset),
            count=count,
            stride=ring_stride(size),
            size=size,
        )

    def __dealloc__(self):
        PyBuffer_Release(&self.buffer)

    @property
    def newest(self):
        return ring_newest(&self.view)

    @property
    def ended(self):
        return ring_is_ended(&self.view) != 0

    # ---- reading

    def copy(self):
        cdef bytes row = PyBytes_FromStringAndSize(NULL, self.view.size)
        cdef uint64_t number = ring_copy_newest(&self.view, <uint8_t *>PyBytes_AS_STRING(row))
        return number, row

    def copy_after(self, uint64_t after):
        cdef uint64_t newest = ring_newest(&self.view)
        cdef uint64_t first, copied, end
        cdef uint8_t *place
        if newest <= after:
            return bytearray(), 0
        first = after + 1
        if newest >= self.view.count and first <= newest - self.view.count:
            first = newest - self.view.count + 1
        rows = bytearray((newest - first + 1) * self.view.size)
        place = <uint8_t *>PyByteArray_AS_STRING(rows)
        with nogil:
            copied = ring_copy_rows(&self.view, first, newest - first + 1, place, &end)
        del rows[copied * self.view.size :]
        # The next call counts the rows that were overwritten after the last one copied.
        return rows, end - after - copied if copied else 0

    def wait(self, uint64_t seen, int64_t deadline_ns):
        cdef int rc
        while True:
            with nogil:
                rc = ring_wait(&self.view, seen, deadline_ns)
            if rc != -EINTR:
                break
            PyErr_CheckSignals()
        if rc < 0:
            raise OSError(-rc, "cannot wait for a row: futex(2) failed")
        return rc == 1

    # ---- writing

    def write(self, bytes row not None):
        cdef uint64_t number = self.view.ring.newest + 1
        cdef uint64_t size = len(row)
        cdef uint8_t *place
        if self.buffer.readonly:
            raise ValueError("the memory is read-only")
        if size > self.view.size:
            raise ValueError(f"{size} bytes do not fit in a row of {self.view.size} bytes")
        place = ring_begin(&self.view, number)
        cat_copy_to_shared(place, PyBytes_AS_STRING(row), size)
        cat_clear_shared(place + size, self.view.size - size)
        ring_publish(&self.view, number)

    def end(self):
        if self.buffer.readonly:
            raise ValueError("the memory is read-only")
        ring_end(&self.view)


cdef void put(void *self, uint64_t number, const void *record, const void *actual,
              const void *target) noexcept nogil:
    cdef cycle_rows *rows = <cycle_rows *>self
    cdef uint8_t *row = ring_begin(&rows.view, number)
    cat_copy_to_shared(row, record, rows.record_size)
    cat_copy_to_shared(row + rows.actual_at, actual, rows.actual_size)
    cat_copy_to_shared(row + rows.target_at, target, rows.target_size)
    ring_publish(&rows.view, number)


cdef void release_owner(object capsule) noexcept:
    Py_DECREF(<object>PyCapsule_GetContext(capsule))


cdef class CycleWriter(Ring):
    def __init__(self, memory, uint64_t offset, uint64_t count, uint64_t size, sizes, *, writable,
                 motion=None, jog=False):
        record_size, actual_size, target_size = sizes
        _, actual_at, target_at, whole = row_parts(record_size, actual_size, target_size)
        if not writable or whole != size:
            raise ValueError(f"blocks of {whole} bytes do not match writable rows of {size} bytes")
        self.rows = cycle_rows(
            view=self.view,
            record_size=record_size,
            actual_size=actual_size,
            target_size=target_size,
            actual_at=actual_at,
            target_at=target_at,
        )
        self.sink.version = CAT_SINK_VERSION
        self.sink.record_size = record_size
        self.sink.actual_size = actual_size
        self.sink.target_size = target_size
        self.sink.self = &self.rows
        self.sink.put = put
        if motion is not None:
            place, offset, axes = motion
            self.connect_motion(place, offset, axes, jog)

    cdef connect_motion(self, memory, uint64_t offset, uint32_t axes, bint jog):
        """Point the sink at the motion words of the desk, and keep their memory mapped."""
        cdef uint64_t size = sizeof(cat_motion) + <uint64_t>axes * sizeof(cat_motion_slot)
        if self.motion.buf != NULL:
            raise ValueError("the motion words are set already")
        PyObject_GetBuffer(memory, &self.motion, PyBUF_WRITABLE)
        if offset % 64 or offset > <uint64_t>self.motion.len or size > self.motion.len - offset:
            raise ValueError(f"motion words of {axes} axes at offset {offset} do not fit in"
                             f" {self.motion.len} bytes")
        self.sink.motion = <cat_motion *>(<uint8_t *>self.motion.buf + offset)
        self.sink.motion_axes = axes
        self.sink.jog = jog

    def __dealloc__(self):
        if self.motion.buf != NULL:
            PyBuffer_Release(&self.motion)

    @property
    def capsule(self):
        """Capsule of the sink table; it keeps the writer and its memory alive."""
        capsule = PyCapsule_New(&self.sink, CAT_SINK_CAPSULE, release_owner)
        PyCapsule_SetContext(capsule, <void *><PyObject *>self)
        Py_INCREF(self)
        return capsule
