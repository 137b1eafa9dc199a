# cython: boundscheck=False, wraparound=False, cdivision=True
"""Safety of one axis in one cycle: whether its set-points count, what is sent where they do not,
limits, and when its goal drops. docs/safety.md, "In the core".

- Set-points count only while *followed*: goal enabled, OPERATION_ENABLED, the mode shown is the one
  asked, bit 12 where the mode defines it, the unit answers. Until then target := actual, and a
  position committed before the application could see that the axis is followed is ignored.
- Some drives never set bit 12. One that has not shown it once while all else was right for the mute
  limit counts as followed without it; should it show it later after all, the goal drops.
- Whatever leaves that state by itself (fault, STO, quick stop, unit lost) drops the goal: only a new
  request brings it back.
- Without a fresh target a position holds; velocity and torque ramp to zero; after the late limit the
  axis stops quickly. A target that is not finite counts as none.
Budget: 20 ns an axis.
"""

from libc.math cimport INFINITY, fabs, isfinite, sqrt
from libc.stdint cimport int8_t, uint8_t, uint16_t, uint32_t, uint64_t

from catenary.core._axes cimport DROPPED, FALLBACK, FOLLOWED, LIMITED, REFUSED
from catenary.core._cia402 cimport (
    DISABLED,
    ENABLED,
    FAULT,
    FAULT_REACTION_ACTIVE,
    FAULT_RESET,
    OPERATION_ENABLED,
    QUICK_STOP,
    QUICK_STOP_ACTIVE,
    RESET,
    SWITCHED_ON,
    cia402_command,
)

cdef enum:
    FOLLOWS_COMMAND = 0x1000   # statusword bit 12 in CSP, CSV, CST


cdef inline double clamp(axis_t *a, double value, double low, double high) noexcept nogil:
    if value < low:
        a.flags |= LIMITED
        return low
    if value > high:
        a.flags |= LIMITED
        return high
    return value


# ---- goals

cdef void drop(axes_t *x, axis_t *a) noexcept nogil:
    if a.goal != DISABLED:
        a.flags |= DROPPED
        x.dropped = 1
    a.goal = DISABLED
    a.stopping = 1
    a.armed = 0
    a.followed = 0


cdef bint is_mapped(const axis_t *a) noexcept nogil:
    """The target that the mode follows has a place in the process data."""
    cdef uint8_t quantity = quantity_of(a.mode)
    if quantity == POSITION:
        return a.target_position.present
    if quantity == VELOCITY:
        return a.target_velocity.present
    return quantity != TORQUE or a.target_torque.present


cdef bint is_ready(const axis_t *a) noexcept nogil:
    """All that makes an axis followed, but bit 12."""
    if a.goal != ENABLED or a.state != OPERATION_ENABLED or a.lost or not is_mapped(a):
        return False
    return not a.mode_actual.present or a.mode_shown == a.mode


cdef bint is_trusted(axes_t *x, axis_t *a) noexcept nogil:
    if not is_ready(a):
        if a.mute_cycles < x.mute_limit:
            a.mute_cycles = 0
        return False
    if a.mode not in (CSP, CSV, CST):
        return True
    if a.status & FOLLOWS_COMMAND:
        if a.followed and not a.tells:
            drop(x, a)  # it has the bit: what was sent until now it did not follow
        a.tells = 1
        return a.goal == ENABLED
    if a.mute_cycles < x.mute_limit:
        a.mute_cycles += 1
    return not a.tells and a.mute_cycles >= x.mute_limit


cdef void guard_observe(axes_t *x, axis_t *a, uint8_t state_before,
                        uint64_t number) noexcept nogil:
    """After the inputs of a cycle: does the goal still stand, is the axis followed?"""
    if a.invalid_in_row > 0:
        if a.invalid_in_row >= x.lost_limit and not a.lost:
            a.lost = 1
            drop(x, a)
        return
    a.lost = 0
    if a.goal == ENABLED:
        if state_before == OPERATION_ENABLED and a.state != OPERATION_ENABLED:
            drop(x, a)
        elif a.state >= FAULT_REACTION_ACTIVE and state_before < FAULT_REACTION_ACTIVE:
            drop(x, a)
    elif a.goal == QUICK_STOP:
        if a.state != OPERATION_ENABLED and a.state != QUICK_STOP_ACTIVE:
            a.goal = DISABLED
        elif a.state == QUICK_STOP_ACTIVE and a.still_cycles >= x.still_limit:
            a.goal = DISABLED
    elif a.goal == RESET and a.state != FAULT:
        a.goal = DISABLED
    if not is_trusted(x, a):
        a.followed = 0
    elif not a.followed:
        a.followed = 1
        a.climbing_cycles = 0
        a.followed_since = number


cdef void guard_take_request(axes_t *x, axis_t *a, const target_t *t, uint32_t i) noexcept nogil:
    """Takes a new request over; counts how long it has been waiting."""
    cdef uint8_t goal
    if t.request[i] != a.request:
        a.request = t.request[i]
        goal = t.goal[i]
        a.clear_reset = a.state == FAULT
        a.goal = goal if goal <= RESET else DISABLED
        a.flags &= ~DROPPED
        a.stopping = 0
        a.armed = 0
        a.climbing_cycles = 0
        if a.lost:
            drop(x, a)  # nobody can hear it: it must not come true later
    if a.goal == ENABLED and not a.followed:
        if not t.header.hold:
            a.armed = 1
        if a.armed or quantity_of(a.mode) == POSITION:
            a.climbing_cycles += 1
        if a.climbing_cycles > x.climbing_limit:
            drop(x, a)  # what was asked long ago must not surprise anyone


cdef void guard_stop(axes_t *x) noexcept nogil:
    """Every axis: quick stop, and nothing more without a new request."""
    cdef uint32_t i
    for i in range(x.axis_count):
        drop(x, &x.axes[i])


cdef uint16_t guard_lead(axes_t *x, axis_t *a, uint16_t bits) noexcept nogil:
    """The controlword that leads an axis to its goal, or keeps it there."""
    cdef uint8_t goal = a.goal
    cdef uint16_t command
    if goal == ENABLED and not a.armed and quantity_of(a.mode) in (VELOCITY, TORQUE):
        # A brake must not open before there is somebody to hold the load.
        if not a.followed:
            goal = DISABLED
    if a.state == QUICK_STOP_ACTIVE and a.still_cycles < x.still_limit:
        goal = QUICK_STOP  # every way out leads through disabling, which would let the axis coast
    elif goal == DISABLED and a.state == OPERATION_ENABLED and a.stopping:
        goal = QUICK_STOP
    command = cia402_command(a.state, goal, a.command)
    if a.clear_reset:
        command &= ~FAULT_RESET
        a.clear_reset = 0
    a.command = command
    if a.state == OPERATION_ENABLED and goal == ENABLED:
        command |= bits & MODE_BITS
    return command | (bits & FREE_BITS)


# ---- set-points

cdef inline double towards_zero(double value, double step) noexcept nogil:
    if fabs(value) <= step:
        return 0.0
    return value - step if value > 0 else value + step


cdef bint is_usable(axis_t *a, double value, bint fresh) noexcept nogil:
    """A target the application has committed for this instant, and that is a number."""
    if not fresh:
        return False
    if isfinite(value):
        a.refused_cycles = 0
        return True
    a.flags |= REFUSED
    a.refused_cycles += 1
    return False


cdef void position_setpoint(axes_t *x, axis_t *a, double target, bint fresh) noexcept nogil:
    cdef double held = a.commanded_position
    cdef double step = a.velocity_limit * x.period
    if not is_usable(a, target, fresh):
        return
    # An axis found outside its limits may stay or come back, not leave further.
    target = clamp(a, target, min(a.position_min, held), max(a.position_max, held))
    if a.mode == CSP:
        target = clamp(a, target, held - step, held + step)
    a.commanded_position = target


cdef bint is_leaving(const axis_t *a) noexcept nogil:
    """Outside a position limit and moving away from it."""
    if a.position > a.position_max:
        return a.velocity > a.standstill
    return a.position < a.position_min and a.velocity < -a.standstill


cdef void velocity_setpoint(axes_t *x, axis_t *a, double target, bint fresh) noexcept nogil:
    """Towards a position limit never faster than the ramp can still bring to rest before it."""
    if not is_usable(a, target, fresh):
        a.flags |= FALLBACK
        target = towards_zero(a.commanded_velocity, a.ramp_velocity * x.period)
    target = clamp(a, target, -a.velocity_limit, a.velocity_limit)
    if a.position_max < INFINITY:
        target = clamp(a, target, -INFINITY,
                       sqrt(2 * a.ramp_velocity * max(a.position_max - a.position, 0.0)))
    if a.position_min > -INFINITY:
        target = clamp(a, target,
                       -sqrt(2 * a.ramp_velocity * max(a.position - a.position_min, 0.0)), INFINITY)
    a.commanded_velocity = target
    a.beyond_cycles = a.beyond_cycles + 1 if is_leaving(a) else 0
    if a.beyond_cycles > x.beyond_limit:
        drop(x, a)


cdef double limited_torque(axis_t *a, double target) noexcept nogil:
    """Within the torque limit; none towards a position limit reached or over the velocity limit."""
    target = clamp(a, target, -a.torque_limit, a.torque_limit)
    if a.position >= a.position_max or a.velocity > a.velocity_limit:
        target = clamp(a, target, -INFINITY, 0.0)
    if a.position <= a.position_min or a.velocity < -a.velocity_limit:
        target = clamp(a, target, 0.0, INFINITY)
    return target


cdef void torque_setpoint(axes_t *x, axis_t *a, double target, bint fresh) noexcept nogil:
    if not is_usable(a, target, fresh):
        a.flags |= FALLBACK
        target = towards_zero(a.commanded_torque, a.ramp_torque * x.period)
    a.commanded_torque = limited_torque(a, target)
    if is_leaving(a):
        drop(x, a)  # without torque nothing brakes it: the drive must


cdef void hold_back(axis_t *a, double torque, bint fresh) noexcept nogil:
    """Not followed: target := actual. Only a torque is there already when the brake opens."""
    a.commanded_position = a.position
    a.commanded_velocity = 0.0
    a.commanded_torque = 0.0
    a.refused_cycles = 0
    a.beyond_cycles = 0
    if (fresh and a.state == SWITCHED_ON and a.goal == ENABLED and a.armed
            and quantity_of(a.mode) == TORQUE and isfinite(torque)):
        a.commanded_torque = limited_torque(a, torque)


cdef void guard_setpoints(axes_t *x, axis_t *a, const target_t *t, uint32_t i,
                          bint fresh) noexcept nogil:
    """What is sent to the axis in this cycle: commanded_*."""
    cdef uint8_t quantity = quantity_of(a.mode)
    cdef uint32_t limit, late
    a.flags &= DROPPED
    if not a.followed:
        hold_back(a, t.torque[i], fresh)
        return
    if quantity != POSITION:
        a.commanded_position = a.position
    if quantity != VELOCITY:
        a.commanded_velocity = 0.0
    if quantity != TORQUE:
        a.commanded_torque = 0.0
    if quantity == POSITION:
        position_setpoint(x, a, t.position[i], fresh and t.header.seen >= a.followed_since)
        limit = x.late_limit_position
    else:
        if quantity == VELOCITY:
            velocity_setpoint(x, a, t.velocity[i], fresh)
        elif quantity == TORQUE:
            torque_setpoint(x, a, t.torque[i], fresh)
        limit = x.late_limit_velocity
    late = max(x.uncommitted, a.refused_cycles)
    if late > 0:
        a.flags |= FALLBACK
    if limit > 0 and late >= limit:
        drop(x, a)
