from libc.stdint cimport int64_t, uint8_t, uint32_t, uint64_t

from catenary.core._native cimport cat_motion, cat_motion_slot, cat_sink
from catenary.core._sweep cimport sweep_t

cdef enum:
    TOKENS = 5                 # as many as can be fresh

cdef struct token_t:
    uint64_t value             # 0: none
    int64_t issued             # [ns]

cdef struct jog_t:             # of one axis
    uint64_t press             # number of the last press that was seen
    uint64_t heartbeat         # last heartbeat word that was seen
    uint64_t request           # last request word that was seen
    int64_t deadline           # the jog stops later than this [ns]
    uint8_t status             # answer to that press
    uint8_t ending             # status at the end of the ramp
    double velocity            # requested [rad/s]; of a sweep: its amplitude
    double acceleration        # [rad/s²]
    double deceleration        # [rad/s²]
    double remaining           # [rad] in the direction of `velocity`; infinite: until release
    double speed               # velocity of the command in this cycle, signed [rad/s]
    sweep_t sweep              # its `duration` is 0 for another jog

cdef struct motion_t:
    cat_motion *words          # NULL: no other process can request motions
    cat_motion_slot *slots     # one for each axis
    jog_t *jogs                # one for each axis
    uint8_t allowed            # jogs, and requests to enable or reset
    int64_t now                # time of this cycle [ns]
    uint64_t stop_seen
    uint64_t random            # state of the generator of tokens
    uint32_t newest            # index of the newest token
    token_t tokens[TOKENS]

cdef void motion_attach(motion_t *m, const cat_sink *sink, uint32_t axes, uint64_t seed) noexcept nogil
cdef void motion_begin(motion_t *m, int64_t now) noexcept nogil
cdef bint motion_extends(const motion_t *m, uint64_t heartbeat, uint64_t press, int64_t now,
                         int64_t *deadline) noexcept nogil
cdef bint motion_stop_requested(motion_t *m) noexcept nogil
