from libc.stdint cimport int32_t, int64_t, uint8_t, uint16_t, uint32_t, uint64_t

from catenary.core._memory cimport cat_memory

cdef enum:
    SEEKING = 0                # the cycle starts are not in phase yet
    FOLLOWING = 1              # the cycle starts are kept in phase

cdef struct phase_t:
    double bandwidth           # present bandwidth [1 / cycle]
    double bandwidth_end
    double drift               # estimated lasting correction of each period [ns]
    double drift_limit
    double rate_limit
    double residue             # fraction of the correction below one nanosecond
    double mean                # mean phase error [ns]
    int64_t period
    int64_t step               # errors larger than this are not drift
    uint32_t state
    uint32_t hold              # number of coming samples without an effect of the last step
    uint32_t rejected          # rejected samples in a row; at the maximum while a jump is corrected
    uint64_t ignored           # number of samples ignored
    uint64_t jumps             # number of jumps of the reference clock

cdef struct follower_t:
    uint16_t station
    uint8_t outside            # 1: beyond the bound, or never read
    int32_t last               # last difference, local minus received [ns]
    double mean
    int32_t worst              # largest magnitude since the figures were reset
    uint64_t reads

cdef struct clock_t:
    phase_t phase
    int follows_main           # the reference clock follows the link's clock
    uint16_t listeners         # expected working counter of the FRMW
    uint16_t reference         # station address
    int64_t epoch              # system time minus link time at the start
    int64_t target             # phase of the cycle starts in the reference clock's time
    int64_t bound
    int64_t bound_asked
    follower_t *followers
    uint32_t follower_count
    uint32_t turn              # follower to read next
    uint32_t outside           # number of followers outside the bound
    uint8_t *time_header       # header of the FRMW
    uint8_t *main_header       # header of the FPWR; NULL: none
    uint8_t *watch_header      # header of the FPRD; NULL: none
    int64_t scheduled          # cycle start of the cycle that sends
    int64_t sent               # time at which the last frame was sent
    int64_t sent_scheduled     # cycle start of that frame
    uint32_t payload           # time in that frame, for devices without a reference before them
    int64_t time               # last time of the reference
    int64_t time_sent          # time at which the frame that read it was sent
    uint32_t asked             # follower being read; PROBED: the reference's time
    uint8_t awaited            # the last frame sent has not been evaluated yet
    uint8_t sampled            # the reference answered in this cycle
    uint8_t holding            # the reference is lost: the core continues its time
    uint8_t locked
    uint32_t silent            # cycles in a row without the reference
    uint32_t good              # cycles in a row with everything within the bound
    uint32_t changes           # number of changes of `locked`
    uint32_t acknowledged      # changes that Python has acknowledged
    int64_t error              # the last phase error [ns]
    int64_t worst_error        # largest phase error since the figures were reset [ns]
    uint64_t samples
    uint64_t missed

cdef class Clock:
    """Owner of the distributed clocks of a cycle: `Engine.clock`."""
    cdef clock_t c
    cdef cat_memory memory

cdef void clock_emit(clock_t *k, int64_t now) noexcept nogil
cdef void clock_take(clock_t *k, uint8_t command, const uint8_t *data,
                     uint16_t counter) noexcept nogil
cdef int64_t clock_close(clock_t *k) noexcept nogil
