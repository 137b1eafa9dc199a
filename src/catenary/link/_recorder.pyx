"""Recorder for a link: writes every frame, in both directions, to a pcapng file.

The cycle copies each frame as a complete pcapng block into a ring (about 0.1 us). A separate thread
writes the ring to the file. It never delays the cycle: if the ring is full, frames are dropped and
counted. In virtual time, the caller's thread writes the file whenever the ring is half full. Frames
are then dropped only after a write error.
"""

from libc.errno cimport EINTR, errno
from libc.stdint cimport int64_t, uint8_t, uint16_t, uint32_t, uint64_t
from libc.string cimport memcpy
from posix.time cimport nanosleep, timespec
from posix.types cimport pid_t
from posix.unistd cimport getpid, write

from catenary.link._table cimport CAT_LINK_VIRTUAL_TIME, WrapperLink, cat_link

import os
import time
import warnings

from catenary.wire.pcapng import encode_header, encode_statistics

cdef extern from "atomics.h" nogil:
    uint32_t cat_load_acquire32(const uint32_t *p)
    uint64_t cat_load_acquire64(const uint64_t *p)
    uint64_t cat_load_relaxed64(const uint64_t *p)
    void cat_store_release32(uint32_t *p, uint32_t v)
    void cat_store_release64(uint64_t *p, uint64_t v)

cdef extern from "locked_memory.h" nogil:
    ctypedef struct cat_memory:
        pass
    void *cat_memory_take(cat_memory *memory, size_t count, size_t size)
    void cat_memory_touch(cat_memory *memory)
    void cat_memory_free(cat_memory *memory)

cdef extern from "<pthread.h>" nogil:
    ctypedef unsigned long pthread_t
    ctypedef struct pthread_attr_t:
        pass
    enum:
        PTHREAD_EXPLICIT_SCHED
    int pthread_attr_init(pthread_attr_t *attributes)
    int pthread_attr_setinheritsched(pthread_attr_t *attributes, int inherit)
    int pthread_attr_destroy(pthread_attr_t *attributes)
    int pthread_create(
        pthread_t *thread, const pthread_attr_t *attributes,
        void *(*start)(void *) noexcept nogil, void *argument)
    int pthread_join(pthread_t thread, void **result)

cdef enum:
    RING_BYTES = 4 * 1024 * 1024      # a power of two: 10 s of three drives at 1 kHz
    WRITE_EVERY_NS = 10_000_000
    INBOUND = 1                       # epb_flags, pcapng §4.3
    OUTBOUND = 2

ctypedef struct packet_head:          # Enhanced Packet Block, pcapng §4.3
    uint32_t type
    uint32_t total_length
    uint32_t interface
    uint32_t stamp_high
    uint32_t stamp_low
    uint32_t captured_length
    uint32_t original_length

ctypedef struct packet_tail:
    uint16_t flags_code
    uint16_t flags_length
    uint32_t flags
    uint32_t end_of_options
    uint32_t total_length

ctypedef struct recorder_state:
    cat_link *inner
    uint8_t *ring
    uint64_t head                     # total bytes put in; written by the cycle
    uint64_t tail                     # total bytes written to the file; written by the writer
    uint64_t recorded                 # frames
    uint64_t dropped                  # frames
    int64_t stamp_offset              # clock of the file minus the link's clock [ns]
    uint32_t stop
    uint32_t write_error              # errno; after an error, all frames are dropped
    int fd
    bint inline_writer


cdef void put(
    recorder_state *recorder, uint64_t position, const void *data, size_t size
) noexcept nogil:
    cdef size_t at = <size_t> (position & (RING_BYTES - 1))
    cdef size_t first = min(size, <size_t> RING_BYTES - at)
    memcpy(recorder.ring + at, data, first)
    memcpy(recorder.ring, <const uint8_t *> data + first, size - first)


cdef void record(
    recorder_state *recorder, const uint8_t *frame, uint32_t length, uint32_t direction
) noexcept nogil:
    cdef int64_t now = recorder.inner.now(recorder.inner.self)
    cdef uint64_t stamp = <uint64_t> (now + recorder.stamp_offset)
    cdef uint32_t padded = (length + 3) & ~<uint32_t> 3
    cdef uint32_t total = <uint32_t> sizeof(packet_head) + padded + <uint32_t> sizeof(packet_tail)
    cdef uint64_t head = recorder.head
    cdef uint64_t used = head - cat_load_acquire64(&recorder.tail)
    cdef packet_head before
    cdef packet_tail after
    if used + total > RING_BYTES or cat_load_acquire32(&recorder.write_error) != 0:
        cat_store_release64(&recorder.dropped, recorder.dropped + 1)
        return
    before.type = 6
    before.total_length = total
    before.interface = 0
    before.stamp_high = <uint32_t> (stamp >> 32)
    before.stamp_low = <uint32_t> stamp
    before.captured_length = length
    before.original_length = length
    after.flags_code = 2
    after.flags_length = 4
    after.flags = direction
    after.end_of_options = 0
    after.total_length = total
    put(recorder, head, &before, sizeof(before))
    put(recorder, head + sizeof(before), frame, length)
    put(recorder, head + sizeof(before) + length, &after.end_of_options, padded - length)  # zeros
    put(recorder, head + sizeof(before) + padded, &after, sizeof(after))
    cat_store_release64(&recorder.head, head + total)
    cat_store_release64(&recorder.recorded, recorder.recorded + 1)
    if recorder.inline_writer and used + total > RING_BYTES // 2:
        drain(recorder)


cdef void drain(recorder_state *recorder) noexcept nogil:
    """Write the content of the ring to the file; stop at the first error."""
    cdef uint64_t head = cat_load_acquire64(&recorder.head)
    cdef size_t at, size
    cdef ssize_t written
    while recorder.tail != head and recorder.write_error == 0:
        at = <size_t> (recorder.tail & (RING_BYTES - 1))
        size = min(<size_t> (head - recorder.tail), <size_t> RING_BYTES - at)
        written = write(recorder.fd, recorder.ring + at, size)
        if written >= 0:
            cat_store_release64(&recorder.tail, recorder.tail + <uint64_t> written)
        elif errno != EINTR:
            cat_store_release32(&recorder.write_error, <uint32_t> errno)


cdef void *run_writer(void *argument) noexcept nogil:
    cdef recorder_state *recorder = <recorder_state *> argument
    cdef timespec pause
    pause.tv_sec = 0
    pause.tv_nsec = WRITE_EVERY_NS
    while cat_load_acquire32(&recorder.stop) == 0:
        drain(recorder)
        nanosleep(&pause, NULL)
    return NULL


cdef int recorder_send(void *self, const uint8_t *frame, uint32_t length) noexcept nogil:
    cdef recorder_state *recorder = <recorder_state *> self
    cdef int status = recorder.inner.send(recorder.inner.self, frame, length)
    if status == 0:
        record(recorder, frame, length, OUTBOUND)
    return status


cdef int recorder_receive(void *self, const uint8_t **frame) noexcept nogil:
    cdef recorder_state *recorder = <recorder_state *> self
    cdef int length = recorder.inner.receive(recorder.inner.self, frame)
    if length > 0:
        record(recorder, frame[0], <uint32_t> length, INBOUND)
    return length


cdef int64_t recorder_now(void *self) noexcept nogil:
    cdef recorder_state *recorder = <recorder_state *> self
    return recorder.inner.now(recorder.inner.self)


cdef int recorder_wait_until(void *self, int64_t deadline, int wake_on_frame) noexcept nogil:
    cdef recorder_state *recorder = <recorder_state *> self
    return recorder.inner.wait_until(recorder.inner.self, deadline, wake_on_frame)


cdef class Recorder(WrapperLink):
    """Wrapper that records the frames of `link` in a pcapng file, with timestamps in ns.

    An existing file is overwritten. Timestamps are the time of day, or the virtual time of a link
    in virtual time. A sent frame gets its timestamp after the call that sends it. If the file is
    incomplete, `close` issues a warning.

    Raises:
        OSError: The file cannot be written, or the writer thread cannot be started.
    """
    cdef recorder_state recorder
    cdef cat_memory memory                # the ring
    cdef pthread_t writer
    cdef bint writing
    cdef pid_t owner                      # process that writes the file; a forked child does not
    cdef readonly str path

    def __init__(self, link, path):
        self.recorder.ring = <uint8_t *> cat_memory_take(&self.memory, 1, RING_BYTES)
        if self.recorder.ring == NULL:
            raise MemoryError(f"cannot allocate {RING_BYTES} bytes for the ring of the recorder")
        self.path = os.fspath(path)
        self.owner = getpid()
        self.recorder.fd = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
        try:
            self.wrap(link)
            os.write(self.recorder.fd, encode_header(self.name))
            self.start()
        except BaseException:
            os.close(self.recorder.fd)
            if self.link is not None:
                self.link.close()
            raise
        self.table.self = &self.recorder
        self.table.send = recorder_send
        self.table.receive = recorder_receive
        self.table.now = recorder_now
        self.table.wait_until = recorder_wait_until

    cdef int start(self) except -1:
        self.recorder.inner = self.inner
        self.recorder.inline_writer = (self.inner.flags & CAT_LINK_VIRTUAL_TIME) != 0
        if not self.recorder.inline_writer:
            cat_memory_touch(&self.memory)  # not locked: lockable memory is left to the cycle
            self.recorder.stamp_offset = time.time_ns() - self.inner.now(self.inner.self)
            self.start_writer()
        return 0

    cdef int start_writer(self) except -1:
        """Start the writer thread without real-time priority, even if the caller has one."""
        cdef pthread_attr_t attributes
        pthread_attr_init(&attributes)
        pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED)
        cdef int status = pthread_create(&self.writer, &attributes, run_writer, &self.recorder)
        pthread_attr_destroy(&attributes)
        if status != 0:
            raise OSError(status, f"cannot start the thread of the recorder: {os.strerror(status)}")
        self.writing = True
        return 0

    @property
    def recorded(self):
        """Number of frames recorded so far, including those not yet written to the file."""
        return cat_load_relaxed64(&self.recorder.recorded)

    @property
    def dropped(self):
        """Number of frames not recorded because the disk was too slow or a write has failed."""
        return cat_load_relaxed64(&self.recorder.dropped)

    cdef int stop_writer(self) except -1:
        if self.writing and self.owner == getpid():
            cat_store_release32(&self.recorder.stop, 1)
            with nogil:
                pthread_join(self.writer, NULL)
        self.writing = False
        return 0

    cdef int close_table(self) except -1:
        try:
            self.stop_writer()
            self.finish_file()
        finally:
            WrapperLink.close_table(self)
        return 0

    cdef int finish_file(self) except -1:
        if self.owner != getpid():
            os.close(self.recorder.fd)  # this is a copy; the parent keeps writing
            return 0
        with nogil:
            drain(&self.recorder)
        number = self.recorder.write_error
        if number == 0:
            stamp = self.inner.now(self.inner.self) + self.recorder.stamp_offset
            received = self.recorded + self.dropped
            end = encode_statistics(stamp, received=received, dropped=self.dropped)
            os.write(self.recorder.fd, end)
        os.close(self.recorder.fd)
        if number:
            self.warn(f"is incomplete: {os.strerror(number)}")
        elif self.dropped:
            self.warn(f"lacks {self.dropped} frames: the disk was too slow")
        return 0

    cdef warn(self, str what):
        warnings.warn(f"{self.path} {what}", RuntimeWarning, stacklevel=2)

    def __dealloc__(self):
        if self.writing and self.owner == getpid():
            cat_store_release32(&self.recorder.stop, 1)
            pthread_join(self.writer, NULL)
        cat_memory_free(&self.memory)
