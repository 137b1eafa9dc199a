# cython: boundscheck=False, wraparound=False
"""64-bit words in shared memory that one process publishes and another reads without a lock.

Release stores pair with acquire loads: data written before a store is visible after a load of the
new value. Full fences ensure the converse: if a load still returns the old value, earlier reads did
not see data written after the store. x86 guarantees the first property in hardware. AArch64
guarantees neither.
Time budget: 0.1 us for a call from Python, 0.3 us for all words of a desk.
"""

from cpython.buffer cimport PyBUF_WRITABLE, PyBuffer_Release, PyObject_GetBuffer
from libc.stdint cimport uint8_t, uint64_t

cdef extern from "atomics.h" nogil:
    uint64_t cat_load_acquire64(const uint64_t *p)
    void cat_store_release64(uint64_t *p, uint64_t v)
    uint64_t cat_add64(uint64_t *p, uint64_t v)
    void cat_fence()

cdef enum:
    COUNT_MAX = 1 << 16


cdef class Words:
    cdef Py_buffer buffer
    cdef uint8_t *first
    cdef uint64_t stride
    cdef uint64_t count

    def __cinit__(self, memory, uint64_t offset, uint64_t count, uint64_t stride=8):
        PyObject_GetBuffer(memory, &self.buffer, PyBUF_WRITABLE)
        size = <uint64_t>self.buffer.len
        if not 1 <= count <= COUNT_MAX or offset % 8 or stride % 8 or not 8 <= stride <= size:
            raise ValueError(f"invalid count, offset or stride: {count} words at offset {offset},"
                             f" stride {stride} bytes")
        if offset > size or (count - 1) * stride + 8 > size - offset:
            raise ValueError(f"{count} words at offset {offset}, stride {stride} bytes, do not fit"
                             f" in {size} bytes")
        self.first = <uint8_t *>self.buffer.buf + offset
        self.stride = stride
        self.count = count

    cdef uint64_t *place(self, uint64_t k) except NULL:
        if k >= self.count:
            raise IndexError(f"word {k} is out of range: there are {self.count} words")
        return <uint64_t *>(self.first + k * self.stride)

    def load(self, uint64_t k):
        cdef uint64_t *word = self.place(k)
        cat_fence()
        return cat_load_acquire64(word)

    def load_all(self):
        cdef uint64_t k
        cat_fence()
        return [cat_load_acquire64(self.place(k)) for k in range(self.count)]

    def store(self, uint64_t k, uint64_t value):
        cat_store_release64(self.place(k), value)
        cat_fence()

    def add(self, uint64_t k, uint64_t value):
        return cat_add64(self.place(k), value)

    def __dealloc__(self):
        PyBuffer_Release(&self.buffer)
