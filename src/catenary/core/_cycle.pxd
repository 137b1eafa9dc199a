from libc.stdint cimport int32_t, int64_t, uint8_t, uint16_t, uint32_t, uint64_t

from catenary.core._axes cimport axes_t
from catenary.core._axis_log cimport axis_log_t
from catenary.core._clocks cimport clock_t
from catenary.core._copies cimport copies_t
from catenary.core._handover cimport actual_t, handover_t, target_t
from catenary.core._histogram cimport histogram_t
from catenary.core._acyclic_queue cimport acyclic_queue_t
from catenary.core._law cimport law_t
from catenary.core._native cimport cat_image, cat_law_monitor, cat_link, cat_pointer, cat_sink
from catenary.core._stream cimport stream_t
from catenary.core._trigger cimport trigger_t

cdef enum:
    THREADED = 0
    INLINE = 1

cdef enum:  # phases
    PERIOD = 0
    LATENESS = 1
    RECEIVE = 2
    PROCESS = 3
    SEND = 4
    POST_PROCESSING = 5
    ROUND_TRIP = 6
    IN_CONTROLLER = 7
    OUTPUT_DELAY = 8
    INPUT_AGE = 9
    INTERPRETER = 10           # written by Python's thread
    PHASES = 11

cdef enum:
    STEERING_BITS = 20
    STEERING_ONE = 1 << STEERING_BITS

cdef enum:
    LOG_MARGIN = 24            # safety distance to the writer while the log is copied

cdef struct record_t:
    uint64_t number
    int64_t scheduled_ns
    int64_t wake_ns
    int32_t period_ns          # phases; -1: unknown
    int32_t lateness_ns
    int32_t receive_ns
    int32_t process_ns
    int32_t send_ns
    int32_t post_processing_ns
    int32_t round_trip_ns
    int32_t output_delay_ns
    int32_t input_age_ns
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
    copies_t *copies           # NULL: no copies between devices
    acyclic_queue_t *acyclic
    handover_t *handover
    clock_t *clock             # NULL: no distributed clocks
    law_t *law                 # NULL: no law runs
    cat_law_monitor monitor    # monitor of all laws of this cycle
    cat_pointer law_request    # law_t to start; CAT_POINTER_NONE: stop. `law` is the claimed one
    cat_pointer stream         # stream_t; none: the application or the law sets the set-points
    const cat_sink *sink       # NULL: none
    trigger_t trigger          # cycles that start with those of another process
    int execution
    bint patient               # several engines in one thread: a cycle may begin at any time in its period
    int64_t period
    int64_t busy_wait          # busy-wait time before each cycle start
    int64_t collect_deadline   # time after the wake-up
    int64_t law_reserve        # part of the period for the law and the post-processing
    int64_t sync_margin        # with clocks: maximum time from the cycle start to the frames
    uint32_t lost_limit
    int64_t origin             # the first cycle start
    int64_t next               # next cycle start
    uint64_t steering          # int64: change of each period, set by Python [ns / STEERING_ONE]
    int64_t steering_rest      # fraction of the change below one nanosecond
    int64_t scheduled          # cycle start of this cycle
    int64_t wake
    int64_t interval           # time since the last wake-up [ns]; -1: none
    int64_t usable             # time at which the inputs were available to Python; 0: unknown
    int64_t sent               # time at which the last cyclic frame was handed to the kernel
    int64_t turnaround         # wake-up → last frame received, in the last complete cycle
    int64_t process            # duration of the body or law in this cycle; -1: none
    int64_t input_age          # age of the inputs used in this cycle; -1: unknown
    uint64_t number
    uint32_t skipped           # number of cycle starts skipped before this cycle
    uint32_t lost_in_row
    uint32_t flags
    int missing
    bint computed              # a law has computed the outputs of the next cycle
    bint outstanding           # frames were sent and not collected yet
    bint kept                  # a commit of the application waits for the end of a law
    uint64_t lost
    uint64_t late
    uint64_t missed_sync       # number of cycles that sent frames later than sync_margin
    uint64_t uncommitted
    uint64_t underruns         # number of cycles that found the stream empty
    uint64_t begun             # number of wake-ups since the start; the first has no period
    record_t *records
    uint64_t records_mask      # number of records minus one, a power of two minus one
    axis_log_t axis_log        # same number of rows; written with the actual values
    histogram_t *histograms    # PHASES of them; exchanged by Python (acquire, release)

cdef void cycle_start(cycle_t *c, int64_t origin) noexcept nogil
cdef int cycle_wait(cycle_t *c) noexcept nogil
cdef void cycle_await_acyclic(cycle_t *c, int64_t until) noexcept nogil
cdef void cycle_native(cycle_t *c) noexcept nogil
cdef int64_t cycle_law_reserve(const cycle_t *c, int64_t budget) noexcept nogil
cdef bint cycle_wants_native(cycle_t *c) noexcept nogil
cdef void cycle_inputs(cycle_t *c, actual_t *actual) noexcept nogil
cdef void cycle_usable(cycle_t *c) noexcept nogil
cdef void cycle_outputs(cycle_t *c, target_t *target, bint application) noexcept nogil
