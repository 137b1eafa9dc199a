from libc.stdint cimport int64_t, uint8_t, uint32_t

cdef extern from "link.h" nogil:
    const char *CAT_LINK_CAPSULE
    const uint32_t CAT_LINK_VERSION
    const uint32_t CAT_LINK_VIRTUAL_TIME
    const uint32_t CAT_LINK_SHARED_TIME
    const uint32_t CAT_LINK_SPENDS
    const uint32_t CAT_LINK_POLLS
    const uint32_t CAT_LINK_FORETELLS
    enum:
        CAT_FRAME_MAX
        CAT_FRAME_MIN
    ctypedef struct cat_link:
        uint32_t version
        uint32_t flags
        void *self
        int (*send)(void *self, const uint8_t *frame, uint32_t length) noexcept nogil
        int (*receive)(void *self, const uint8_t **frame) noexcept nogil
        int64_t (*now)(void *self) noexcept nogil
        int (*wait_until)(void *self, int64_t deadline, int wake_on_frame) noexcept nogil
        int64_t (*due)(void *self) noexcept nogil
        int fd
    void cat_link_replace_calls(
        cat_link *link,
        int (*send)(void *, const uint8_t *, uint32_t) noexcept nogil,
        int (*receive)(void *, const uint8_t **) noexcept nogil,
        int64_t (*now)(void *) noexcept nogil,
        int (*wait_until)(void *, int64_t, int) noexcept nogil)


cdef class TableLink:
    cdef object __weakref__
    cdef cat_link table
    cdef readonly str name
    cdef int close_table(self) except -1
    cdef void disconnect(self)
    cdef failed(self, str verb, int number)


cdef cat_link *table_of(object capsule) except NULL


cdef class WrapperLink(TableLink):
    cdef cat_link *inner
    cdef readonly object link
    cdef object inner_capsule
    cdef int wrap(self, object link) except -1
