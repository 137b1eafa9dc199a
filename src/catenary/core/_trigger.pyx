# cython: boundscheck=False, wraparound=False, cdivision=True
"""Cycles that another process starts, through the shared memory of native/trigger.h.

Theory of operation. A receiver is in one of two states.

    following   wait for the sender's next cycle, at most a quarter of a period after the expected
                start. The sender's cycle start becomes that of this cycle. After the deadline, the
                cycle begins without a trigger (`missed`), and the receiver seeks.
    seeking     the clock starts the cycles (`missed`). If the sender has begun a cycle since the
                last one, the next cycle start moves towards the sender's grid, by at most 1/64 of a
                period. Within this distance the receiver follows.

Periods change by at most 1/64 while seeking, so devices receive frames regularly after a sender has
restarted with another grid. Values of the shared memory are used only if the period is the same and
the cycle start is in the past, but by less than two periods.

Budget: 0.1 us, without the wait.
"""

from cpython.buffer cimport PyBUF_WRITABLE, PyBuffer_Release, PyObject_GetBuffer
from libc.stdint cimport int64_t, uint64_t, uintptr_t

from catenary.core._native cimport (
    CAT_TRIGGER_SIZE,
    cat_link,
    cat_load_acquire32,
    cat_load_relaxed64,
    cat_trigger,
    cat_trigger_wait,
)

TRIGGER_SIZE = CAT_TRIGGER_SIZE

cdef enum:
    MARGIN_SHARE = 4           # a trigger is late after this part of a period
    SEEK_SHARE = 64            # largest change of a period while seeking


cdef bint is_usable(const cat_trigger *shared, int64_t scheduled, int64_t period,
                    int64_t present) noexcept nogil:
    """Return True if a cycle start of the sender is plausible."""
    if cat_load_relaxed64(&shared.period) != <uint64_t>period:
        return False
    return present - 2 * period < scheduled <= present


cdef int64_t trigger_seek(trigger_t *t, int64_t next, int64_t period, int64_t present) noexcept nogil:
    """Return the change of the next cycle start [ns] that moves it towards the sender's grid."""
    cdef int64_t scheduled, off
    if cat_load_acquire32(&t.awaits.tick) == t.seen:
        return 0
    t.seen = cat_load_acquire32(&t.awaits.tick)
    scheduled = <int64_t>cat_load_relaxed64(&t.awaits.scheduled)
    if not is_usable(t.awaits, scheduled, period, present):
        return 0
    off = (scheduled - next) % period
    if off > period // 2:
        off -= period
    elif off < -(period // 2):
        off += period
    if -(period // SEEK_SHARE) <= off <= period // SEEK_SHARE:
        t.following = True
        return off
    return period // SEEK_SHARE if off > 0 else -(period // SEEK_SHARE)


cdef int trigger_await(trigger_t *t, const cat_link *link, int64_t next, int64_t period,
                       int64_t busy_wait, int64_t *start) noexcept nogil:
    """Wait for the cycle of the sender that is expected at `next`.

    Return 1 with its cycle start in `start`, 0 after the deadline, or -EINTR.
    """
    cdef int64_t deadline = next + period // MARGIN_SHARE
    cdef int64_t awake = min(next + busy_wait, deadline) if busy_wait > 0 else 0
    cdef int rc
    while True:
        rc = cat_trigger_wait(t.awaits, t.seen, awake, deadline)
        if rc < 0:
            return rc
        if rc > 0:
            t.seen = cat_load_acquire32(&t.awaits.tick)
            start[0] = <int64_t>cat_load_relaxed64(&t.awaits.scheduled)
            if start[0] >= next - period // 2 and is_usable(t.awaits, start[0], period,
                                                            link.now(link.self)):
                return 1
        if link.now(link.self) >= deadline:
            t.following = False
            return 0


cdef class TriggerBlock:
    def __cinit__(self, memory):
        PyObject_GetBuffer(memory, &self.buffer, PyBUF_WRITABLE)
        if self.buffer.len < <Py_ssize_t>CAT_TRIGGER_SIZE or <uintptr_t>self.buffer.buf % 64:
            raise ValueError(f"a trigger needs {CAT_TRIGGER_SIZE} bytes at a multiple of 64 bytes")
        self.c = <cat_trigger *>self.buffer.buf

    @property
    def ticks(self):
        return cat_load_acquire32(&self.c.tick)

    @property
    def scheduled_ns(self):
        return <int64_t>cat_load_relaxed64(&self.c.scheduled)

    @property
    def period_ns(self):
        return <int64_t>cat_load_relaxed64(&self.c.period)

    def __dealloc__(self):
        PyBuffer_Release(&self.buffer)
