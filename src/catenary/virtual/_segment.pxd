from libc.stdint cimport int64_t, uint8_t, uint16_t, uint32_t, uint64_t

cdef extern from "clock.h":
    const char *CAT_CLOCK_CAPSULE
    uint32_t CAT_CLOCK_VERSION, CAT_CLOCK_VIRTUAL
    ctypedef struct cat_clock:
        uint32_t version, flags
        void *self
        int64_t (*now)(void *) noexcept nogil

cdef extern from "segment_memory.h" nogil:
    int MAX_AXES, MAX_MAPPED, MAX_MEMBERS, MAX_SENSORS, AXIS_SLOTS, MODEL_SERVO, MODEL_SLOTS, PORTS, MAX_FRAME_FAULTS
    int LOSS_LOG, LATCH_INPUTS, PROBES
    int64_t NEVER
    ctypedef struct sync_manager:
        uint16_t start, length
        uint8_t enabled, blocked, mailbox, ecat_writes, watchdog, full, latest, written
    ctypedef struct mapped:
        uint32_t bit
        uint16_t slot
        uint8_t bits, is_signed
    ctypedef struct mapping:
        mapped *entries
        int count, sm
    ctypedef struct sii_access:
        uint8_t *image
        uint32_t words
        int64_t read_time, write_time
    ctypedef struct sync_unit:
        uint32_t pulses0, pulses1
    ctypedef struct synchronous_cycle:
        int64_t cycle, minimum, copy_time
        uint16_t limit, missed, exceeded, shift_short
        uint8_t active, seen, error
    ctypedef struct port:
        uint8_t exists
    ctypedef struct cable_end:
        int device, port
    ctypedef struct cable:
        int64_t delay
        uint8_t plugged, light
    ctypedef struct loss:
        int64_t sent
        int cause, end
    ctypedef struct frame_fault:
        int kind, used
        int64_t left, delay
        uint32_t every, seen
        int cable, offset
    ctypedef struct stop:
        controller *controller
    ctypedef struct route:
        stop *stops
        uint32_t stop_count
    ctypedef struct segment_end:
        uint32_t head, tail
        int up
    ctypedef struct plant_joint:
        servo_axis *axis
        double *q
        double *v
        double *force
        double *friction
        double ratio, zero, dry, brake
        int64_t brake_delay
    ctypedef struct plant_sensor:
        const double *value
        int64_t *slot
        double scale, bias, noise
        uint64_t random
    ctypedef struct mujoco_message:
        pass
    ctypedef struct plant:
        void (*set_handler)(void (*)(const mujoco_message *) noexcept nogil) noexcept nogil
        void (*step)(const void *, void *) noexcept nogil
        const void *model
        void *data
        plant_joint *joints
        plant_sensor *sensors
        cat_segment **members
        uint8_t *freed
        int count, sensor_count, member_count, wild, apart, ending
        int64_t period, due
        uint64_t steps
        char words[256]
    ctypedef struct servo_quirks:
        double mode_delay
        uint32_t refused_modes
        uint8_t never_bit_12, follows_without_bit_12, ignores_quick_stop, ignores_disable
    ctypedef struct servo_probe:
        double from_ "from"
        double to
    ctypedef struct probe_quirks:
        uint8_t toggles, keeps_stored, one_edge
    ctypedef struct servo_axis:
        servo_probe *probes
        probe_quirks probe_quirks
        double inertia, viscous, coulomb, load, rated_torque, velocity_limit
        double counts_per_radian, velocity_per_radian, position_gain, velocity_gain, integral_gain
        double radian_per_count, radian_per_velocity, per_inertia, per_torque
        double position, velocity, torque, boot, bit_12_hidden
        servo_quirks quirks
        int state
        uint16_t injected
        uint8_t sto
    ctypedef struct controller:
        uint8_t *memory
        uint32_t memory_size, events
        uint8_t emulation, al_unread, frozen, outputs_valid, outputs_seen, powered, mute
        uint8_t has_dc, no_lrw, fixed_loops
        int fmmu_count
        port *ports
        uint16_t identification, emergency
        sync_manager *sm
        int sm_count
        sii_access sii
        sync_unit sync
        synchronous_cycle synchronous
        mapping outputs, inputs
        int64_t outputs_ns
        int64_t *slots
        int slot_count, axis_count
        servo_axis *axes
    ctypedef struct frame_counters:
        uint64_t frames, malformed, foreign, lost, datagrams, expired
    ctypedef struct fate:
        pass
    const fate NO_FATE
    ctypedef struct cat_segment:
        controller *controllers
        plant *plant
        int count, pending, event_fd, is_virtual, ring, cable_count, fault_count, failed
        cable *cables
        route *routes
        segment_end *ends
        frame_fault *faults
        loss *losses
        uint64_t loss_count, random
        const cat_clock *clock
        int64_t now, epoch, next_due, service_due, passage
        frame_counters counters
        int (*service)(void *) noexcept
        void *owner
    cat_segment *segment_make(int count, int is_virtual, int ring, int64_t detection)
    void segment_free(cat_segment *)
    int controller_make(controller *, uint32_t ram, uint32_t sii_words, int slots, int axes)
    void controller_power_on(controller *)
    void controller_power_off(controller *)
    void controller_remove(controller *)
    void controllers_exchange(controller *, controller *)
    void cable_lay(cat_segment *, int n, cable_end up, cable_end down)
    void segment_light(cat_segment *, int at_once)
    void routes_refresh(cat_segment *)
    void segment_advance(cat_segment *, int64_t until)
    void plant_free(plant *)
    void plant_lock(plant *)
    void plant_unlock(plant *)
    void plant_begin(plant *, int64_t now)
    void plant_run(plant *)
    void plant_hang(plant_joint *, servo_axis *)
    void servo_place(servo_axis *, double position)
    void al_show(controller *, uint16_t status, uint16_t code)
    void sm_configured(controller *, int n)
    uint8_t *sm_registers(controller *, int n)
    uint8_t *sm_buffer(controller *, sync_manager *, uint8_t)
    int sm_pdi_read(controller *, int n, uint8_t *data, uint32_t room)
    int sm_pdi_write(controller *, int n, const uint8_t *data, uint32_t size)
    void inputs_put(controller *)
    void inputs_flush(cat_segment *)
    void slots_refresh(controller *)
    void dc_tune(controller *, double error, double swing, double turn, double scatter, int64_t when)
    void model_period(controller *, int64_t period)
    void synchronous_begin(controller *, int64_t cycle, int steps, uint8_t signal)
    void synchronous_end(controller *)
    void sync_schedule(controller *)
    int64_t dc_system_time(const controller *, int64_t when)
    void latch_input(controller *, int number, int level, int64_t when)
    void probe_wire(const controller *, servo_axis *, int64_t *slots, int number, int level)
    void lock(cat_segment *)
    void unlock(cat_segment *)
    int64_t monotonic_now()
    int64_t register_number(const controller *, uint32_t address, int size)
    int frame_through(cat_segment *, const route *, const fate *, uint8_t *frame, uint32_t length)
    int frame_is_ours(const uint8_t *frame, uint32_t length)
    int line_send(void *, const uint8_t *, uint32_t)
    int line_receive(void *, const uint8_t **)
    int64_t line_now(void *)
    int line_wait_until(void *, int64_t, int)
    int line_spend(void *, int64_t)
    int64_t line_due(void *)
    enum:
        REG_AL_CONTROL, REG_RX_ERRORS, REG_LOST_LINKS, SM_PDI_DEACTIVATE, SM_PDI_REPEAT_ACK
        SM_ACTIVATE_REPEAT, ETHERNET_HEADER, LOSS_NO_LIGHT


cdef class Core:
    cdef cat_segment *_segment
    cdef object _service
    cdef object _clock
    cdef object _plant               # owner of the plant, which keeps it alive
    cdef object _partners            # segments with the same plant
    cdef bint _serving               # the service runs in virtual time
    cdef readonly object failure
    cdef readonly int count
    cdef controller *_at(self, int position) except NULL
    cdef sync_manager *_sync_manager_at(self, int position, int n) except NULL
    cdef servo_axis *_axis(self, int position, int axis) except NULL
    cdef int _run_service(self) noexcept
