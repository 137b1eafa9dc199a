"""Links of a segment, which connect a MainDevice in the same process to it."""

from cpython.bytes cimport PyBytes_FromStringAndSize
from cpython.pycapsule cimport PyCapsule_New
from libc.errno cimport EINTR
from libc.stdint cimport int64_t, uint8_t, uint32_t

from catenary.virtual._segment cimport (
    Core,
    line_due,
    line_now,
    line_receive,
    line_send,
    line_spend,
    line_wait_until,
    segment_end,
)

cdef extern from "link.h":
    const char *CAT_LINK_CAPSULE
    uint32_t CAT_LINK_VERSION, CAT_LINK_VIRTUAL_TIME, CAT_LINK_SHARED_TIME, CAT_LINK_SPENDS
    uint32_t CAT_LINK_FORETELLS
    ctypedef struct cat_link:
        uint32_t version, flags
        void *self
        int (*send)(void *, const uint8_t *, uint32_t) noexcept nogil
        int (*receive)(void *, const uint8_t **) noexcept nogil
        int64_t (*now)(void *) noexcept nogil
        int (*wait_until)(void *, int64_t, int) noexcept nogil
        int (*spend)(void *, int64_t) noexcept nogil
        int64_t (*due)(void *) noexcept nogil


cdef class SegmentLink:
    """Link to one end of a segment. Keep it alive while its capsule is in use."""

    cdef cat_link _table
    cdef Core _core
    cdef segment_end *_end
    cdef object _ended
    cdef readonly object capsule
    cdef readonly str name
    cdef bint _open

    def __init__(self, Core core, str name, ended, *, bint second=False):
        if second and not core._segment.ring:
            raise ValueError("only a ring has a second link; use Segment(..., ring=True)")
        self._core = core
        self._end = &core._segment.ends[1 if second else 0]
        self._ended = ended
        self._open = True
        self.name = name
        self._table.version = CAT_LINK_VERSION
        self._table.flags = CAT_LINK_FORETELLS   # also in real time: arrival times are computed
        self._table.due = line_due
        if core._segment.is_virtual:
            self._table.flags |= CAT_LINK_VIRTUAL_TIME
        if core._segment.clock != NULL:
            self._table.flags |= CAT_LINK_SHARED_TIME | CAT_LINK_SPENDS
            self._table.spend = line_spend
        self._table.self = <void *>self._end
        self._table.send = line_send
        self._table.receive = line_receive
        self._table.now = line_now
        self._table.wait_until = line_wait_until
        self.capsule = PyCapsule_New(&self._table, CAT_LINK_CAPSULE, NULL)

    def _check(self, int result):
        if result < 0:
            self._core.raise_failure()
            raise OSError(-result, "the virtual segment refused the frame or the wait")
        return result

    def send(self, bytes frame not None):
        cdef const uint8_t *data = <const uint8_t *><const char *>frame
        cdef uint32_t size = len(frame)
        cdef int result
        with nogil:
            result = line_send(self._end, data, size)
        self._check(result)

    def receive(self):
        cdef const uint8_t *data = NULL
        cdef int size = line_receive(self._end, &data)
        return PyBytes_FromStringAndSize(<const char *>data, size) if self._check(size) else None

    def now(self):
        return line_now(self._end)

    def wait_until(self, int64_t deadline_ns, bint wake_on_frame):
        cdef int result
        with nogil:
            result = line_wait_until(self._end, deadline_ns, wake_on_frame)
        if result == -EINTR:
            return False                   # interrupted by a signal, which Python handles after the return
        return bool(self._check(result))

    def close(self):
        if self._open:
            self._open = False
            self._end.head = self._end.tail
            self._ended()

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self.close()
