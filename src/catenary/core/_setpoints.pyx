# cython: boundscheck=False, wraparound=False, cdivision=True
"""Set-points of one axis in one cycle: commanded_position, commanded_velocity, commanded_torque.

Theory of operation. A followed axis gets the committed set-point, within its limits. In seven
situations other values are sent:

- not powered: actual position, zero velocity and torque; in SWITCHED_ON a committed torque is sent,
  so that it is present when the brake opens;
- waiting: powered and requested to be enabled, but not followed: before bit 12 is shown, during a
  mode change, after bit 12 was lost (`waiting_cycles`);
- hand-over (`x.handed_over`): a law or stream ended, or an internal call waits;
- underrun: no set-point was committed, or that of this axis was refused (`late_cycles`);
- background (`x.background`): a thread repeats the set-points of a program. CSP falls back without a
  late limit while nothing is committed. In CSV and CST a set-point is valid until the last update is
  older than the command timeout; then CSV decelerates and CST is stopped (`is_timed_out`);
- jog (`jogged`): an operator moves the axis (_jog.pyx). Afterwards it holds until the application
  commits a target for it, without a late limit (`yielded`);
- stopping: another state was requested, or the core stopped the axis.

In the profile modes the drive computes the trajectory. In PP the command stays until another one is
committed. Underruns do not count, because the drive completes its motion by itself. In PV the
velocity stays in an underrun, and the late limit of CSV applies; in the other situations the target
is 0. In the situations with power, CSP and CSV decelerate and hold, and CST keeps its torque. Each
is bounded in time (`judge_lateness`, _guard.pyx). In an underrun CSP first keeps the velocity of
the last two set-points. `ghost` is the set-point of this cycle, which the core continues in a
fallback (`fallback_cycles`). `setpoint` is the last one that the application has written;
`accepted` counts them up to two. When set-points return, the command returns to them within
acceleration, deceleration and torque slope (`returning`).

Budget: 10 ns per axis that follows.
"""

from libc.math cimport INFINITY, copysign, fabs, fmax, fmin, isfinite, sqrt
from libc.stdint cimport uint8_t, uint32_t, uint64_t

from catenary.core._axes cimport DROPPED, FALLBACK, MODE_REFUSED, REFUSED
from catenary.core._cia402 cimport (
    ENABLED,
    FAULT_REACTION_ACTIVE,
    OPERATION_ENABLED,
    QUICK_STOP_ACTIVE,
    SWITCHED_ON,
)
from catenary.core._guard cimport (
    CSP,
    CSV,
    DISABLE_VOLTAGE,
    POSITION,
    PROFILE_POSITION,
    PROFILE_VELOCITY,
    STOP_COMMAND_TIMEOUT,
    STOP_HANDOVER,
    STOP_MODE_CHANGE,
    STOP_NOT_FOLLOWING,
    STOP_POSITION_LIMIT,
    STOP_REFUSED,
    STOP_UNDERRUN,
    TORQUE,
    VELOCITY,
    is_commanded,
    is_switching_off,
    lose_axis,
    prepare_other_mode,
    quantity_of,
    refuse_mode,
    shows_mode,
    stop_axis,
    stop_command,
)
from catenary.core._jog cimport jog_setpoint
from catenary.core._limits cimport approach, clamp, within_limits

cdef double STEP_TOLERANCE = 1.000001  # a step of exactly the limit is accepted


# ---- fallback: no valid set-point

cdef double towards_limits(const axis_t *a, double position, double velocity,
                           double deceleration) noexcept nogil:
    """Return the velocity, reduced so that a position can stop before the position limits."""
    if a.position_max < INFINITY and velocity > 0:
        velocity = fmin(velocity, sqrt(2 * deceleration * fmax(a.position_max - position, 0.0)))
    if a.position_min > -INFINITY and velocity < 0:
        velocity = fmax(velocity, -sqrt(2 * deceleration * fmax(position - a.position_min, 0.0)))
    return velocity


cdef void return_to(axes_t *x, axis_t *a, double target, double velocity) noexcept nogil:
    """Move the command towards a moving set-point, at a velocity from the remaining distance.

    The command stops before the position limits, although it may move faster than the set-point.
    """
    cdef double held = a.commanded_position
    cdef double distance = target - a.commanded_position - velocity * x.period
    cdef double step = a.acceleration * x.period
    cdef double catch_up
    if fabs(distance) <= step * x.period and fabs(a.command_velocity - velocity) <= step:
        a.returning = 0
        return
    catch_up = fmin(sqrt(2 * a.acceleration * fabs(distance)), fabs(distance) / x.period)
    velocity = approach(a.command_velocity, velocity + copysign(catch_up, distance), step)
    velocity = fmin(fmax(velocity, -a.velocity_limit), a.velocity_limit)
    velocity = towards_limits(a, held, velocity, a.acceleration)
    a.commanded_position = within_limits(a, held + velocity * x.period)
    a.command_velocity = (a.commanded_position - held) / x.period


cdef void track(axes_t *x, axis_t *a, double target, double velocity) noexcept nogil:
    """Command a moving set-point, within the limits. While `returning`, only approach it."""
    cdef double held = a.commanded_position
    cdef double step = a.velocity_limit * x.period
    cdef double limited = within_limits(a, target)
    if limited != target:
        target = limited
        velocity = 0.0
    if a.returning:
        return_to(x, a, target, velocity)
        if a.returning:
            a.flags |= FALLBACK
            return
    a.commanded_position = clamp(a, target, held - step, held + step)
    a.command_velocity = (a.commanded_position - held) / x.period


cdef inline double fallback_velocity(const axis_t *a) noexcept nogil:
    """Return the velocity of the last set-points; 0 if they do not define one."""
    cdef double last = a.setpoint_velocity
    cdef double before = a.previous_velocity
    if last * before <= 0.0:
        return 0.0
    if fabs(last) > 2 * fabs(before):
        last = before
    return fmin(fmax(last, -a.velocity_limit), a.velocity_limit)


cdef void fall_back_position(axes_t *x, axis_t *a, bint keep) noexcept nogil:
    """Continue the set-points at their velocity, or decelerate them; the command tracks them."""
    if a.fallback_cycles == 1:
        a.ghost_velocity = fallback_velocity(a) if a.accepted >= 2 else 0.0
    if not keep:
        a.ghost_velocity = approach(a.ghost_velocity, 0.0, a.deceleration * x.period)
    a.ghost_velocity = towards_limits(a, a.ghost, a.ghost_velocity, a.deceleration)
    a.ghost += a.ghost_velocity * x.period
    track(x, a, a.ghost, a.ghost_velocity)


cdef void fall_back(axes_t *x, axis_t *a, bint keep) noexcept nogil:
    """Compute one cycle without a valid set-point. `keep`: CSP and PV may keep their velocity."""
    cdef uint8_t quantity = quantity_of(a.mode)
    if a.mode == PROFILE_POSITION:
        return
    a.flags |= FALLBACK
    a.fallback_cycles += 1
    if a.mode == PROFILE_VELOCITY:
        if not keep:
            a.commanded_velocity = 0.0
    elif quantity == POSITION:
        fall_back_position(x, a, keep and a.fallback_cycles <= x.keep_limit)
    elif quantity == VELOCITY:
        if a.fallback_cycles == 1 and a.velocity_offset.present:
            a.commanded_velocity += a.offset_sent  # 0x60B1 adds to the target, and ends now
        a.commanded_velocity = approach(a.commanded_velocity, 0.0, a.deceleration * x.period)


# ---- valid set-points

cdef bint is_number(axis_t *a, double value) noexcept nogil:
    if isfinite(value):
        return True
    a.flags |= REFUSED
    a.refused_cycles += 1
    return False


cdef bint is_accepted(axes_t *x, axis_t *a, double target, uint64_t between) noexcept nogil:
    """Return True if a CSP set-point is within the step limit; otherwise refuse it."""
    cdef double limit = a.step_limit
    if limit == 0.0:
        limit = fmax(a.step_floor, 2 * a.velocity_limit * x.period
                     * <double>max(between, <uint64_t>a.divider))
    if fabs(target - a.setpoint) <= limit * STEP_TOLERANCE:
        return True
    a.flags |= REFUSED
    a.refused_cycles += 1
    return False


cdef void follow_position(axes_t *x, axis_t *a, const target_t *t, double target) noexcept nogil:
    cdef double held = a.commanded_position
    cdef uint64_t stamp = t.header.stamp
    cdef uint64_t since = a.setpoint_stamp if a.setpoint_stamp else a.followed_since
    cdef uint64_t between = 1
    cdef uint64_t age = 0
    if not t.header.streamed:
        between = stamp - since if stamp > since else 1
        age = x.number - stamp if x.number > stamp else 0
    if a.mode != CSP:
        a.commanded_position = within_limits(a, target)
        a.refused_cycles = 0
        return
    if not is_accepted(x, a, target, 1 if a.yielded else between):  # a pause after a jog has no limit
        if t.header.streamed:
            a.yielded = 0  # other axes move on: the late limit counts
        fall_back(x, a, False)
        return
    a.previous_velocity = a.setpoint_velocity
    a.setpoint_velocity = (target - a.setpoint) / (x.period * <double>between)
    a.setpoint = target
    a.setpoint_stamp = stamp
    if a.fallback_cycles:
        a.returning = a.accepted > 0
        if t.header.streamed:
            a.previous_velocity = 0.0  # the pause between two rows is unknown
    a.accepted = min(a.accepted + 1, 2)
    a.yielded = 0
    a.refused_cycles = 0
    a.fallback_cycles = 0
    a.ghost = target + a.setpoint_velocity * x.period * <double>age
    track(x, a, a.ghost, a.setpoint_velocity)
    if age > 0:
        a.returning = 1  # the next set-point may continue from before the pause or from now


cdef bint is_leaving(const axis_t *a) noexcept nogil:
    """Return True if the axis is outside a position limit and moves away from it."""
    if a.position > a.position_max:
        return a.velocity > a.standstill
    return a.position < a.position_min and a.velocity < -a.standstill


cdef void limit_velocity(axes_t *x, axis_t *a) noexcept nogil:
    """Limit the commanded velocity, so that the axis stops before a position limit.

    Stop an axis that keeps moving away outside a limit.
    """
    cdef double target = clamp(a, a.commanded_velocity, -a.velocity_limit, a.velocity_limit)
    if a.position_max < INFINITY:
        target = clamp(a, target, -INFINITY,
                       sqrt(2 * a.deceleration * fmax(a.position_max - a.position, 0.0)))
    if a.position_min > -INFINITY:
        target = clamp(a, target,
                       -sqrt(2 * a.deceleration * fmax(a.position - a.position_min, 0.0)), INFINITY)
    a.commanded_velocity = target
    a.beyond_cycles = a.beyond_cycles + 1 if is_leaving(a) else 0
    if a.beyond_cycles > x.beyond_limit:
        stop_axis(x, a, STOP_POSITION_LIMIT)


cdef void follow_velocity(axes_t *x, axis_t *a, double target) noexcept nogil:
    cdef double rate
    if a.fallback_cycles:
        a.returning = a.accepted > 0 and a.mode == CSV
    a.accepted = 2
    a.yielded = 0
    a.refused_cycles = 0
    a.fallback_cycles = 0
    target = clamp(a, target, -a.velocity_limit, a.velocity_limit)
    if a.returning:
        rate = a.acceleration if fabs(target) > fabs(a.commanded_velocity) else a.deceleration
        a.commanded_velocity = approach(a.commanded_velocity, target, rate * x.period)
        a.returning = a.commanded_velocity != target
        if a.returning:
            a.flags |= FALLBACK
        return
    a.commanded_velocity = target


cdef double limited_torque(axis_t *a, double target) noexcept nogil:
    """Return the limited torque.

    It never acts towards a reached position limit or accelerates beyond the velocity limit.
    """
    target = clamp(a, target, -a.torque_limit, a.torque_limit)
    if a.position >= a.position_max or a.velocity > a.velocity_limit:
        target = clamp(a, target, -INFINITY, 0.0)
    if a.position <= a.position_min or a.velocity < -a.velocity_limit:
        target = clamp(a, target, 0.0, INFINITY)
    return target


cdef void follow_torque(axes_t *x, axis_t *a, double target) noexcept nogil:
    if a.fallback_cycles:
        a.returning = a.accepted > 0
    a.accepted = 2
    a.refused_cycles = 0
    a.fallback_cycles = 0
    if a.returning:
        a.commanded_torque = approach(a.commanded_torque, target, a.torque_slope * x.period)
        a.returning = a.commanded_torque != target
        return
    a.commanded_torque = target


cdef void limit_torque(axes_t *x, axis_t *a) noexcept nogil:
    a.commanded_torque = limited_torque(a, a.commanded_torque)
    if is_leaving(a):
        stop_axis(x, a, STOP_POSITION_LIMIT)  # zero torque does not brake; only the drive can stop the axis


cdef void follow(axes_t *x, axis_t *a, const target_t *t, uint32_t i, bint fresh) noexcept nogil:
    """Follow the set-point of this cycle if it is valid; otherwise fall back."""
    cdef uint8_t quantity = quantity_of(a.mode)
    cdef double target = 0.0
    if quantity == POSITION:
        target = t.position[i]
        fresh = fresh and t.header.seen >= a.followed_since
    elif quantity == VELOCITY:
        target = t.velocity[i]
    elif quantity == TORQUE:
        target = t.torque[i]
    if x.background and not x.handed_over and quantity != POSITION:
        fresh = is_commanded(x, a.mode)
    if a.yielded:  # a velocity from before the end of the jog was not meant for now
        fresh = fresh and (t.header.updated if x.background else t.header.seen) >= a.followed_since
    if not fresh or not is_number(a, target):
        fall_back(x, a, not x.handed_over and a.refused_cycles == 0 and is_commanded(x, a.mode))
    elif quantity == POSITION:
        follow_position(x, a, t, target)
    elif quantity == VELOCITY:
        follow_velocity(x, a, target)
    elif quantity == TORQUE:
        follow_torque(x, a, target)
    else:
        a.fallback_cycles = 0
    if quantity == VELOCITY:
        limit_velocity(x, a)
    elif quantity == TORQUE:
        limit_torque(x, a)


cdef inline bint is_timed_out(const axes_t *x, const axis_t *a) noexcept nogil:
    """Return True if the last update of a program in the background is no longer valid. Within the
    hand-over limit, counted from the begin of the last hand-over, return False.
    """
    return (x.handed_over == 0 and not is_commanded(x, a.mode)
            and x.number - x.handed_over_at > x.handover_limit)


cdef void judge_lateness(axes_t *x, axis_t *a) noexcept nogil:
    """Stop a followed axis that has been without set-points for too long."""
    cdef uint8_t quantity = quantity_of(a.mode)
    cdef uint32_t limit = x.late_limit_position
    if a.yielded:
        a.late_cycles = 0
        return
    if quantity == VELOCITY:
        limit = x.late_limit_velocity
    elif quantity == TORQUE:
        limit = x.late_limit_torque
        if x.handed_over > x.handover_limit:
            lose_axis(x, a, STOP_HANDOVER)
            return
        if is_timed_out(x, a):
            lose_axis(x, a, STOP_COMMAND_TIMEOUT)
            return
    if x.handed_over or not a.fallback_cycles or (x.background and not a.refused_cycles):
        a.late_cycles = 0
        return
    a.late_cycles += 1
    if limit > 0 and a.late_cycles >= limit:
        lose_axis(x, a, STOP_REFUSED if a.refused_cycles else STOP_UNDERRUN)


# ---- outputs

cdef void rest(axes_t *x, axis_t *a, const target_t *t, uint32_t i) noexcept nogil:
    """Set the outputs of an unpowered axis: its actual position, zero velocity and zero torque.

    In SWITCHED_ON, send the committed torque (limited), so that it is present when the brake opens.
    """
    a.commanded_position = a.position
    a.commanded_velocity = 0.0
    a.commanded_torque = 0.0
    a.command_velocity = 0.0
    if a.state == QUICK_STOP_ACTIVE or a.state == FAULT_REACTION_ACTIVE:
        a.stop_cycles += 1
    if (a.state == SWITCHED_ON and a.requested_state == ENABLED and a.armed and not t.header.hold
            and quantity_of(a.mode) == TORQUE and isfinite(t.torque[i])):
        a.commanded_torque = limited_torque(a, t.torque[i])


cdef void stopping(axes_t *x, axis_t *a) noexcept nogil:
    """Decelerate a powered axis that stops; keep its torque until the voltage is removed."""
    a.stop_cycles += 1
    fall_back(x, a, False)
    prepare_other_mode(a)
    a.commanded_torque = limited_torque(a, a.commanded_torque)
    if stop_command(x, a) == DISABLE_VOLTAGE:
        a.commanded_torque = 0.0


cdef void wait_for_mode(axes_t *x, axis_t *a) noexcept nogil:
    """Fall back in the mode in force until the drive shows the requested mode.

    After the time limit, refuse that mode or stop the axis.
    """
    fall_back(x, a, False)
    prepare_other_mode(a)
    if quantity_of(a.mode) == TORQUE:
        a.commanded_torque = limited_torque(a, a.commanded_torque)
        if not a.holding and a.waiting_cycles > max(x.handover_limit, 4 * a.divider):
            lose_axis(x, a, STOP_MODE_CHANGE)
            return
    if a.waiting_cycles < max(x.mode_limit, 4 * a.divider):
        return
    if a.holding or a.mode_wanted == a.mode:
        stop_axis(x, a, STOP_MODE_CHANGE)
    else:
        refuse_mode(x, a, a.mode_wanted)


cdef void wait_for_bit_12(axes_t *x, axis_t *a) noexcept nogil:
    """Fall back while bit 12 is lost (the drive ignores its targets); stop the axis after a limit."""
    if quantity_of(a.mode) == POSITION:
        a.flags |= FALLBACK
        a.command_velocity = 0.0
        a.fallback_cycles = 0
        a.commanded_position = a.demand_position if a.position_demand.present else a.position
    else:
        fall_back(x, a, False)
    if a.gap_cycles >= max(x.gap_limit, 5 * a.divider):
        stop_axis(x, a, STOP_NOT_FOLLOWING)


cdef void waiting(axes_t *x, axis_t *a, const target_t *t, uint32_t i, bint fresh) noexcept nogil:
    """Handle a powered axis that is requested to be enabled, but is not followed."""
    a.waiting_cycles += 1
    if a.mode_wanted != a.mode or (a.worked and not shows_mode(a)):
        wait_for_mode(x, a)
    elif a.worked and not a.holding:
        wait_for_bit_12(x, a)
    elif quantity_of(a.mode) == TORQUE:
        follow(x, a, t, i, fresh)  # the brake is open: its load needs the torque
        judge_lateness(x, a)
    else:
        fall_back(x, a, False)


cdef void axis_setpoints(axes_t *x, axis_t *a, const target_t *t, uint32_t i,
                          bint fresh) noexcept nogil:
    """Compute the outputs of the axis in this cycle: commanded_*."""
    cdef uint8_t quantity = quantity_of(a.mode)
    a.flags &= DROPPED | MODE_REFUSED
    if a.state != OPERATION_ENABLED:
        rest(x, a, t, i)
        return
    if quantity != POSITION:
        a.commanded_position = a.position
    if quantity != VELOCITY:
        a.commanded_velocity = 0.0
    if quantity != TORQUE:
        a.commanded_torque = 0.0
    if a.followed and a.jogged:
        jog_setpoint(x, a, t, i)
        if quantity == VELOCITY:
            limit_velocity(x, a)
    elif a.followed:
        follow(x, a, t, i, fresh)
        if a.followed:
            judge_lateness(x, a)
    elif a.requested_state != ENABLED or is_switching_off(a):
        stopping(x, a)
    else:
        waiting(x, a, t, i, fresh)
