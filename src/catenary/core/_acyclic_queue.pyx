# cython: boundscheck=False, wraparound=False, cdivision=True
"""The acyclic queue: frames of procedures, sent after the cyclic frames.

Theory of operation
    One service thread pushes whole frames into `out` and pops returned ones from `back`. Both are
    rings for one producer and one consumer (native/packet_ring.h). After each cycle `acyclic_send`
    sends at most four frames. Their wire time must fit into the part of the period that the plan
    reserves for them (plan/frames.py), less the time that has passed. The first frame is always
    sent, so that no procedure starves. Frames with an index of 0x80 or above return through
    `acyclic_received`. The cycle never waits for the service thread.

Waking
    The service thread sets `waiting`, then sleeps while `arrived` is unchanged. The cycle increments
    `arrived`, then wakes the thread if `waiting` is set. A full fence separates the two steps of the
    cycle. The futex compares `arrived` again in the kernel, so that no wake-up is lost.

Budget: 0.05 us if the queue is empty, otherwise at most four sends of the link.
"""

from libc.stdint cimport int64_t, uint8_t, uint32_t, uint64_t

from catenary.core._memory cimport cat_memory_free, memory_take
from catenary.core._native cimport (
    CAT_FRAME_MAX,
    CAT_FRAME_MIN,
    cat_add32,
    cat_fence,
    cat_futex_wait,
    cat_futex_wake,
    cat_load_acquire32,
    cat_packet,
    cat_packet_ring,
    cat_ring_drop,
    cat_ring_peek,
    cat_ring_push,
    cat_store_release32,
)

cdef enum:
    FRAMES_PER_CYCLE = 4
    FIRST_INDEX = 17           # offset of the first datagram's index in an Ethernet frame
    LANE_INDICES = 0x80
    NS_PER_BYTE = 80           # 100 Mbit/s
    FRAME_OVERHEAD = 24        # preamble, check sequence, gap


cdef inline int64_t wire_time(uint32_t length) noexcept nogil:
    """Return the time for which a frame occupies a cable of 100 Mbit/s [ns] (as wire/frame.py)."""
    return <int64_t>(max(length, CAT_FRAME_MIN) + FRAME_OVERHEAD) * NS_PER_BYTE


cdef void acyclic_send(acyclic_queue_t *queue, const cat_link *link, int64_t passed) noexcept nogil:
    """Send at most four frames that fit into the remaining wire time; always send the first one.

    `passed`: time since the cycle start [ns].
    """
    cdef const cat_packet *packet
    cdef int64_t left = queue.wire_time - passed
    cdef uint32_t count
    queue.under_way = 0
    for count in range(FRAMES_PER_CYCLE):
        packet = cat_ring_peek(queue.out)
        if packet == NULL:
            return
        left -= wire_time(packet.length)
        if count > 0 and left < 0:
            return
        if link.send(link.self, packet.bytes, packet.length) < 0:
            queue.dropped += 1
        else:
            queue.sent += 1
            queue.under_way += 1
        cat_ring_drop(queue.out)


cdef void acyclic_received(acyclic_queue_t *queue, const uint8_t *bytes, uint32_t length,
                           int64_t stamp) noexcept nogil:
    if queue.under_way > 0:
        queue.under_way -= 1
    if cat_ring_push(queue.back, bytes, length, stamp) != 0:
        queue.dropped += 1
        return
    queue.received += 1
    cat_add32(&queue.arrived, 1)
    cat_fence()
    if cat_load_acquire32(&queue.waiting):
        cat_futex_wake(&queue.arrived)


cdef class AcyclicQueue:
    def __cinit__(self, int64_t wire_time_ns):
        """`wire_time_ns`: maximum wire time of acyclic frames per cycle."""
        if wire_time_ns < 0:
            raise ValueError(f"acyclic_ns: {wire_time_ns} ns, must not be negative")
        cdef size_t size = sizeof(cat_packet_ring)
        self.c.out = <cat_packet_ring *>memory_take(&self.memory, 1, size)
        self.c.back = <cat_packet_ring *>memory_take(&self.memory, 1, size)
        self.c.wire_time = wire_time_ns

    def push(self, bytes frame not None):
        if not CAT_FRAME_MIN <= len(frame) <= CAT_FRAME_MAX:
            raise ValueError(
                f"acyclic queue: frame size {len(frame)} bytes, must be {CAT_FRAME_MIN} to"
                f" {CAT_FRAME_MAX}"
            )
        if frame[12:14] != b"\x88\xa4":
            raise ValueError("acyclic queue: EtherType is not 0x88A4")
        if frame[FIRST_INDEX] < LANE_INDICES:
            raise ValueError(f"acyclic queue: index {frame[FIRST_INDEX]:#04x} belongs to the cycle")
        return cat_ring_push(self.c.out, frame, <uint32_t>len(frame), 0) == 0

    def pop(self):
        cdef const cat_packet *packet = cat_ring_peek(self.c.back)
        if packet == NULL:
            return None
        frame = packet.bytes[: packet.length]
        cat_ring_drop(self.c.back)
        return frame

    def wait(self, int64_t timeout_ns):
        """Wait for a returned frame; return True if there is one.

        A signal or a spurious wake-up ends the wait early.
        """
        cdef uint32_t seen = cat_load_acquire32(&self.c.arrived)
        if cat_ring_peek(self.c.back) != NULL:
            return True
        if timeout_ns <= 0:
            return False
        cat_store_release32(&self.c.waiting, 1)
        with nogil:
            cat_futex_wait(&self.c.arrived, seen, timeout_ns)
        cat_store_release32(&self.c.waiting, 0)
        return cat_ring_peek(self.c.back) != NULL

    def __dealloc__(self):
        cat_memory_free(&self.memory)
