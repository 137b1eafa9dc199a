from libc.stdint cimport int64_t, uint8_t, uint32_t, uint64_t

from catenary.core._memory cimport cat_memory
from catenary.core._native cimport cat_link, cat_packet_ring

cdef struct lane_t:
    cat_packet_ring *out       # frames of the service thread, to be sent
    cat_packet_ring *back      # frames that came back
    int64_t wire_time          # of the frames of one cycle, at most [ns]
    uint32_t arrived           # futex word: counts arrivals
    uint32_t waiting           # 1: the service thread sleeps, or is about to sleep, on `arrived`
    uint32_t under_way         # the cycle's: sent in the last cycle and not back yet
    uint64_t sent              # the cycle's, as the next two
    uint64_t received
    uint64_t dropped           # came back to a full ring, or could not be sent

cdef class Lane:
    """Owner of the two rings of the acyclic queue."""
    cdef lane_t c
    cdef cat_memory memory

cdef void lane_send(lane_t *lane, const cat_link *link, int64_t passed) noexcept nogil
cdef void lane_received(lane_t *lane, const uint8_t *bytes, uint32_t length,
                        int64_t stamp) noexcept nogil
