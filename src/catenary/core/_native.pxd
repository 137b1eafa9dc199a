"""The C headers in catenary/native, for cimport."""

from libc.stdint cimport int64_t, uint8_t, uint16_t, uint32_t, uint64_t


cdef extern from "atomics.h" nogil:
    uint32_t cat_load_acquire32(const uint32_t *p)
    uint32_t cat_load_relaxed32(const uint32_t *p)
    uint64_t cat_load_acquire64(const uint64_t *p)
    void cat_store_release64(uint64_t *p, uint64_t v)
    uint64_t cat_load_relaxed64(const uint64_t *p)
    void *cat_load_acquire_pointer(void **p)
    void cat_store_release_pointer(void **p, void *v)
    void cat_store_release32(uint32_t *p, uint32_t v)
    bint cat_change32(uint32_t *p, uint32_t before, uint32_t after)
    uint32_t cat_add32(uint32_t *p, uint32_t v)
    uint32_t cat_exchange32(uint32_t *p, uint32_t v)
    uint32_t cat_or32(uint32_t *p, uint32_t v)
    void cat_fence()


cdef extern from "ethercat.h" nogil:
    enum:
        CAT_NOP
        CAT_APRD
        CAT_APWR
        CAT_APRW
        CAT_FPRD
        CAT_FPWR
        CAT_BRD
        CAT_BWR
        CAT_BRW
        CAT_ARMW
        CAT_FRMW
        CAT_ETHERNET_HEADER
        CAT_ETHERCAT_HEADER
        CAT_DATAGRAM_HEADER
        CAT_DATAGRAM_COUNTER
        CAT_AL_STATE
        CAT_AL_ERROR
        CAT_AL_OP


cdef extern from "futex.h" nogil:
    int cat_futex_wait(uint32_t *word, uint32_t value, int64_t timeout_ns)
    void cat_futex_wake(uint32_t *word)


cdef extern from "link.h" nogil:
    const char *CAT_LINK_CAPSULE
    const uint32_t CAT_LINK_VERSION
    const uint32_t CAT_FRAME_MAX
    const uint32_t CAT_FRAME_MIN
    const uint32_t CAT_LINK_VIRTUAL_TIME
    const uint32_t CAT_LINK_SHARED_TIME
    const uint32_t CAT_LINK_SPENDS

    ctypedef struct cat_link:
        uint32_t version
        uint32_t flags
        void *self
        int (*send)(void *self, const uint8_t *frame, uint32_t length) noexcept nogil
        int (*receive)(void *self, const uint8_t **frame) noexcept nogil
        int64_t (*now)(void *self) noexcept nogil
        int (*wait_until)(void *self, int64_t deadline, int wake_on_frame) noexcept nogil
        int (*spend)(void *self, int64_t duration) noexcept nogil


cdef extern from "image.h" nogil:
    const char *CAT_IMAGE_CAPSULE
    const uint32_t CAT_IMAGE_VERSION

    ctypedef struct cat_image:
        uint32_t version
        uint32_t unit_count
        uint32_t output_size
        uint32_t input_size
        void *self
        uint8_t *outputs
        const uint8_t *inputs
        const uint8_t *unit_valid
        const uint8_t *unit_fresh
        const uint32_t *unit_missed
        const uint16_t *unit_counter
        const uint8_t *ok
        const uint8_t *whole
        const uint8_t *al_status
        const uint16_t *al_counter
        const int64_t *frame_stamp
        int (*emit)(void *self) noexcept nogil
        int (*collect)(void *self, int64_t deadline) noexcept nogil
        void (*drain)(void *self) noexcept nogil
        void (*fill)(void *self) noexcept nogil


cdef extern from "packet_ring.h" nogil:
    const uint32_t CAT_RING_SLOTS

    ctypedef struct cat_packet:
        uint32_t length
        int64_t stamp
        uint8_t *bytes

    ctypedef struct cat_packet_ring:
        pass

    int cat_ring_push(cat_packet_ring *ring, const uint8_t *bytes, uint32_t length, int64_t stamp)
    const cat_packet *cat_ring_peek(const cat_packet_ring *ring)
    void cat_ring_drop(cat_packet_ring *ring)


cdef extern from "triple_buffer.h" nogil:
    ctypedef struct cat_triple:
        uint32_t back
        uint32_t front

    void cat_triple_init(cat_triple *triple)
    void cat_triple_publish(cat_triple *triple)
    int cat_triple_take(cat_triple *triple)


cdef extern from "pointer_handover.h" nogil:
    void *CAT_POINTER_NONE

    ctypedef struct cat_pointer:
        pass

    void *cat_pointer_offer(cat_pointer *p, void *pointer)
    bint cat_pointer_is_used(const cat_pointer *p, const void *pointer)
    bint cat_pointer_is_offered(const cat_pointer *p)
    void *cat_pointer_claim(cat_pointer *p)
    bint cat_pointer_take(cat_pointer *p, void **pointer)
    void cat_pointer_release(cat_pointer *p)


cdef extern from "motion.h" nogil:
    const uint64_t CAT_MOTION_TOKEN_MASK
    const int CAT_MOTION_PRESS_SHIFT
    const int CAT_MOTION_STATUS_BITS

    ctypedef struct cat_motion:
        uint64_t stop
        uint64_t stopper
        uint64_t token

    ctypedef struct cat_motion_slot:
        uint64_t press
        uint64_t begun
        uint64_t heartbeat
        uint64_t released
        double velocity
        double distance
        double acceleration
        uint64_t request
        uint64_t answer
        uint64_t taken
        double sweep_start
        double sweep_end
        double sweep_duration


cdef extern from "sink.h" nogil:
    const char *CAT_SINK_CAPSULE
    const uint32_t CAT_SINK_VERSION

    ctypedef struct cat_sink:
        uint32_t version
        uint32_t record_size
        uint32_t actual_size
        uint32_t target_size
        void *self
        void (*put)(void *self, uint64_t number, const void *record, const void *actual,
                    const void *target) noexcept nogil
        cat_motion *motion
        uint32_t motion_axes
        uint32_t jog


cdef extern from "trigger.h" nogil:
    const uint32_t CAT_TRIGGER_SIZE

    ctypedef struct cat_trigger:
        uint32_t tick
        uint64_t scheduled
        uint64_t period

    void cat_trigger_send(cat_trigger *t, int64_t scheduled, int64_t period)
    int cat_trigger_wait(cat_trigger *t, uint32_t seen, int64_t awake, int64_t deadline)


cdef extern from "law.h" nogil:
    const int CAT_LAW_GOES_ON
    const int CAT_LAW_FINISHED
    const int CAT_LAW_RAISED
    const int CAT_LAW_ABORTED

    ctypedef struct cat_law_numbers:
        double *memory
        int64_t memory_count
        double *parameters
        int64_t parameter_count

    ctypedef int (*cat_law_step)(const void *actual, void *target, double *memory,
                                 int64_t memory_count, const double *parameters,
                                 int64_t parameter_count, double time) noexcept nogil

    ctypedef struct cat_law_guard:
        uint32_t known

    ctypedef struct cat_law_monitor:
        cat_law_guard guard

    int cat_law_monitor_start(cat_law_monitor *monitor, int priority)
    void cat_law_monitor_stop(cat_law_monitor *monitor)
    void cat_law_monitor_activate(cat_law_monitor *monitor, int64_t limit)
    void cat_law_monitor_park(cat_law_monitor *monitor)
    int cat_law_call(cat_law_guard *guard, cat_law_step step, const void *actual, void *target,
                     const cat_law_numbers *numbers, double time)
