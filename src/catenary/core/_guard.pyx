# cython: boundscheck=False, wraparound=False, cdivision=True
"""Safety of one axis in one cycle. docs/safety.md has the table of reactions and their scenarios.

Theory of operation. `guard_observe` runs after the inputs of a cycle, the other functions before its
outputs. The set-points of the application count only while the axis is *followed*: requested state
enabled, OPERATION_ENABLED, the mode shown is the one in force, statusword bit 12 where the mode
defines it, and its unit answers. Five situations decide what is sent instead:

- not powered: target := actual; in SWITCHED_ON a committed torque is sent, so that it is there when
  the brake opens;
- waiting: powered, but not followed yet (`waiting`), after a mode request (`mode_wanted` differs from
  `mode`) or after bit 12 was lost (`worked` is set);
- hand-over (`x.handed_over`): a law or stream ended, or a call of ours waits;
- underrun (`x.uncommitted`), or a refused set-point of this axis (`refused_cycles`);
- stopping: another state was requested, or the core stopped the axis (`stop_axis`).

In all of them CSP and CSV decelerate and hold, and CST keeps its torque; each is bounded in time.
In an underrun CSP first keeps the velocity of the last two set-points: `ghost` is the set-point that
the core continues. When set-points come back, the command returns to them within acceleration,
deceleration and torque slope (`returning`).
A stop sends quick stop, then disable operation, then disable voltage; the last torque stays until
OPERATION_ENABLED is left. `stop_reason` and `stop_cycle` keep the cause until a new request.

Budget: 20 ns per axis that works.
"""

from libc.math cimport INFINITY, copysign, fabs, fmax, fmin, isfinite, sqrt
from libc.stdint cimport int8_t, uint8_t, uint16_t, uint32_t, uint64_t

from catenary.core._axes cimport DROPPED, FALLBACK, LIMITED, MODE_REFUSED, REFUSED
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

from catenary.core._handover cimport DROPPED_SOME

cdef enum:
    FOLLOWS_COMMAND = 0x1000   # statusword bit 12 in CSP, CSV, CST
    BIT_12_GAP = 3             # exchanges without bit 12 that are bridged

cdef enum:  # commands of a stop, IEC 61800-7-201 table 26
    DISABLE_VOLTAGE = 0x00
    QUICK_STOP_COMMAND = 0x02
    DISABLE_OPERATION = 0x07

cdef double STEP_FLOOR = 0.1           # [rad] smallest default of the step limit
cdef double STEP_TOLERANCE = 1.000001  # a step of exactly the limit is accepted


cdef inline double clamp(axis_t *a, double value, double low, double high) noexcept nogil:
    if value < low:
        a.flags |= LIMITED
        return low
    if value > high:
        a.flags |= LIMITED
        return high
    return value


cdef inline double approach(double value, double goal, double step) noexcept nogil:
    """Return `value` moved towards `goal` by at most `step`."""
    if fabs(goal - value) <= step:
        return goal
    return value + copysign(step, goal - value)


# ---- stops and requests

cdef void stop_axis(axes_t *x, axis_t *a, uint8_t reason) noexcept nogil:
    """Stop an axis for a reason; only a new request enables it again."""
    if a.goal != DISABLED or a.holding:
        a.flags |= DROPPED
        x.told |= DROPPED_SOME
        a.stop_reason = reason
        a.stop_cycle = x.number
        a.stop_cycles = 0
        a.followed_at_stop = a.tells and a.status & FOLLOWS_COMMAND != 0
    a.goal = DISABLED
    a.stopping = 1
    a.armed = 0
    a.followed = 0
    a.holding = 0


cdef void lose_axis(axes_t *x, axis_t *a, uint8_t reason) noexcept nogil:
    """Stop an axis whose set-points stay away, by its option `on_loss`."""
    if a.on_loss != LOSS_CSP_HOLD or a.mode != CST or a.holding:
        stop_axis(x, a, reason)
        return
    a.flags |= DROPPED
    x.told |= DROPPED_SOME
    a.stop_reason = reason
    a.stop_cycle = x.number
    a.holding = 1              # a new request ends it
    a.followed = 0
    a.waiting_cycles = 0
    a.mode_wanted = CSP


cdef void guard_take_request(axes_t *x, axis_t *a, const target_t *t, uint32_t i) noexcept nogil:
    """Take a new request over; count how long it has been waiting."""
    cdef uint8_t goal
    if t.request[i] != a.request:
        a.request = t.request[i]
        goal = t.goal[i]
        a.clear_reset = a.state == FAULT
        a.goal = goal if goal <= RESET else DISABLED
        a.flags &= ~DROPPED
        a.stop_reason = STOP_NONE
        a.stop_cycles = 0
        a.followed_at_stop = a.tells and a.status & FOLLOWS_COMMAND != 0
        a.stopping = 0
        a.holding = 0
        a.armed = 0
        a.climbing_cycles = 0
        if a.goal != ENABLED:
            a.followed = 0
        if a.lost:
            stop_axis(x, a, STOP_DEVICE_LOST)  # the request must not come true later
    if a.goal == ENABLED and not a.followed:
        if not t.header.hold:
            a.armed = 1
        if a.armed or quantity_of(a.mode) == POSITION:
            a.climbing_cycles += 1
        if a.climbing_cycles > x.climbing_limit:
            stop_axis(x, a, STOP_NOT_ENABLED)


cdef void guard_stop(axes_t *x) noexcept nogil:
    """Stop every axis on request; nothing moves without a new one."""
    cdef uint32_t i
    for i in range(x.axis_count):
        stop_axis(x, &x.axes[i], STOP_REQUEST)


cdef uint16_t stop_command(axes_t *x, axis_t *a) noexcept nogil:
    """Return the command for an axis in OPERATION_ENABLED that is to stop.

    A drive that clears bit 12 is reacting: it has until the stop deadline for its ramp."""
    cdef uint32_t patience = max(x.stop_patience, 4 * a.divider)
    cdef bint quick = a.goal == QUICK_STOP or (a.stopping and a.on_loss != LOSS_DISABLE)
    if quantity_of(a.mode) == TORQUE:
        patience = max(x.stop_patience_torque, 4 * a.divider)
    if a.stop_cycles <= patience:
        return QUICK_STOP_COMMAND if quick else DISABLE_OPERATION
    if a.followed_at_stop and not a.status & FOLLOWS_COMMAND and a.stop_cycles <= x.stop_limit:
        return QUICK_STOP_COMMAND if quick else DISABLE_OPERATION
    if a.stop_cycles <= patience + max(x.cut_patience, a.divider):
        return DISABLE_OPERATION
    return DISABLE_VOLTAGE


cdef uint16_t guard_lead(axes_t *x, axis_t *a, uint16_t bits) noexcept nogil:
    """Return the controlword that leads an axis to its requested state, or keeps it there."""
    cdef uint8_t goal = a.goal
    cdef uint16_t command
    if goal == ENABLED and not a.armed and quantity_of(a.mode) in (VELOCITY, TORQUE):
        # A brake must not open before a set-point holds the load.
        if not a.followed and a.state != OPERATION_ENABLED:
            goal = DISABLED
    if a.state == OPERATION_ENABLED and goal != ENABLED:
        command = stop_command(x, a)
    else:
        if a.state == QUICK_STOP_ACTIVE and a.still_cycles < x.still_limit:
            goal = QUICK_STOP  # every way out disables, and the axis would coast
        command = cia402_command(a.state, goal, a.command)
    if a.clear_reset:
        command &= ~FAULT_RESET
        a.clear_reset = 0
    a.command = command
    if a.state == OPERATION_ENABLED and goal == ENABLED:
        command |= bits & MODE_BITS
    return command | (bits & FREE_BITS)


# ---- modes of operation

cdef void guard_take_mode(axis_t *a, int8_t mode) noexcept nogil:
    """Take a requested mode over. A powered axis keeps its mode until 0x6061 shows the new one."""
    if mode == a.mode_refused:
        return
    a.mode_refused = NO_MODE
    a.flags &= ~MODE_REFUSED
    if a.holding or mode == a.mode_wanted:
        return
    a.mode_wanted = mode
    a.waiting_cycles = 0
    if a.state != OPERATION_ENABLED:
        a.mode = mode
    a.followed = 0


cdef inline double demanded_torque(const axis_t *a) noexcept nogil:
    """Return the torque that a powered drive applies now: 0x6074, else the actual torque."""
    cdef double torque = a.demand_torque if a.torque_demand.present else a.torque
    return torque if isfinite(torque) else 0.0


cdef void prepare_mode(axis_t *a, int8_t mode) noexcept nogil:
    """Set the targets with which a powered axis enters a mode without a jump."""
    cdef uint8_t quantity = quantity_of(mode)
    if quantity == POSITION:
        a.commanded_position = a.position
    elif quantity == VELOCITY:
        a.commanded_velocity = a.velocity if isfinite(a.velocity) else 0.0
    elif quantity == TORQUE:
        a.commanded_torque = demanded_torque(a)


cdef void begin_setpoints(axis_t *a) noexcept nogil:
    """Forget the set-points so far: the axis stands at its command."""
    a.setpoint = a.commanded_position
    a.ghost = a.commanded_position
    a.setpoint_velocity = 0.0
    a.previous_velocity = 0.0
    a.setpoint_stamp = 0
    a.accepted = 0
    a.command_velocity = 0.0
    a.fallback_cycles = 0
    a.refused_cycles = 0
    a.beyond_cycles = 0
    a.waiting_cycles = 0
    a.returning = 0
    a.worked = 0
    a.gap_cycles = 0


cdef void enter_mode(axis_t *a) noexcept nogil:
    """0x6061 shows the requested mode: it is in force now."""
    if quantity_of(a.mode) != quantity_of(a.mode_wanted):
        prepare_mode(a, a.mode_wanted)
    a.mode = a.mode_wanted
    begin_setpoints(a)


# ---- after the inputs

cdef bint is_mapped(const axis_t *a) noexcept nogil:
    """Return True if the target of the mode has a place in the process data."""
    cdef uint8_t quantity = quantity_of(a.mode)
    if quantity == POSITION:
        return a.target_position.present
    if quantity == VELOCITY:
        return a.target_velocity.present
    return quantity != TORQUE or a.target_torque.present


cdef inline bint shows_mode(const axis_t *a) noexcept nogil:
    return not a.mode_actual.present or a.mode_shown == a.mode


cdef bint is_trusted(axes_t *x, axis_t *a) noexcept nogil:
    """Return True if the drive follows its targets: mode in force, bit 12 or no need of it."""
    if (a.goal != ENABLED or a.state != OPERATION_ENABLED or a.lost or a.holding
            or a.mode_wanted != a.mode or not is_mapped(a) or not shows_mode(a)):
        if a.mute_cycles < x.mute_limit:
            a.mute_cycles = 0
        return False
    if a.mode not in (CSP, CSV, CST):
        return True
    if a.status & FOLLOWS_COMMAND:
        if a.followed and not a.tells:
            stop_axis(x, a, STOP_NOT_FOLLOWING)  # it has the bit: it followed nothing until now
        a.tells = 1
        a.gap_cycles = 0
        return a.goal == ENABLED
    if a.worked and a.tells:
        a.gap_cycles += 1
        return a.gap_cycles <= BIT_12_GAP * a.divider
    if a.mute_cycles < x.mute_limit:
        a.mute_cycles += 1
    return not a.tells and a.mute_cycles >= x.mute_limit


cdef void observe_requested_state(axes_t *x, axis_t *a, uint8_t state_before) noexcept nogil:
    """Adapt the requested state to what the drive did by itself."""
    if a.goal == ENABLED:
        if a.state >= FAULT_REACTION_ACTIVE and state_before < FAULT_REACTION_ACTIVE:
            stop_axis(x, a, STOP_FAULT)
        elif state_before == OPERATION_ENABLED and a.state != OPERATION_ENABLED:
            stop_axis(x, a, STOP_LEFT_OPERATION)
    elif a.goal == QUICK_STOP:
        if a.state != OPERATION_ENABLED and a.state != QUICK_STOP_ACTIVE:
            a.goal = DISABLED
        elif a.state == QUICK_STOP_ACTIVE and a.still_cycles >= x.still_limit:
            a.goal = DISABLED
    elif a.goal == RESET and a.state != FAULT:
        a.goal = DISABLED


cdef void guard_observe(axes_t *x, axis_t *a, uint8_t state_before,
                        uint64_t number) noexcept nogil:
    """Judge the inputs of a cycle: requested state, mode in force, followed or not."""
    if a.invalid_in_row > 0:
        if a.invalid_in_row >= x.lost_limit and not a.lost:
            a.lost = 1
            stop_axis(x, a, STOP_DEVICE_LOST)
        return
    a.lost = 0
    observe_requested_state(x, a, state_before)
    if a.state != OPERATION_ENABLED:
        a.mode = a.mode_wanted
    elif state_before != OPERATION_ENABLED:
        a.commanded_position = a.position  # frozen from here on
        begin_setpoints(a)
    elif a.mode_wanted != a.mode and a.mode_shown == a.mode_wanted:
        enter_mode(a)
    if not is_trusted(x, a):
        a.followed = 0
    elif not a.followed:
        a.followed = 1
        a.returning = a.worked
        a.worked = 1
        a.climbing_cycles = 0
        a.waiting_cycles = 0
        a.followed_since = number


# ---- fallback: without set-points that count

cdef void return_to(axes_t *x, axis_t *a, double target, double velocity) noexcept nogil:
    """Move the command towards a moving set-point: velocity from the remaining distance."""
    cdef double distance = target - a.commanded_position - velocity * x.period
    cdef double step = a.acceleration * x.period
    cdef double catch_up
    if fabs(distance) <= step * x.period and fabs(a.command_velocity - velocity) <= step:
        a.returning = 0
        return
    catch_up = fmin(sqrt(2 * a.acceleration * fabs(distance)), fabs(distance) / x.period)
    velocity = approach(a.command_velocity, velocity + copysign(catch_up, distance), step)
    a.command_velocity = fmin(fmax(velocity, -a.velocity_limit), a.velocity_limit)
    a.commanded_position += a.command_velocity * x.period


cdef void track(axes_t *x, axis_t *a, double target, double velocity) noexcept nogil:
    """Command a set-point that moves at `velocity`: within the limits, or on the way back to it."""
    cdef double held = a.commanded_position
    cdef double step = a.velocity_limit * x.period
    # An axis found outside its limits may stay or come back, not leave further.
    target = clamp(a, target, fmin(a.position_min, held), fmax(a.position_max, held))
    if a.returning:
        return_to(x, a, target, velocity)
        if a.returning:
            a.flags |= FALLBACK
            return
    a.commanded_position = clamp(a, target, held - step, held + step)
    a.command_velocity = (a.commanded_position - held) / x.period


cdef double towards_limits(const axis_t *a, double velocity) noexcept nogil:
    """Return a velocity from which the set-points still stop before a position limit."""
    if a.position_max < INFINITY and velocity > 0:
        velocity = fmin(velocity, sqrt(2 * a.deceleration * fmax(a.position_max - a.ghost, 0.0)))
    if a.position_min > -INFINITY and velocity < 0:
        velocity = fmax(velocity, -sqrt(2 * a.deceleration * fmax(a.ghost - a.position_min, 0.0)))
    return velocity


cdef inline double fallback_velocity(const axis_t *a) noexcept nogil:
    """Return the velocity at which set-points stayed away. A single step is not a velocity."""
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
    a.ghost_velocity = towards_limits(a, a.ghost_velocity)
    a.ghost += a.ghost_velocity * x.period
    track(x, a, a.ghost, a.ghost_velocity)


cdef void fall_back(axes_t *x, axis_t *a, bint keep) noexcept nogil:
    """Compute one cycle without a set-point that counts. `keep`: CSP may keep its velocity."""
    cdef uint8_t quantity = quantity_of(a.mode)
    a.flags |= FALLBACK
    a.fallback_cycles += 1
    if quantity == POSITION:
        fall_back_position(x, a, keep and a.fallback_cycles <= x.keep_limit)
    elif quantity == VELOCITY:
        if a.fallback_cycles == 1 and a.velocity_offset.present:
            a.commanded_velocity += a.offset_sent  # 0x60B1 adds to the target, and ends now
        a.commanded_velocity = approach(a.commanded_velocity, 0.0, a.deceleration * x.period)


# ---- set-points that count

cdef bint is_number(axis_t *a, double value) noexcept nogil:
    if isfinite(value):
        return True
    a.flags |= REFUSED
    a.refused_cycles += 1
    return False


cdef bint is_accepted(axes_t *x, axis_t *a, double target, uint64_t between) noexcept nogil:
    """Refuse a CSP set-point too far from the last accepted one."""
    cdef double limit = a.step_limit
    if limit == 0.0:
        limit = fmax(STEP_FLOOR, 2 * a.velocity_limit * x.period
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
        a.commanded_position = clamp(a, target, fmin(a.position_min, held), fmax(a.position_max, held))
        a.refused_cycles = 0
        return
    if not is_accepted(x, a, target, between):
        fall_back(x, a, False)
        return
    a.previous_velocity = a.setpoint_velocity
    a.setpoint_velocity = (target - a.setpoint) / (x.period * <double>between)
    a.setpoint = target
    a.setpoint_stamp = stamp
    if a.fallback_cycles:
        a.returning = a.accepted > 0
        if t.header.streamed:
            a.previous_velocity = 0.0  # the pause between two rows is not known
    a.accepted = min(a.accepted + 1, 2)
    a.refused_cycles = 0
    a.fallback_cycles = 0
    a.ghost = target + a.setpoint_velocity * x.period * <double>age
    track(x, a, a.ghost, a.setpoint_velocity)


cdef bint is_leaving(const axis_t *a) noexcept nogil:
    """Return True if the axis is outside a position limit and moves away from it."""
    if a.position > a.position_max:
        return a.velocity > a.standstill
    return a.position < a.position_min and a.velocity < -a.standstill


cdef void limit_velocity(axes_t *x, axis_t *a) noexcept nogil:
    """Bound the commanded velocity so that the axis stops before a position limit."""
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
        a.returning = a.accepted > 0
    a.accepted = 2
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
    """Return the torque within its limit, none towards a position limit that is reached and none
    that accelerates beyond the velocity limit."""
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
        stop_axis(x, a, STOP_POSITION_LIMIT)  # without torque only the drive can brake it


cdef void follow(axes_t *x, axis_t *a, const target_t *t, uint32_t i, bint fresh) noexcept nogil:
    """Follow the set-point of this cycle, if there is one that counts; else fall back."""
    cdef uint8_t quantity = quantity_of(a.mode)
    cdef double target = t.torque[i]
    if quantity == POSITION:
        target = t.position[i]
        fresh = fresh and t.header.seen >= a.followed_since
    elif quantity == VELOCITY:
        target = t.velocity[i]
    if not fresh or not is_number(a, target):
        fall_back(x, a, not x.handed_over and a.refused_cycles == 0)
    elif quantity == POSITION:
        follow_position(x, a, t, target)
    elif quantity == VELOCITY:
        follow_velocity(x, a, target)
    elif quantity == TORQUE:
        follow_torque(x, a, target)
    if quantity == VELOCITY:
        limit_velocity(x, a)
    elif quantity == TORQUE:
        limit_torque(x, a)


cdef void judge_lateness(axes_t *x, axis_t *a) noexcept nogil:
    """Stop a followed axis whose set-points have stayed away for too long."""
    cdef uint8_t quantity = quantity_of(a.mode)
    cdef uint32_t limit = x.late_limit_position
    cdef uint32_t late = max(x.uncommitted, a.refused_cycles)
    if quantity == VELOCITY:
        limit = x.late_limit_velocity
    elif quantity == TORQUE:
        limit = x.late_limit_torque
        if x.handed_over > x.handover_limit:
            lose_axis(x, a, STOP_HANDOVER)
            return
    if limit > 0 and late >= limit:
        lose_axis(x, a, STOP_REFUSED if a.refused_cycles >= limit else STOP_UNDERRUN)


# ---- what is sent

cdef void rest(axes_t *x, axis_t *a, double torque, bint fresh) noexcept nogil:
    """Not powered: target := actual. A committed torque is sent before the brake opens."""
    a.commanded_position = a.position
    a.commanded_velocity = 0.0
    a.commanded_torque = 0.0
    a.command_velocity = 0.0
    if (fresh and a.state == SWITCHED_ON and a.goal == ENABLED and a.armed
            and quantity_of(a.mode) == TORQUE and isfinite(torque)):
        a.commanded_torque = limited_torque(a, torque)


cdef void stopping(axes_t *x, axis_t *a) noexcept nogil:
    """Powered, but to stop: decelerate; the last torque stays until the voltage is cut."""
    a.stop_cycles += 1
    fall_back(x, a, False)
    a.commanded_torque = limited_torque(a, a.commanded_torque)
    if stop_command(x, a) == DISABLE_VOLTAGE:
        a.commanded_torque = 0.0


cdef void refuse_mode(axes_t *x, axis_t *a) noexcept nogil:
    """Restore the mode in force: the drive does not show the requested one."""
    a.mode_refused = a.mode_wanted
    a.mode_wanted = a.mode
    a.waiting_cycles = 0
    a.flags |= MODE_REFUSED
    x.told |= DROPPED_SOME


cdef void wait_for_mode(axes_t *x, axis_t *a) noexcept nogil:
    """The drive shows another mode than the one requested: the mode in force hands over."""
    fall_back(x, a, False)
    if quantity_of(a.mode) != quantity_of(a.mode_wanted):
        prepare_mode(a, a.mode_wanted)
    if quantity_of(a.mode) == TORQUE:
        a.commanded_torque = limited_torque(a, a.commanded_torque)
        if not a.holding and a.waiting_cycles > x.handover_limit:
            lose_axis(x, a, STOP_MODE_CHANGE)
            return
    if a.waiting_cycles < x.mode_limit:
        return
    if a.holding or a.mode_wanted == a.mode:
        stop_axis(x, a, STOP_MODE_CHANGE)
    else:
        refuse_mode(x, a)


cdef void wait_for_bit_12(axes_t *x, axis_t *a) noexcept nogil:
    """Bit 12 was shown and is lost: the drive ignores its targets."""
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
    """Powered and to be enabled, but not followed (yet)."""
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


cdef void guard_setpoints(axes_t *x, axis_t *a, const target_t *t, uint32_t i,
                          bint fresh) noexcept nogil:
    """Compute what is sent to the axis in this cycle: commanded_*."""
    cdef uint8_t quantity = quantity_of(a.mode)
    a.flags &= DROPPED | MODE_REFUSED
    if a.state != OPERATION_ENABLED:
        rest(x, a, t.torque[i], fresh)
        return
    if quantity != POSITION:
        a.commanded_position = a.position
    if quantity != VELOCITY:
        a.commanded_velocity = 0.0
    if quantity != TORQUE:
        a.commanded_torque = 0.0
    if a.followed:
        follow(x, a, t, i, fresh)
        if a.followed:
            judge_lateness(x, a)
    elif a.goal != ENABLED:
        stopping(x, a)
    else:
        waiting(x, a, t, i, fresh)
