# cython: boundscheck=False, wraparound=False, cdivision=True
"""Wait-free values and queues of bytes between tasks."""

from cpython.buffer cimport PyBUF_CONTIG, PyBUF_CONTIG_RO, PyBuffer_Release, PyObject_GetBuffer
from libc.stdint cimport int32_t, int64_t, uint8_t, uint32_t, uint64_t

from catenary.realtime._clock cimport Memory

cdef extern from "latest_value.h" nogil:
    enum:
        VALUE_SLOTS
    ctypedef struct latest_value:
        uint64_t number
        int32_t writer
        uint32_t size
    void value_write(latest_value *v, const void *bytes)
    int64_t value_read(latest_value *v, void *bytes)

cdef extern from "record_queue.h" nogil:
    ctypedef struct record_queue:
        uint64_t put, refused, taken, lost
        int32_t producer, consumer
        uint32_t size, length, overwrite
    uint64_t queue_memory(uint32_t size, uint32_t length)
    int queue_put(record_queue *q, const void *bytes)
    int queue_take(record_queue *q, void *bytes)


def value_size(uint32_t size):
    return sizeof(latest_value) + VALUE_SLOTS * <uint64_t>size


def queue_size(uint32_t size, uint32_t length):
    return queue_memory(size, length)


cdef int check_size(Py_buffer *view, uint32_t size) except -1:
    if view.len != size:
        raise ValueError(f"received {view.len} bytes, expected {size}")
    return 0


cdef class ValueCore:
    """Value in shared memory that starts as zeros. Raises ValueError for data of a wrong size."""
    cdef Memory memory
    cdef latest_value *c

    def __init__(self, memory, uint32_t size):
        self.memory = Memory(memory)
        self.c = <latest_value *>self.memory.at(0, value_size(size))
        self.c.size = size

    @property
    def writer(self):
        return self.c.writer

    @writer.setter
    def writer(self, int32_t thread):
        self.c.writer = thread

    @property
    def number(self):
        return self.c.number

    def write(self, data):
        cdef Py_buffer view
        PyObject_GetBuffer(data, &view, PyBUF_CONTIG_RO)
        try:
            check_size(&view, self.c.size)
            value_write(self.c, view.buf)
        finally:
            PyBuffer_Release(&view)

    def read(self, into):
        cdef Py_buffer view
        PyObject_GetBuffer(into, &view, PyBUF_CONTIG)
        try:
            check_size(&view, self.c.size)
            return value_read(self.c, view.buf)
        finally:
            PyBuffer_Release(&view)


cdef class QueueCore:
    """Queue in shared memory that starts as zeros. Raises ValueError for data of a wrong size."""
    cdef Memory memory
    cdef record_queue *c

    def __init__(self, memory, uint32_t size, uint32_t length, bint overwrite):
        self.memory = Memory(memory)
        self.c = <record_queue *>self.memory.at(0, queue_memory(size, length))
        self.c.size = size
        self.c.length = length
        self.c.overwrite = overwrite

    @property
    def producer(self):
        return self.c.producer

    @producer.setter
    def producer(self, int32_t thread):
        self.c.producer = thread

    @property
    def consumer(self):
        return self.c.consumer

    @consumer.setter
    def consumer(self, int32_t thread):
        self.c.consumer = thread

    @property
    def waiting(self):
        return min(self.c.put - self.c.taken, <uint64_t>self.c.length)

    @property
    def refused(self):
        return self.c.refused

    @property
    def lost(self):
        return self.c.lost

    def put(self, data):
        cdef Py_buffer view
        PyObject_GetBuffer(data, &view, PyBUF_CONTIG_RO)
        try:
            check_size(&view, self.c.size)
            return bool(queue_put(self.c, view.buf))
        finally:
            PyBuffer_Release(&view)

    def take(self, into):
        cdef Py_buffer view
        PyObject_GetBuffer(into, &view, PyBUF_CONTIG)
        try:
            check_size(&view, self.c.size)
            return bool(queue_take(self.c, view.buf))
        finally:
            PyBuffer_Release(&view)
