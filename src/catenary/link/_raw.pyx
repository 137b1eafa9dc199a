"""Raw link: AF_PACKET frames of one NIC, received through a ring in memory shared with the kernel.

`interface.py` opens, checks and binds the socket. This file contains only the calls of a cycle. A
send takes one system call, a receive from the ring none. With 50 queued frames on a veth, a receive
takes 0.07 us per frame including the call from Python. Without the ring, `recv` takes 0.7 us.

Closing: a native thread may be inside a call, or read a frame in the ring. `close` therefore replaces
the ring by zero pages and the descriptor by a socket without a peer. Address and descriptor number
stay the same, so such a thread finds no frame and causes no fault. The kernel releases the interface
at once; pages and descriptor are released with the object.
"""

import os
import socket as sockets

from libc.errno cimport EAGAIN, EINTR, EINVAL, EMSGSIZE, ENETDOWN, errno
from libc.stdint cimport int64_t, uint8_t, uint16_t, uint32_t
from libc.string cimport memcpy, memset
from posix.time cimport CLOCK_MONOTONIC, clock_gettime, timespec
from posix.unistd cimport close

from catenary.link._table cimport (
    CAT_FRAME_MAX, CAT_FRAME_MIN, CAT_LINK_POLLS, TableLink,
)

cdef extern from "<sys/mman.h>" nogil:
    enum:
        PROT_READ
        PROT_WRITE
        MAP_SHARED
        MAP_PRIVATE
        MAP_ANONYMOUS
        MAP_FIXED
        MAP_NORESERVE
    void *MAP_FAILED
    void *mmap(void *address, size_t length, int protection, int flags, int fd, ssize_t offset)
    int munmap(void *address, size_t length)

cdef extern from "atomics.h" nogil:
    uint32_t cat_load_acquire32(const uint32_t *p)
    void cat_store_release32(uint32_t *p, uint32_t v)

cdef extern from "<linux/if_packet.h>" nogil:
    enum:
        TP_STATUS_KERNEL
        TP_STATUS_USER
    struct tpacket2_hdr:
        uint32_t tp_status
        uint32_t tp_snaplen
        uint16_t tp_mac

cdef extern from "<sys/socket.h>" nogil:
    enum:
        MSG_DONTWAIT
        MSG_TRUNC
        SOL_SOCKET
        SO_ERROR
    ssize_t c_send "send"(int fd, const void *buffer, size_t length, int flags)
    ssize_t c_recv "recv"(int fd, void *buffer, size_t length, int flags)
    int getsockopt(int fd, int level, int option, void *value, unsigned int *length)

cdef extern from "<poll.h>" nogil:
    enum:
        POLLIN
    struct pollfd:
        int fd
        short events
        short revents
    int ppoll(pollfd *fds, unsigned long count, const timespec *timeout, const void *mask)

cdef extern from "<time.h>" nogil:
    enum:
        TIMER_ABSTIME
    int clock_nanosleep(int clock, int flags, const timespec *request, timespec *remain)

cdef enum:
    SECOND = 1_000_000_000
    ODD_FRAMES = 16                   # most frames of a wrong length that one call skips

ctypedef struct raw_state:
    int fd
    uint8_t *ring                     # NULL: no ring, recv() into `buffer`
    uint32_t slot_size
    uint32_t slot_count
    uint32_t cursor                   # the slot to read next, < slot_count
    tpacket2_hdr *held                # slot lent to the receiver; the next call releases it first
    uint8_t buffer[2048]


cdef inline void release(raw_state *raw) noexcept nogil:
    if raw.held != NULL:
        cat_store_release32(&raw.held.tp_status, TP_STATUS_KERNEL)
        raw.held = NULL


cdef inline tpacket2_hdr *slot_at_cursor(raw_state *raw) noexcept nogil:
    return <tpacket2_hdr *> (raw.ring + <size_t> raw.cursor * raw.slot_size)


cdef inline bint frame_in_ring(raw_state *raw) noexcept nogil:
    return (cat_load_acquire32(&slot_at_cursor(raw).tp_status) & TP_STATUS_USER) != 0


cdef int raw_send(void *self, const uint8_t *frame, uint32_t length) noexcept nogil:
    cdef raw_state *raw = <raw_state *> self
    cdef uint8_t padded[CAT_FRAME_MIN]
    if length > CAT_FRAME_MAX:
        return -EMSGSIZE
    if length < 14:
        return -EINVAL
    if length < CAT_FRAME_MIN:
        memcpy(padded, frame, length)
        memset(padded + length, 0, CAT_FRAME_MIN - length)
        frame = padded
        length = CAT_FRAME_MIN
    if c_send(raw.fd, frame, length, MSG_DONTWAIT) < 0:
        return -errno
    return 0


cdef int receive_from_ring(void *self, const uint8_t **frame) noexcept nogil:
    cdef raw_state *raw = <raw_state *> self
    cdef tpacket2_hdr *slot
    cdef uint32_t end
    release(raw)
    while frame_in_ring(raw):
        slot = slot_at_cursor(raw)
        raw.cursor = raw.cursor + 1 if raw.cursor + 1 < raw.slot_count else 0
        raw.held = slot
        end = slot.tp_mac + slot.tp_snaplen
        if slot.tp_snaplen >= 14 and end <= raw.slot_size:
            frame[0] = <uint8_t *> slot + slot.tp_mac
            return <int> slot.tp_snaplen
        release(raw)
    return 0


cdef int receive_by_recv(void *self, const uint8_t **frame) noexcept nogil:
    cdef raw_state *raw = <raw_state *> self
    cdef ssize_t length
    cdef int k
    for k in range(ODD_FRAMES):
        length = c_recv(raw.fd, raw.buffer, sizeof(raw.buffer), MSG_DONTWAIT | MSG_TRUNC)
        if length < 0:
            return 0 if errno == EAGAIN else -errno
        if 14 <= length <= <ssize_t> sizeof(raw.buffer):
            frame[0] = raw.buffer
            return <int> length
    return 0


cdef int64_t raw_now(void *self) noexcept nogil:
    cdef timespec time
    clock_gettime(CLOCK_MONOTONIC, &time)
    return <int64_t> time.tv_sec * SECOND + time.tv_nsec


cdef int raw_wait_until(void *self, int64_t deadline, int wake_on_frame) noexcept nogil:
    cdef raw_state *raw = <raw_state *> self
    release(raw)                      # a slot we hold would make poll() return at once
    return wait_for_frame(raw, deadline) if wake_on_frame else wait_for_time(deadline)


cdef int wait_for_time(int64_t deadline) noexcept nogil:
    cdef timespec until
    if deadline < 0:
        return 0
    until.tv_sec = deadline // SECOND
    until.tv_nsec = deadline % SECOND
    return -clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL)


cdef int wait_for_frame(raw_state *raw, int64_t deadline) noexcept nogil:
    cdef pollfd poll
    cdef timespec rest
    cdef int64_t left
    cdef int ready
    if raw.ring != NULL and frame_in_ring(raw):
        return 1
    left = max(deadline - raw_now(NULL), <int64_t> 0)
    rest.tv_sec = left // SECOND
    rest.tv_nsec = left % SECOND
    poll.fd = raw.fd
    poll.events = POLLIN
    poll.revents = 0
    ready = ppoll(&poll, 1, &rest, NULL)
    if ready < 0:
        return -errno
    if ready == 0:
        return 0
    return 1 if poll.revents & POLLIN else -pending_error(raw)


cdef int pending_error(raw_state *raw) noexcept nogil:
    """Return and clear the error of the socket (ENETDOWN if none), so that poll() waits again."""
    cdef int number = 0
    cdef unsigned int size = sizeof(int)
    getsockopt(raw.fd, SOL_SOCKET, SO_ERROR, &number, &size)
    return number if number > 0 else ENETDOWN


cdef class RawLink(TableLink):
    """Owner of an AF_PACKET socket and, unless `ring_size` is 0, of its mapped TPACKET_V2 ring.

    `receive_path` describes how frames are received: "mapped ring", or "recv (reason)". The
    constructor takes the descriptor from `socket`.

    Raises:
        ValueError: The ring cannot hold one slot.
        OSError: The ring cannot be mapped.
    """
    cdef raw_state raw
    cdef size_t ring_size
    cdef readonly str receive_path

    def __cinit__(self):
        self.raw.fd = -1

    def __init__(self, str name not None, socket, size_t ring_size, int slot_size,
                 str receive_path not None):
        if ring_size and (slot_size < 2048 or ring_size < <size_t> slot_size):
            raise ValueError(f"a ring of {ring_size} bytes cannot hold a slot of {slot_size} bytes")
        self.name = name
        self.receive_path = receive_path
        if ring_size:
            self.map_ring(socket.fileno(), ring_size, slot_size)
        self.raw.fd = socket.detach()
        self.table.self = &self.raw
        self.table.flags = CAT_LINK_POLLS
        self.table.fd = self.raw.fd
        self.table.send = raw_send
        self.table.receive = receive_from_ring if ring_size else receive_by_recv
        self.table.now = raw_now
        self.table.wait_until = raw_wait_until

    def fileno(self):
        return self.raw.fd

    def forget(self):
        """Close the copies of ring and socket in a forked child; the parent's stay open."""
        self.close()

    def flush(self):
        """Discard the frames received so far; return their number."""
        cdef const uint8_t *frame = NULL
        cdef int count = 0
        while self.table.receive(self.table.self, &frame) > 0:
            count += 1
        return count

    def explain(self, int number):
        from catenary.link.interface import no_link  # avoids a circular import

        return no_link(self.name, number)

    cdef int map_ring(self, int fd, size_t size, int slot_size) except -1:
        cdef void *ring = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0)
        if ring == MAP_FAILED:
            raise OSError(errno, f"{self.name}: cannot map the receive ring: {os.strerror(errno)}")
        self.ring_size = size
        self.raw.ring = <uint8_t *> ring
        self.raw.slot_size = slot_size
        self.raw.slot_count = <uint32_t> (size // slot_size)
        return 0

    cdef int close_table(self) except -1:
        """Replace the ring by zero pages (TP_STATUS_KERNEL: no frame), and replace the socket."""
        if self.raw.ring != NULL and mmap(
            self.raw.ring, self.ring_size, PROT_READ | PROT_WRITE,
            MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED | MAP_NORESERVE, -1, 0,
        ) == MAP_FAILED:
            raise OSError(errno, f"{self.name}: cannot release the ring: {os.strerror(errno)}")
        with sockets.socket(sockets.AF_UNIX, sockets.SOCK_DGRAM) as silent:
            os.dup2(silent.fileno(), self.raw.fd, inheritable=False)
        return 0

    def __dealloc__(self):
        if self.raw.ring != NULL:
            munmap(self.raw.ring, self.ring_size)
        if self.raw.fd >= 0:
            close(self.raw.fd)
