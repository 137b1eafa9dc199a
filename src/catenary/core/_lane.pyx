# cython: boundscheck=False, wraparound=False, cdivision=True
"""The acyclic queue: frames of procedures, sent after the cyclic frames.

Theory of operation
    One service thread pushes whole frames into `out` and pops returned ones from `back`; both are
    rings for one producer and one consumer (native/packet_ring.h). After each cycle `lane_send` sends
    at most four frames and a quarter of the period's wire time. Frames with an index from 0x80 on
    return through `lane_received`. The cycle never waits for the service thread.

Waking
    The service thread sets `waiting`, then sleeps while `arrived` is unchanged. The cycle increments
    `arrived`, then wakes it if `waiting` is set. A full fence lies between the two steps of the cycle;
    the futex compares `arrived` again in the kernel, so that no wake-up is lost.

Budget: 0.05 us if nothing is queued, else what the link's send takes, at most four times.
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


cdef void lane_send(lane_t *lane, const cat_link *link) noexcept nogil:
    """Send at most four frames and a quarter of the period's wire time (one frame in any case)."""
    cdef const cat_packet *packet
    cdef uint32_t count, bytes = 0
    lane.under_way = 0
    for count in range(FRAMES_PER_CYCLE):
        packet = cat_ring_peek(lane.out)
        if packet == NULL or (count > 0 and bytes + packet.length > lane.bytes_per_cycle):
            return
        bytes += packet.length
        if link.send(link.self, packet.bytes, packet.length) < 0:
            lane.dropped += 1
        else:
            lane.sent += 1
            lane.under_way += 1
        cat_ring_drop(lane.out)


cdef void lane_received(lane_t *lane, const uint8_t *bytes, uint32_t length,
                        int64_t stamp) noexcept nogil:
    if lane.under_way > 0:
        lane.under_way -= 1
    if cat_ring_push(lane.back, bytes, length, stamp) != 0:
        lane.dropped += 1
        return
    lane.received += 1
    cat_add32(&lane.arrived, 1)
    cat_fence()
    if cat_load_acquire32(&lane.waiting):
        cat_futex_wake(&lane.arrived)


cdef class Lane:
    def __cinit__(self, int64_t period_ns):
        cdef size_t size = sizeof(cat_packet_ring)
        self.c.out = <cat_packet_ring *>memory_take(&self.memory, 1, size)
        self.c.back = <cat_packet_ring *>memory_take(&self.memory, 1, size)
        self.c.bytes_per_cycle = <uint32_t>min(period_ns // (4 * NS_PER_BYTE), 1 << 20)

    def push(self, bytes frame not None):
        if not CAT_FRAME_MIN <= len(frame) <= CAT_FRAME_MAX:
            raise ValueError(
                f"lane: a frame of {len(frame)} bytes, must be {CAT_FRAME_MIN} to {CAT_FRAME_MAX}"
            )
        if frame[12:14] != b"\x88\xa4":
            raise ValueError("lane: EtherType is not 0x88A4")
        if frame[FIRST_INDEX] < LANE_INDICES:
            raise ValueError(f"lane: index {frame[FIRST_INDEX]:#04x} belongs to the cycle")
        return cat_ring_push(self.c.out, frame, <uint32_t>len(frame), 0) == 0

    def pop(self):
        cdef const cat_packet *packet = cat_ring_peek(self.c.back)
        if packet == NULL:
            return None
        frame = packet.bytes[: packet.length]
        cat_ring_drop(self.c.back)
        return frame

    def wait(self, int64_t timeout_ns):
        """Wait once. A signal or a spurious wake-up ends it early."""
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
