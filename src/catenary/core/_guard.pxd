from libc.stdint cimport int8_t, uint8_t, uint16_t, uint32_t, uint64_t

from catenary.core._axes cimport axes_t, axis_t
from catenary.core._cia402 cimport ENABLED, OPERATION_ENABLED
from catenary.core._handover cimport target_t

cdef enum:  # modes of operation, 0x6060
    PROFILE_POSITION = 1
    PROFILE_VELOCITY = 3
    PROFILE_TORQUE = 4
    CSP = 8
    CSV = 9
    CST = 10

cdef enum:
    NO_MODE = -128             # mode_refused: no mode was refused

cdef enum:
    NO_QUANTITY = 0
    POSITION = 1
    VELOCITY = 2
    TORQUE = 3

cdef inline uint8_t quantity_of(int8_t mode) noexcept nogil:
    if mode == CSP or mode == PROFILE_POSITION:
        return POSITION
    if mode == CSV or mode == PROFILE_VELOCITY:
        return VELOCITY
    if mode == CST or mode == PROFILE_TORQUE:
        return TORQUE
    return NO_QUANTITY

cdef enum:
    MODE_BITS = 0x0370         # controlword bits 4, 5, 6, 9: defined by the mode; 8: halt
    FREE_BITS = 0xF800         # controlword bits 11 to 15: the manufacturer's
    OPERATE = 0x000F           # enable operation

cdef enum:  # on_loss: reaction when the core stops an axis
    LOSS_QUICK_STOP = 0
    LOSS_DISABLE = 1
    LOSS_CSP_HOLD = 2

cdef enum:  # plan.stop_reason.StopReason
    STOP_NONE = 0
    STOP_UNDERRUN = 1
    STOP_HANDOVER = 2
    STOP_REFUSED = 3
    STOP_POSITION_LIMIT = 4
    STOP_NOT_FOLLOWING = 5
    STOP_MODE_CHANGE = 6
    STOP_NOT_ENABLED = 7
    STOP_DEVICE_LOST = 8
    STOP_LEFT_OPERATION = 9
    STOP_FAULT = 10
    STOP_REQUEST = 11
    STOP_COMMAND_TIMEOUT = 12
    STOP_OPERATOR = 13

cdef enum:  # commands of a stop, IEC 61800-7-201 table 26
    DISABLE_VOLTAGE = 0x00
    QUICK_STOP_COMMAND = 0x02
    DISABLE_OPERATION = 0x07

cdef void guard_observe(axes_t *x, axis_t *a, uint8_t state_before,
                        uint64_t number) noexcept nogil
cdef void guard_take_orders(axes_t *x, axis_t *a, const target_t *t, uint32_t i) noexcept nogil
cdef void guard_stop(axes_t *x, uint8_t reason) noexcept nogil
cdef void apply_state(axes_t *x, axis_t *a, uint8_t requested_state) noexcept nogil
cdef void begin_setpoints(axis_t *a) noexcept nogil
cdef uint16_t guard_lead(axes_t *x, axis_t *a, uint16_t bits) noexcept nogil
cdef void stop_axis(axes_t *x, axis_t *a, uint8_t reason) noexcept nogil
cdef void lose_axis(axes_t *x, axis_t *a, uint8_t reason) noexcept nogil
cdef uint16_t stop_command(axes_t *x, axis_t *a) noexcept nogil
cdef void prepare_other_mode(axis_t *a) noexcept nogil
cdef void refuse_mode(axes_t *x, axis_t *a, int8_t mode) noexcept nogil

cdef inline bint is_commanded(const axes_t *x, int8_t mode) noexcept nogil:
    """Return True if set-points of this mode are valid. Velocities and torques of a background
    program time out."""
    cdef uint8_t quantity = quantity_of(mode)
    if not x.background:
        return True
    if quantity == VELOCITY:
        return x.velocity_counts
    if quantity == TORQUE:
        return x.torque_counts
    return True

cdef inline bint shows_mode(const axis_t *a) noexcept nogil:
    return not a.mode_actual.present or a.mode_shown == a.mode

cdef inline bint is_drive_off(const axis_t *a) noexcept nogil:
    """Return True if the last control word of a SERCOS drive was drive off."""
    return a.sercos and a.command != OPERATE

cdef inline bint is_switching_off(const axis_t *a) noexcept nogil:
    """Return True if a SERCOS drive is in operation after drive off.

    It must not follow again in the middle of its ramp, which the command does not know.
    """
    return is_drive_off(a) and a.state == OPERATION_ENABLED

cdef inline void guard_orders(axes_t *x, axis_t *a, const target_t *t, uint32_t i) noexcept nogil:
    """Process new requests; a no-op for an axis that works and has none."""
    if (t.request[i] != a.request or t.mode[i] != a.mode_wanted or a.mode_refused != NO_MODE
            or (a.requested_state == ENABLED and not a.followed)):
        guard_take_orders(x, a, t, i)

cdef inline bint guard_works(const axis_t *a) noexcept nogil:
    """Return True if the axis follows its set-points and is requested to be enabled."""
    return (a.followed and a.requested_state == ENABLED and a.state == OPERATION_ENABLED
            and not a.clear_reset)

cdef inline uint16_t guard_controlword(axes_t *x, axis_t *a, uint16_t bits) noexcept nogil:
    """Return the controlword for this cycle. Call it once per cycle while the axis does not work,
    so that an edge of bit 7 is sent exactly once."""
    if not guard_works(a):
        return guard_lead(x, a, bits)
    a.command = OPERATE
    return OPERATE | (bits & (MODE_BITS | FREE_BITS))
