from libc.stdint cimport int32_t, int64_t, uint8_t, uint16_t, uint32_t, uint64_t

from catenary.core._clocks cimport clock_t
from catenary.core._native cimport cat_image, cat_link
from catenary.core._lane cimport lane_t

cdef enum:
    FRAME_COUNT_MAX = 32   # so that an index comes again after four cycles at the earliest
    INDEX_COUNT = 128      # 0x00 to 0x7F are the cycle's, the rest the lane's

cdef enum:
    LOOK = 0
    WAIT = 1
    SPIN = 2

cdef struct copy_t:
    uint32_t frame_offset
    uint32_t image_offset
    uint32_t size

cdef struct datagram_t:
    uint8_t kind
    uint8_t command
    uint64_t header_mask       # of its first eight bytes: what a return has as it was sent
    uint16_t length            # of the data
    uint16_t expected_counter
    uint16_t counter           # of the last return
    int32_t unit               # -1: none
    uint32_t frame
    uint32_t offset            # of the header, in the frame
    uint32_t first_output
    uint32_t output_count
    uint32_t first_input
    uint32_t input_count

cdef struct frame_t:
    uint32_t length
    uint32_t used              # up to the end of the last datagram; padding follows
    uint32_t first_datagram
    uint32_t datagram_count
    uint32_t every             # goes out in cycles whose serial is `phase` modulo `every`
    uint32_t phase
    uint8_t due                # in this cycle
    uint8_t index
    uint8_t needed             # its loss makes the cycle bad
    uint8_t back
    uint8_t noted              # its counters, AL states and clocks were taken
    uint8_t template[1536]
    uint8_t returned[1536]

cdef struct frame_counters_t:
    uint64_t stale             # ours, of an earlier cycle
    uint64_t alien             # another protocol, source or index
    uint64_t corrupt           # an EtherCAT frame that contradicts itself or its template
    uint64_t duplicate         # ours, a second time in this cycle
    uint64_t unprocessed       # an echo no device has touched
    uint64_t send_errors
    uint64_t receive_errors

cdef struct frames_t:
    cat_image image
    const cat_link *link
    lane_t *lane
    clock_t *clock             # NULL: no distributed clocks
    int receive_mode
    uint32_t frame_count
    uint32_t datagram_count
    frame_t *frames
    datagram_t *datagrams
    copy_t *copies
    uint8_t *outputs
    uint8_t *inputs
    uint8_t *unit_valid
    uint8_t *unit_fresh
    uint8_t *unit_optional
    uint32_t *unit_missed
    uint32_t *unit_frame       # one of those that carry it: all are due together
    uint16_t *unit_counter
    uint16_t *unit_expected    # the sum of its datagrams' counters
    uint8_t al_status
    uint16_t al_counter
    uint8_t al_seen            # since the last emit, and
    uint16_t al_answered
    int64_t frame_stamp
    uint32_t next_index
    uint32_t serial            # of the emit
    uint32_t missing
    uint8_t all_due            # every frame goes out in every cycle
    uint8_t settled            # the units say already that the last cycle was whole and right
    uint8_t wrong              # a counter that is back, since the last emit
    uint8_t judged             # once since the last emit, and
    uint8_t collected          # with all frames back: nothing more can come
    uint8_t ok                 # every needed unit that was due valid, every needed frame back
    uint8_t whole              # every needed unit valid
    uint8_t frame_of_index[128]
    uint32_t serial_of_index[128]   # 0: never sent
    frame_counters_t counters

cdef class Frames:
    """Owns the templates, images and tables of one cyclic exchange."""
    cdef frames_t c
    cdef object link_owner
    cdef make_table(self)
    cdef carry_time(self, clock_t *clock)

cdef void frames_flush(frames_t *f) noexcept nogil
