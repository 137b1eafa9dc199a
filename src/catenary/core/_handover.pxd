from libc.stdint cimport int8_t, int64_t, uint8_t, uint16_t, uint32_t, uint64_t

from catenary.core._memory cimport cat_memory
from catenary.core._native cimport cat_triple

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
    STICKY = LIMITED_SOME | DROPPED_SOME | REFUSED_SOME | DRY  # kept until Python has read them

cdef struct counts_t:
    uint32_t axes
    uint32_t units
    uint32_t input_reals
    uint32_t input_integers
    uint32_t input_bits
    uint32_t input_bytes
    uint32_t output_reals
    uint32_t output_integers
    uint32_t output_bits
    uint32_t output_bytes

cdef struct actual_header_t:
    uint64_t number            # number of the cycle; 1 for the first one
    int64_t time_ns            # cycle start, relative to the first one
    int64_t sent_ns            # link time at which the last cyclic frame was handed to the kernel
    uint32_t flags
    uint32_t lost_in_row
    uint32_t skipped
    uint32_t moving            # number of axes that are under power and not lost; they may be at rest
    double period              # [s]
    uint32_t axis_count
    uint16_t missing_frames
    uint16_t al_counter
    uint8_t al_status
    uint8_t ok

cdef struct actual_t:           # a header and the arrays of ACTUAL (_handover.pyx), in its order
    actual_header_t *header
    double *position
    double *velocity
    double *torque
    double *commanded_position
    double *commanded_velocity
    double *commanded_torque
    double *input_reals
    int64_t *input_integers
    uint64_t *followed_since   # number of the cycle; for axes that are followed
    uint64_t *stop_cycle
    uint16_t *statusword
    uint16_t *controlword      # last one sent
    uint16_t *unit_counter
    int8_t *mode
    uint8_t *state
    uint8_t *flags
    uint8_t *stop_reason
    uint8_t *enabled           # bit 0 of flags, for laws
    uint8_t *jogged            # an operator moves the axis
    uint8_t *input_bits
    uint8_t *input_bytes
    uint8_t *unit_valid

cdef struct target_header_t:
    uint64_t seen              # newest cycle of which the application had read the actual values
    uint64_t stamp             # number of the cycle for which the set-points were computed
    int64_t process_ns         # duration of the body; -1: unknown
    int64_t input_age_ns       # age of its inputs when the body began; -1: unknown
    uint64_t updated           # background: number of the cycle of the last update; 0: none is valid
    uint32_t hold              # hand-over: no application commits set-points
    uint32_t streamed          # the set-points are a row of a stream
    uint32_t background        # a thread repeats the updates of a program: see updated

cdef struct target_t:           # a header and the arrays of TARGET, in its order
    target_header_t *header
    double *position
    double *velocity
    double *torque
    double *output_reals
    int64_t *output_integers
    uint32_t *request
    uint16_t *controlword_bits
    int8_t *mode
    uint8_t *requested_state
    uint8_t *output_bits
    uint8_t *output_bytes

cdef struct handover_t:
    counts_t counts
    uint32_t actual_size
    uint32_t target_size
    cat_triple actual_triple
    cat_triple target_triple
    actual_t actual[4]         # three to exchange; the last one is Python's own
    target_t target[6]         # as above, and the law's two
    uint32_t published         # futex word: number of publications
    uint32_t waiting           # 1: Python sleeps on `published`
    uint32_t sticky            # flags of cycles that Python has not read yet

cdef enum:
    PRIVATE = 3
    OF_LAW = 4
    BEFORE_LAW = 5             # targets before the step of the law; restored if it fails
    TARGETS = 6

cdef class Handover:
    """Buffers between the cycle and Python."""
    cdef handover_t c
    cdef cat_memory memory     # one block per direction and slot
    cdef dict counts
    cdef allocate(self)
    cdef dict views(self, void **block, tuple table, bint writable)
    cdef dict places(self, void **block, tuple table, int column)
    cdef field(self, void *start, uint32_t count, size_t itemsize, bytes format, bint writable)

cdef void handover_commit(handover_t *h) noexcept nogil
cdef target_t *handover_latch(handover_t *h, bint *fresh) noexcept nogil
cdef void handover_publish(handover_t *h) noexcept nogil
cdef void handover_wake(handover_t *h) noexcept nogil
cdef bint handover_swap(handover_t *h) noexcept nogil
