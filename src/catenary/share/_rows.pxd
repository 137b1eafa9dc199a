from libc.stdint cimport int64_t, uint8_t, uint32_t, uint64_t

cdef extern from "atomics.h" nogil:
    void cat_copy_to_shared(void *to, const void *source, size_t size)
    void cat_clear_shared(void *to, size_t size)


cdef extern from "ring.h" nogil:
    ctypedef struct share_ring:
        uint64_t newest
        uint32_t tick
        uint32_t ended

    ctypedef struct ring_view:
        share_ring *ring
        uint64_t count
        uint64_t stride
        uint64_t size

    uint64_t ring_stride(uint64_t size)
    uint64_t ring_newest(const ring_view *v)
    int ring_is_ended(const ring_view *v)
    uint8_t *ring_begin(const ring_view *v, uint64_t number)
    void ring_publish(const ring_view *v, uint64_t number)
    void ring_end(const ring_view *v)
    int ring_copy(const ring_view *v, uint64_t number, uint8_t *bytes)
    uint64_t ring_copy_newest(const ring_view *v, uint8_t *bytes)
    uint64_t ring_copy_rows(const ring_view *v, uint64_t first, uint64_t rows, uint8_t *bytes,
                            uint64_t *end)
    int ring_wait(const ring_view *v, uint64_t seen, int64_t deadline)

cdef extern from "sink.h" nogil:
    ctypedef struct cat_motion:
        pass

    ctypedef struct cat_motion_slot:
        pass

    const char *CAT_SINK_CAPSULE
    const uint32_t CAT_SINK_VERSION

    ctypedef struct cat_sink:
        uint32_t version
        uint32_t record_size
        uint32_t actual_size
        uint32_t target_size
        void *self
        void (*put)(void *self, uint64_t number, const void *record, const void *actual,
                    const void *target) noexcept nogil
        cat_motion *motion
        uint32_t motion_axes
        uint32_t jog

cdef class Ring:
    """A ring of `count` rows (a power of two) of `size` bytes, at byte `offset` of a buffer.

    Raises ValueError if the ring does not fit in the buffer, or if a value is invalid.
    """
    cdef Py_buffer buffer
    cdef ring_view view

cdef struct cycle_rows:
    ring_view view
    uint64_t record_size
    uint64_t actual_size
    uint64_t target_size
    uint64_t actual_at         # offset in the row
    uint64_t target_at

cdef class CycleWriter(Ring):
    """A ring whose rows are the cycles of an engine.

    `sizes` contains the sizes of the record, the actual values and the targets [bytes].
    """
    cdef cat_sink sink
    cdef Py_buffer motion      # memory of the motion words; its `buf` is NULL without them
    cdef connect_motion(self, memory, uint64_t offset, uint32_t axes, bint jog)
    cdef cycle_rows rows
