from libc.stdint cimport int32_t, int64_t, uint8_t, uint16_t, uint32_t, uint64_t

from catenary.core._memory cimport cat_memory

cdef enum:
    SEEKING = 0                # the instants are to be set into phase
    FOLLOWING = 1              # and are being kept there

cdef struct phase_t:
    double bandwidth           # now [1 / cycle]
    double bandwidth_end
    double drift               # what the period is longer by, the part that stays [ns]
    double drift_limit
    double rate_limit
    double residue             # of the correction, below one nanosecond
    double mean                # of the error [ns]
    int64_t period
    int64_t step               # an error beyond is no drift
    uint32_t state
    uint32_t hold              # samples that still know nothing of the last step
    uint32_t rejected          # in a row; at its most while a jump is being made up for
    uint64_t ignored           # samples
    uint64_t jumps             # of the reference clock

cdef struct follower_t:
    uint16_t station
    uint8_t outside            # beyond the bound, or never read
    int32_t last               # [ns] local minus received
    double mean
    int32_t worst              # largest magnitude since the figures were reset
    uint64_t reads

cdef struct clock_t:
    phase_t phase
    int follows_main           # the reference clock follows the link's
    uint16_t listeners         # expected counter of the FRMW
    uint16_t reference         # station
    int64_t epoch              # system time - link's time, at the start
    int64_t target             # phase of the instants in the reference's time
    int64_t bound
    int64_t bound_asked
    follower_t *followers
    uint32_t follower_count
    uint32_t turn              # whose difference is asked
    uint32_t outside           # how many followers are
    uint8_t *time_header       # of the FRMW
    uint8_t *main_header       # of the FPWR; NULL: none
    uint8_t *watch_header      # of the FPRD; NULL: none
    int64_t scheduled          # instant of the cycle that sends
    int64_t sent               # when the last frame left, and
    int64_t sent_scheduled     # the instant it belonged to
    uint32_t payload           # what it carried for those that find no reference
    int64_t time               # of the reference: the last one, and
    int64_t time_sent          # when its frame left
    uint32_t asked             # whose difference is under way; PROBED: the reference's time
    uint8_t awaited            # the frame sent has not been looked at
    uint8_t sampled            # the reference answered in this cycle
    uint8_t holding            # the reference is gone: its time is kept here
    uint8_t locked
    uint32_t silent            # cycles in a row without the reference
    uint32_t good              # cycles in a row with everything within the bound
    uint32_t changes           # of `locked`
    uint32_t acknowledged      # of them
    int64_t error              # the last phase error [ns]
    int64_t worst_error        # since the figures were reset
    uint64_t samples
    uint64_t missed

cdef class Clock:
    """Owns what a cycle knows of distributed clocks."""
    cdef clock_t c
    cdef cat_memory memory

cdef void clock_emit(clock_t *k, int64_t now) noexcept nogil
cdef void clock_take(clock_t *k, uint8_t command, const uint8_t *data,
                     uint16_t counter) noexcept nogil
cdef int64_t clock_close(clock_t *k) noexcept nogil
