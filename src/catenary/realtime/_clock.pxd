from libc.stdint cimport int64_t, uint8_t, uint32_t

cdef extern from "clock.h":
    const char *CAT_CLOCK_CAPSULE
    uint32_t CAT_CLOCK_VERSION, CAT_CLOCK_VIRTUAL
    int64_t CAT_CLOCK_FOREVER
    ctypedef struct cat_clock:
        uint32_t version
        uint32_t flags
        void *self
        int64_t (*now)(void *) noexcept nogil
        int (*wait_until)(void *, int64_t) noexcept nogil
        int (*spend)(void *, int64_t) noexcept nogil
        void (*wake)(void *) noexcept nogil

cdef class Memory:
    """View of a writable buffer that another object owns, at a fixed address."""
    cdef Py_buffer view
    cdef uint8_t *at(self, size_t offset, size_t size) except NULL

cdef class Timer:
    """Timer of one thread. Other threads may only call `wake`."""
    cdef cat_clock table
    cdef Memory memory
    cdef readonly object capsule
    cdef int spend_some(self, int64_t duration) except -1
    cdef fill(self, void *owner, uint32_t flags)
