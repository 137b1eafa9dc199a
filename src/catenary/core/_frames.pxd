from libc.stdint cimport int32_t, int64_t, uint8_t, uint16_t, uint32_t, uint64_t

from catenary.core._clocks cimport clock_t
from catenary.core._memory cimport cat_memory
from catenary.core._native cimport cat_image, cat_link
from catenary.core._acyclic_queue cimport acyclic_queue_t

cdef enum:
    FRAMES_MAX = 1024          # maximum number of frames in a plan, for all dividers and phases
    FRAMES_PER_CYCLE_MAX = 32  # without cycle numbers: no index is reused within four cycles
    INDEX_COUNT = 128          # 0x00 to 0x7F belong to the cycle, the others to the acyclic queue

cdef enum:                     # receive modes
    POLL = 0                   # sleep until the deadline, then take the frames that arrived
    WAIT = 1                   # sleep until a frame arrives
    BUSY = 2                   # busy-wait

cdef struct copy_t:            # bytes between a frame and an image
    uint32_t frame_offset
    uint32_t image_offset
    uint32_t size

cdef struct datagram_t:
    uint8_t kind
    uint8_t command
    uint8_t right              # evaluated: returned with the expected working counter
    uint64_t header_mask       # bits of the first eight bytes that return unchanged
    uint16_t length            # length of the data
    uint16_t expected_counter
    int32_t unit               # sync unit; -1: none
    uint32_t frame
    uint32_t offset            # offset of the header in the frame
    uint32_t first_output
    uint32_t output_count
    uint32_t first_input
    uint32_t input_count

cdef struct frame_t:
    uint32_t length
    uint32_t used              # end of the last datagram; padding follows
    uint32_t first_datagram
    uint32_t datagram_count
    uint32_t divider           # due in cycles with serial modulo divider equal to `phase`
    uint32_t phase
    uint32_t number_offset     # offset of the cycle number in the frame; 0: none
    uint8_t needed             # its loss makes the cycle not ok
    uint8_t index              # index in the last emit in which it was due
    uint8_t due                # sent in the last emit
    uint8_t back               # returned and accepted since the last emit
    uint8_t judged             # counters, AL status and clocks were evaluated since the last emit
    uint8_t template[1536]     # frame to send
    uint8_t returned[1536]     # last frame returned

cdef struct unit_t:
    uint32_t frame             # a frame with data of this unit; all of them are due in the same cycles
    uint32_t datagrams         # number of datagrams of this unit, in all frames
    uint32_t right             # datagrams since the last emit with the expected working counter
    uint16_t counter           # sum of the working counters since the last emit
    uint8_t optional           # its loss does not make the cycle not ok

cdef struct sent_t:            # last use of an index
    uint32_t serial            # serial of the emit; 0: never used
    uint16_t frame
    uint8_t answered           # a frame with this index has returned, in time or late

cdef struct frame_counters_t:
    uint64_t stale             # our frame, of an earlier cycle
    uint64_t alien             # other protocol, source or index
    uint64_t corrupt           # an EtherCAT frame that is inconsistent or differs from its template
    uint64_t duplicate         # our frame, a second time in this cycle
    uint64_t unprocessed       # an echo that no device has processed
    uint64_t repeated          # stale and duplicate frames that had returned before
    uint64_t send_errors
    uint64_t receive_errors

cdef struct frames_t:
    # constant after construction
    cat_image image
    const cat_link *link
    acyclic_queue_t *acyclic
    clock_t *clock             # NULL: no distributed clocks
    int receive_mode
    uint32_t frame_count
    uint32_t datagram_count
    frame_t *frames
    datagram_t *datagrams
    copy_t *copies
    unit_t *units
    # the image table points to these
    uint8_t *outputs
    uint8_t *inputs
    uint8_t *unit_valid
    uint8_t *unit_fresh
    uint32_t *unit_missed
    uint16_t *unit_counter
    uint8_t al_status
    uint16_t al_counter
    int64_t frame_stamp        # time at which the last frames were received; 0: clock not read yet
    uint8_t ok                 # every required due unit is valid, every required frame is back
    uint8_t whole              # every required unit is valid
    # since the last emit
    uint32_t serial            # number of the emit; never 0
    uint32_t missing           # number of due frames that are not back
    uint32_t missing_needed    # number of them that are required
    uint32_t right             # number of datagrams with the expected working counter
    uint16_t al_answered       # number of devices that answered the AL status datagram
    uint8_t al_seen            # OR of their answers
    uint8_t judged             # evaluated at least once
    uint8_t collected          # evaluated with all frames back: nothing more can arrive
    # across emits
    uint8_t filled             # the templates have the outputs of the next emit
    uint8_t settled            # the last evaluation found every datagram of all frames right
    uint32_t next_index
    sent_t sent[128]           # last use of each index
    frame_counters_t counters

cdef class Frames:
    """Owner of the templates, images and tables of one cyclic exchange."""
    cdef frames_t c
    cdef object link_owner
    cdef cat_memory memory     # memory of all tables and images
    cdef make_table(self)
    cdef carry_time(self, clock_t *clock)

cdef void frames_flush(frames_t *f) noexcept nogil
