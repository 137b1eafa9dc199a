from libc.stdint cimport int32_t, int64_t, uint8_t, uint16_t, uint32_t, uint64_t

from catenary.core._axes cimport axes_t
from catenary.core._clocks cimport clock_t
from catenary.core._handover cimport actual_t, handover_t, target_t
from catenary.core._histogram cimport histogram_t
from catenary.core._lane cimport lane_t
from catenary.core._law cimport law_t
from catenary.core._native cimport cat_image, cat_link, cat_sink
from catenary.core._stream cimport stream_t

cdef enum:  # flags of a cycle
    OK = 1
    LATE = 2
    LIMITED_SOME = 4
    WORKING_COUNTER = 8
    DROPPED_SOME = 16
    REFUSED_SOME = 32
    UNCOMMITTED = 64
    LAW_DONE = 128
    STOPPED = 256
    NONE = 512
    LAW_FAILED = 1024
    DRY = 2048
    CLOCKS = 4096
    AHEAD = 8192

cdef enum:
    THREADED = 0
    INLINE = 1
    LAW = 2

cdef enum:  # phases
    PERIOD = 0
    LATENESS = 1
    RECEIVE = 2
    PROCESS = 3
    SEND = 4
    TAIL = 5
    ROUND_TRIP = 6
    IN_CONTROLLER = 7
    PHASES = 8

cdef enum:
    LOG_MARGIN = 24            # the writer is not overtaken while the log is copied

cdef struct record_t:
    uint64_t number
    int64_t scheduled_ns
    int64_t wake_ns
    int32_t period_ns          # phases: -1 where unknown
    int32_t lateness_ns
    int32_t receive_ns
    int32_t process_ns
    int32_t send_ns
    int32_t tail_ns
    int32_t round_trip_ns
    uint32_t flags
    uint32_t lost_in_row
    uint32_t skipped
    uint16_t missing_frames
    uint16_t al_counter
    uint8_t al_status
    uint8_t reserved[3]

cdef struct cycle_t:
    const cat_link *link
    cat_image *image
    axes_t *axes
    lane_t *lane
    handover_t *handover
    clock_t *clock             # NULL: no distributed clocks
    law_t *law                 # NULL: none runs
    law_t *law_asked           # NULL: none is to run
    uint32_t law_request       # counts what was asked
    uint32_t law_seen
    stream_t *stream           # NULL: the application or the law says the set-points
    const cat_sink *sink       # NULL: nobody is given the cycles
    int order
    bint patient               # a cycle may begin late within its period: engines that take turns
    int64_t period
    int64_t lead               # inline, law: awake that long before the instant
    int64_t collect_deadline
    uint32_t lost_limit
    int64_t origin             # the first instant
    int64_t next               # instant to wait for
    int64_t scheduled          # instant of this cycle
    int64_t wake
    int64_t interval           # since the last one; -1: none
    int64_t usable             # when Python had the inputs; 0: not known
    int64_t process            # of this cycle; -1: no application
    uint64_t number
    uint32_t skipped           # instants before this cycle
    uint32_t lost_in_row
    uint32_t flags
    uint32_t drops             # cycles so far with each of four things to say
    uint32_t refusals
    uint32_t limits
    uint32_t dries
    uint32_t dry               # the stream had no row for the last set-points
    int missing
    bint taken                 # the inputs of the cycle to come are there since the lead, and
    bint ahead                 # its law has computed, its outputs stand in the image
    uint32_t law_flags         # what the step of the law had to say of its cycle
    uint64_t lost
    uint64_t late
    uint64_t uncommitted
    uint64_t begun             # wakes since the start: the first has no period
    record_t *records
    uint64_t records_mask      # of them there are so many and one: a power of two
    histogram_t *histograms    # PHASES of them

cdef void cycle_start(cycle_t *c, int64_t origin) noexcept nogil
cdef int cycle_wait(cycle_t *c) noexcept nogil
cdef int cycle_sleep(cycle_t *c, int64_t lead) noexcept nogil
cdef void cycle_await_lane(cycle_t *c, int64_t until) noexcept nogil
cdef void cycle_prepare(cycle_t *c) noexcept nogil
cdef void cycle_open(cycle_t *c) noexcept nogil
cdef void cycle_native(cycle_t *c) noexcept nogil
cdef void cycle_take_law(cycle_t *c, const target_t *orders) noexcept nogil
cdef void cycle_inputs(cycle_t *c, actual_t *actual) noexcept nogil
cdef void cycle_usable(cycle_t *c) noexcept nogil
cdef void cycle_outputs(cycle_t *c, target_t *target, bint application) noexcept nogil
