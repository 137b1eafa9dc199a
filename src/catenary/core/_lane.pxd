from libc.stdint cimport int64_t, uint8_t, uint32_t, uint64_t

from catenary.core._native cimport cat_link, cat_packet_ring

cdef struct lane_t:
    cat_packet_ring *out       # the service thread's frames, to be sent
    cat_packet_ring *back      # those that came back
    uint32_t bytes_per_cycle
    uint32_t arrived           # futex word: counts arrivals
    uint32_t under_way         # sent in the last cycle and not back yet
    uint32_t waiting           # the service thread sleeps on it
    uint64_t sent
    uint64_t received
    uint64_t dropped           # came back to a full ring, or could not be sent

cdef class Lane:
    """Owns the two rings of the acyclic lane."""
    cdef lane_t c

cdef void lane_send(lane_t *lane, const cat_link *link) noexcept nogil
cdef void lane_received(lane_t *lane, const uint8_t *bytes, uint32_t length,
                        int64_t stamp) noexcept nogil
