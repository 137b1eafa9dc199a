from libc.stdint cimport int64_t, uint8_t, uint32_t, uint64_t

from catenary.core._memory cimport cat_memory
from catenary.core._native cimport cat_link, cat_packet_ring

cdef struct acyclic_queue_t:
    cat_packet_ring *out       # frames of the service thread, to be sent
    cat_packet_ring *back      # frames that have returned
    int64_t wire_time          # maximum wire time of acyclic frames per cycle [ns]
    uint32_t arrived           # futex word: number of arrivals
    uint32_t waiting           # 1: the service thread sleeps on `arrived` or is about to
    uint32_t under_way         # frames of the last cycle that have not returned; used by the cycle
    uint64_t sent              # number of frames; only the cycle changes this and the next two
    uint64_t received
    uint64_t dropped           # frames that returned to a full ring or could not be sent

cdef class AcyclicQueue:
    """Owner of the two rings of the acyclic queue."""
    cdef acyclic_queue_t c
    cdef cat_memory memory

cdef void acyclic_send(acyclic_queue_t *queue, const cat_link *link, int64_t passed) noexcept nogil
cdef void acyclic_received(acyclic_queue_t *queue, const uint8_t *bytes, uint32_t length,
                           int64_t stamp) noexcept nogil
