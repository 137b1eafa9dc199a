# cython: boundscheck=False, wraparound=False, cdivision=True
"""Jogs: motions of single axes that an operator in another process requests (native/motion.h).

Theory of operation. Once per cycle, before the outputs, `jog_take_requests` takes new requested
states and new presses, and answers them. After the stop requests, `jog_judge` extends each jog by
its heartbeat, and begins its ramp if it was released or its deadline is over. `jog_setpoint`
generates the command of one axis. The three run in every execution mode, during a hand-over, and
while a law runs. A stalled application therefore changes nothing.

A press is accepted only for an axis that follows the application, at rest, in CSP, CSV or PV, and
with a fresh token. While `jogged`, the axis ignores the application. Two states: MOVING approaches
the requested velocity, STOPPING decelerates to 0. Each other status ends the jog. A press that finds
the axis jogged ends that jog and is refused. At rest, the axis returns to the application as if it
had just become followed: only targets count that the application has computed from then on. An
axis that is stopped, disabled or no longer followed ends its jog; its fallback continues from the
velocity of the jog (_guard.pyx, _setpoints.pyx).

The velocity changes by at most acceleration or deceleration times the period. `braking_velocity`
limits it so that the command ends exactly at the distance, and within the position limits. In CSV
and PV the distance is that of the commanded velocity, and the limits hold for the actual position.

A press with a sweep follows a sine of increasing or decreasing frequency (_sweep.pxd). It ends with
DONE after its duration. A position limit that would reduce its velocity ends it.

Budget: 10 ns per axis without a jog, 60 ns with one, 90 ns with a sweep.
"""

from libc.math cimport INFINITY, ceil, copysign, fabs, fmax, fmin, isfinite, isnan, sqrt
from libc.stdint cimport int64_t, uint8_t, uint32_t, uint64_t
from libc.string cimport memcpy

from catenary.core._axes cimport LIMITED, axes_t, axis_t
from catenary.core._cia402 cimport ENABLED, FAULT, FAULT_REACTION_ACTIVE, QUICK_STOP, RESET
from catenary.core._guard cimport (
    CSP,
    CSV,
    PROFILE_VELOCITY,
    STOP_OPERATOR,
    TORQUE,
    VELOCITY,
    apply_state,
    begin_setpoints,
    guard_works,
    quantity_of,
    stop_axis,
)
from catenary.core._handover cimport target_t
from catenary.core._limits cimport approach, within_limits
from catenary.core._motion cimport jog_t, motion_begin, motion_extends, motion_t
from catenary.core._native cimport (
    CAT_MOTION_STATUS_BITS,
    cat_fence,
    cat_load_acquire64,
    cat_load_relaxed64,
    cat_motion_slot,
    cat_store_release64,
)
from catenary.core._sweep cimport sweep_begin, sweep_is_over, sweep_is_valid, sweep_velocity

cdef double ARRIVED = 1e-12        # [rad] a shorter distance is none
cdef double LEAST_RATE = 1e-6      # [rad/s²] a smaller acceleration is refused

cdef struct press_t:               # copy of the parameters of a press
    uint64_t press
    uint64_t heartbeat
    double velocity
    double distance
    double acceleration
    double sweep_start
    double sweep_end
    double sweep_duration


# ---- requested states

cdef uint8_t state_refusal(const axes_t *x, const axis_t *a, uint8_t state, bint hold) noexcept nogil:
    """Return the status with which a requested state is answered. `hold`: in a hand-over, because
    the program starts, ends or waits."""
    if state > RESET:
        return REFUSED_INVALID
    if (state == ENABLED or state == RESET) and not x.motion.allowed:
        return REFUSED_NOT_ALLOWED
    if state == ENABLED and quantity_of(a.mode_wanted) == TORQUE:
        return REFUSED_MODE  # only the application knows the torque that holds the load
    if state == ENABLED and hold:
        return REFUSED_HANDOVER
    if a.lost:
        return REFUSED_LOST
    return TAKEN


cdef void put_in_force(axes_t *x, axis_t *a, uint8_t state) noexcept nogil:
    """Put a requested state of an operator in force, unless it changes nothing."""
    if state == QUICK_STOP:
        if a.requested_state == ENABLED:
            stop_axis(x, a, STOP_OPERATOR)
    elif state == RESET:
        if a.state == FAULT or a.state == FAULT_REACTION_ACTIVE:
            apply_state(x, a, RESET)
    elif state != ENABLED or a.requested_state != ENABLED:
        apply_state(x, a, state)
        a.armed = state == ENABLED  # it starts with velocity 0


cdef void take_state(axes_t *x, axis_t *a, cat_motion_slot *slot, uint64_t request,
                     bint hold) noexcept nogil:
    """Take a newly requested state of an operator, and answer it."""
    cdef uint8_t state = <uint8_t>(request & 0xFF)
    cdef uint8_t status = state_refusal(x, a, state, hold)
    if status == TAKEN:
        put_in_force(x, a, state)
    cat_store_release64(&slot.taken, (request & ~<uint64_t>0xFF) | status)


# ---- presses

cdef inline double real_of(const double *word) noexcept nogil:
    cdef uint64_t bits = cat_load_relaxed64(<const uint64_t *>word)
    cdef double value
    memcpy(&value, &bits, sizeof(value))
    return value


cdef bint copy_press(const cat_motion_slot *slot, press_t *p) noexcept nogil:
    """Copy the parameters of a press. Return False while a client writes those of the next one."""
    p.press = cat_load_acquire64(&slot.press)
    if cat_load_acquire64(&slot.begun) != p.press:
        return False
    p.velocity = real_of(&slot.velocity)
    p.distance = real_of(&slot.distance)
    p.acceleration = real_of(&slot.acceleration)
    p.sweep_start = real_of(&slot.sweep_start)
    p.sweep_end = real_of(&slot.sweep_end)
    p.sweep_duration = real_of(&slot.sweep_duration)
    p.heartbeat = cat_load_relaxed64(&slot.heartbeat)
    cat_fence()
    return cat_load_acquire64(&slot.begun) == p.press and cat_load_acquire64(&slot.press) == p.press


cdef inline bint is_valid(const press_t *p, double period) noexcept nogil:
    if not isfinite(p.velocity) or p.velocity == 0.0:
        return False
    if p.sweep_duration != 0.0 and not (
            isnan(p.distance)
            and sweep_is_valid(p.sweep_start, p.sweep_end, p.sweep_duration, period)):
        return False
    if not isnan(p.distance) and not (p.distance > 0.0 and isfinite(p.distance)):
        return False
    return isnan(p.acceleration) or (p.acceleration >= LEAST_RATE and isfinite(p.acceleration))


cdef inline bint is_commanded_to_move(const axis_t *a, const target_t *t) noexcept nogil:
    """Return True if the application or a stream moves the axis."""
    if t.header.streamed:
        return True
    if a.mode == CSP:
        return not fabs(a.command_velocity) <= a.standstill
    if a.velocity_offset.present and not fabs(a.offset_sent) <= a.standstill:
        return True
    return not fabs(a.commanded_velocity) <= a.standstill


cdef uint8_t press_refusal(const axes_t *x, const axis_t *a, const press_t *p, const target_t *t,
                           int64_t now, int64_t *deadline) noexcept nogil:
    """Return MOVING and set the deadline, or the status with which a press is refused."""
    if not x.motion.allowed:
        return REFUSED_NOT_ALLOWED
    if not is_valid(p, x.period):
        return REFUSED_INVALID
    if not guard_works(a):
        return REFUSED_NOT_ENABLED
    if a.mode_wanted != a.mode or not (a.mode == CSP or a.mode == CSV or a.mode == PROFILE_VELOCITY):
        return REFUSED_MODE
    if a.jogged or is_commanded_to_move(a, t):
        return REFUSED_MOVING
    if not motion_extends(&x.motion, p.heartbeat, p.press, now, deadline):
        return REFUSED_STALE
    return MOVING


cdef bint set_rates(const axis_t *a, jog_t *j, const press_t *p) noexcept nogil:
    """Set the rates of a jog within those of the axis. Return False if none is finite."""
    j.acceleration = a.acceleration if isnan(p.acceleration) else fmin(p.acceleration, a.acceleration)
    if not isfinite(j.acceleration):
        j.acceleration = a.deceleration
    j.deceleration = a.deceleration if isfinite(a.deceleration) else j.acceleration
    return isfinite(j.acceleration)


cdef void set_sweep(jog_t *j, const press_t *p, double period) noexcept nogil:
    """Begin the sweep of a press, if it has one. It uses the smaller rate in both directions."""
    j.sweep.duration = 0.0
    if p.sweep_duration != 0.0:
        j.acceleration = fmin(j.acceleration, j.deceleration)
        sweep_begin(&j.sweep, p.sweep_start, p.sweep_end, p.sweep_duration, j.acceleration, period)


cdef inline void answer(cat_motion_slot *slot, jog_t *j, uint8_t status) noexcept nogil:
    j.status = status
    cat_store_release64(&slot.answer, (j.press << CAT_MOTION_STATUS_BITS) | status)


cdef void begin_ramp(cat_motion_slot *slot, jog_t *j, uint8_t ending) noexcept nogil:
    """Let a jog decelerate; at rest, `ending` is its status. A jog of an older press is not answered."""
    j.ending = ending
    if ending == REPLACED:
        j.status = STOPPING
    elif j.status == MOVING:
        answer(slot, j, STOPPING)


cdef void take_press(axes_t *x, axis_t *a, uint32_t i, const target_t *t, int64_t now) noexcept nogil:
    """Take a new press and answer it. The present jog of the axis ends."""
    cdef cat_motion_slot *slot = &x.motion.slots[i]
    cdef jog_t *j = &x.motion.jogs[i]
    cdef press_t p
    cdef int64_t deadline = 0
    cdef uint8_t status
    if not copy_press(slot, &p):
        return  # complete in a later cycle
    status = press_refusal(x, a, &p, t, now, &deadline)
    j.press = p.press
    if a.jogged:
        begin_ramp(slot, j, REPLACED)
    elif status == MOVING and not set_rates(a, j, &p):
        status = REFUSED_INVALID
    if status == MOVING:
        j.heartbeat = p.heartbeat
        j.deadline = deadline
        j.velocity = fmin(fmax(p.velocity, -a.velocity_limit), a.velocity_limit)
        j.remaining = INFINITY if isnan(p.distance) else p.distance
        j.speed = a.command_velocity if a.mode == CSP else a.commanded_velocity
        set_sweep(j, &p, x.period)
        a.jogged = 1
        answer(slot, j, MOVING)
        return
    cat_store_release64(&slot.answer, (p.press << CAT_MOTION_STATUS_BITS) | status)


cdef void jog_take_requests(axes_t *x, const target_t *t) noexcept nogil:
    """Issue a token if it is time, then take new requested states and presses of all axes."""
    cdef motion_t *m = &x.motion
    cdef cat_motion_slot *slot
    cdef uint64_t request
    cdef uint32_t i
    motion_begin(m, x.link.now(x.link.self))
    for i in range(x.axis_count):
        slot = &m.slots[i]
        request = cat_load_acquire64(&slot.request)
        if request != m.jogs[i].request:
            m.jogs[i].request = request
            take_state(x, &x.axes[i], slot, request, t.header.hold)
        if cat_load_acquire64(&slot.press) != m.jogs[i].press:
            take_press(x, &x.axes[i], i, t, m.now)


# ---- the dead-man

cdef void extend(const motion_t *m, jog_t *j, uint64_t heartbeat) noexcept nogil:
    """Extend the deadline of a jog if the heartbeat echoes a fresh token."""
    cdef int64_t deadline = 0
    j.heartbeat = heartbeat
    if motion_extends(m, heartbeat, j.press, m.now, &deadline) and deadline > j.deadline:
        j.deadline = deadline


cdef void jog_judge(axes_t *x) noexcept nogil:
    """Extend, release or expire each jog. End the jogs of axes that do not work any more."""
    cdef motion_t *m = &x.motion
    cdef cat_motion_slot *slot
    cdef axis_t *a
    cdef jog_t *j
    cdef uint64_t heartbeat
    cdef uint32_t i
    for i in range(x.axis_count):
        a = &x.axes[i]
        if not a.jogged:
            continue
        j = &m.jogs[i]
        slot = &m.slots[i]
        if not guard_works(a):
            end_jog(a, slot, j, ENDED_STOPPED)
        elif j.status == MOVING:
            heartbeat = cat_load_acquire64(&slot.heartbeat)
            if heartbeat != j.heartbeat:
                extend(m, j, heartbeat)
            if cat_load_acquire64(&slot.released) == j.press:
                begin_ramp(slot, j, RELEASED)
            elif m.now > j.deadline:
                begin_ramp(slot, j, EXPIRED)


cdef void end_jog(axis_t *a, cat_motion_slot *slot, jog_t *j, uint8_t status) noexcept nogil:
    """End the jog of an axis. The answer to a later press stays."""
    cdef bint replaced = j.status == STOPPING and j.ending == REPLACED
    a.jogged = 0
    j.status = status
    if not replaced:
        answer(slot, j, status)


# ---- generator

cdef double braking_velocity(double room, double deceleration, double period) noexcept nogil:
    """Return the largest velocity from which a motion in cycles ends exactly after `room`.

    The velocity falls by deceleration · period per cycle. The braking lasts n cycles with
    room = n·v·T - a·T²·n·(n - 1)/2, and n is the smallest number for which v <= n·a·T.
    """
    cdef double step = deceleration * period
    cdef double cycles
    if not room > ARRIVED:
        return 0.0
    if not isfinite(room):
        return INFINITY
    cycles = fmax(ceil(sqrt(0.25 + 2 * room / (step * period)) - 0.5), 1.0)
    return room / (cycles * period) + step * (cycles - 1) / 2


cdef inline double room_to_limit(const axis_t *a, double velocity) noexcept nogil:
    """Return the distance to the position limit ahead; infinite if there is none."""
    cdef double position = a.commanded_position if a.mode == CSP else a.position
    if velocity > 0:  # without a limit, the position may be unknown
        return a.position_max - position if a.position_max < INFINITY else INFINITY
    return position - a.position_min if a.position_min > -INFINITY else INFINITY


cdef double requested_speed(jog_t *j, double period) noexcept nogil:
    """Return the velocity of the jog in this cycle without its distance and limits [rad/s]."""
    if j.status != MOVING:
        return approach(j.speed, 0.0, j.deceleration * period)
    if j.sweep.duration > 0.0:
        return approach(j.speed, sweep_velocity(&j.sweep, j.velocity, period), j.acceleration * period)
    return approach(j.speed, j.velocity, j.acceleration * period)


cdef double next_speed(axes_t *x, axis_t *a, cat_motion_slot *slot, jog_t *j) noexcept nogil:
    """Return the velocity of the jog in this cycle [rad/s]. End a sweep at a position limit."""
    cdef double velocity = requested_speed(j, x.period)
    cdef double room, limit
    if velocity == 0.0:
        return 0.0
    room = room_to_limit(a, velocity)
    limit = braking_velocity(room, j.deceleration, x.period)
    if limit < fabs(velocity):
        a.flags |= LIMITED
        if j.sweep.duration > 0.0 and j.status == MOVING:
            begin_ramp(slot, j, AT_LIMIT)
    if velocity * j.velocity > 0:
        limit = fmin(limit, braking_velocity(j.remaining, j.deceleration, x.period))
    velocity = copysign(fmin(fabs(velocity), limit), velocity)
    return velocity if isfinite(velocity) else 0.0


cdef uint8_t status_at_rest(const axis_t *a, const jog_t *j) noexcept nogil:
    """Return the status with which a jog at rest ends; MOVING if it continues."""
    if j.remaining <= ARRIVED:
        return DONE
    if j.status == STOPPING:
        return j.ending
    if j.sweep.duration > 0.0:
        return DONE if sweep_is_over(&j.sweep) else MOVING
    if not room_to_limit(a, j.velocity) > ARRIVED:
        return AT_LIMIT
    return MOVING


cdef void command_position(axes_t *x, axis_t *a, double velocity) noexcept nogil:
    """Command the next position. A stop continues from this velocity (fallback_velocity)."""
    cdef double held = a.commanded_position
    a.commanded_position = within_limits(a, held + velocity * x.period)
    a.command_velocity = (a.commanded_position - held) / x.period
    a.setpoint = a.ghost = a.commanded_position
    a.setpoint_velocity = a.previous_velocity = a.command_velocity


cdef void return_axis(axes_t *x, axis_t *a, const target_t *t) noexcept nogil:
    """Return an axis at rest to the application. It holds until a target is computed for it."""
    begin_setpoints(a)
    a.worked = 1
    a.accepted = 1             # the command returns to the set-points within the acceleration
    a.yielded = 1
    a.followed_since = max(x.number, t.header.seen + 1)


cdef void jog_setpoint(axes_t *x, axis_t *a, const target_t *t, uint32_t i) noexcept nogil:
    """Generate the command of a jogged axis in this cycle. At rest, end the jog if it is over."""
    cdef cat_motion_slot *slot = &x.motion.slots[i]
    cdef jog_t *j = &x.motion.jogs[i]
    cdef uint8_t status
    j.speed = next_speed(x, a, slot, j)
    j.remaining -= copysign(j.speed, j.speed * j.velocity) * x.period
    if a.mode == CSP:
        command_position(x, a, j.speed)
    else:
        a.commanded_velocity = j.speed
    a.accepted = 2
    a.returning = 0
    a.fallback_cycles = 0
    a.refused_cycles = 0
    a.late_cycles = 0
    if j.speed != 0.0:
        return
    status = status_at_rest(a, j)
    if status != MOVING:
        end_jog(a, slot, j, status)
        return_axis(x, a, t)
