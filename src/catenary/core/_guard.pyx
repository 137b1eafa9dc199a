# cython: boundscheck=False, wraparound=False, cdivision=True
"""Safety of one axis in one cycle: requests, the followed state, and stops.
docs/explanation/safety.md has the table of reactions and their scenarios; _setpoints.pyx computes
the outputs.

Theory of operation. `guard_observe` runs after the inputs of a cycle, the other functions before
its outputs. `requested_state` is the requested state in force. `mode` is the mode of operation in
force, `mode_wanted` the mode requested in 0x6060. The set-points of the application are valid only
while the axis is *followed*: requested state enabled, OPERATION_ENABLED, the mode shown is the one
in force, statusword bit 12 if the mode defines it, and its unit is not lost. `worked` is set once
the axis was followed since OPERATION_ENABLED or since a mode change; `shows_following` once its
drive has shown bit 12. `gap_cycles` counts the cycles since bit 12 was lost, `mute_cycles` those in
which it was never shown, and `climbing_cycles` those since the request.

A stop (`stop_axis`) needs a new request afterwards; `stop_reason` and `stop_cycle` keep its cause.
It sends quick stop, then disable operation, then disable voltage (`stop_command`, `stop_cycles`).
A SERCOS drive has no state for its ramp: a stop ends before a new request takes effect
(`is_switching_off`).
With `on_loss` csp_hold, an axis in CST without set-points is held in CSP instead (`holding`).

Budget: 10 ns per axis that works.
"""

from libc.math cimport isfinite
from libc.stdint cimport int8_t, uint8_t, uint16_t, uint32_t, uint64_t

from catenary.core._axes cimport DROPPED, MODE_REFUSED
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
    cia402_command,
)

from catenary.core._handover cimport DROPPED_SOME

cdef enum:
    FOLLOWS_COMMAND = 0x1000   # statusword bit 12 in CSP, CSV, CST
    BIT_12_GAP = 3             # exchanges without bit 12 that are bridged


# ---- stops and requests

cdef inline void begin_stop(axis_t *a) noexcept nogil:
    """Start the sequence of a stop. A repeated request or a second reason does not restart it."""
    a.stop_cycles = 0
    a.followed_at_stop = (a.shows_following and a.status & FOLLOWS_COMMAND != 0
                          and a.mode in (CSP, CSV, CST))  # in other modes the bit has another meaning


cdef void stop_axis(axes_t *x, axis_t *a, uint8_t reason) noexcept nogil:
    """Stop an axis for a reason; only a new request enables it again."""
    if a.requested_state != DISABLED:
        a.flags |= DROPPED
        x.cycle_flags |= DROPPED_SOME
        a.stop_reason = reason
        a.stop_cycle = x.number
    if a.requested_state == ENABLED:
        begin_stop(a)
    a.requested_state = DISABLED
    a.stopping = 1
    a.armed = 0
    a.followed = 0
    a.holding = 0


cdef void lose_axis(axes_t *x, axis_t *a, uint8_t reason) noexcept nogil:
    """Stop an axis without set-points, according to its option `on_loss`."""
    if a.on_loss != LOSS_CSP_HOLD or a.mode != CST or a.requested_state != ENABLED or a.holding:
        stop_axis(x, a, reason)
        return
    a.flags |= DROPPED
    x.cycle_flags |= DROPPED_SOME
    a.stop_reason = reason
    a.stop_cycle = x.number
    a.holding = 1              # a new request ends it
    a.followed = 0
    a.waiting_cycles = 0
    a.mode_wanted = CSP


cdef inline bint enters_without_torque(const axis_t *a, int8_t mode) noexcept nogil:
    """Return True if a powered axis would enter torque control with an unknown load."""
    return (a.state == OPERATION_ENABLED and quantity_of(mode) == TORQUE
            and quantity_of(a.mode) != TORQUE
            and not a.torque_demand.present and not a.actual_torque.present)


cdef void take_mode(axes_t *x, axis_t *a, int8_t mode) noexcept nogil:
    """Process a requested mode. A powered axis keeps its mode until 0x6061 shows the new one."""
    if mode == a.mode_refused:
        return
    a.mode_refused = NO_MODE
    a.flags &= ~MODE_REFUSED
    if a.holding or mode == a.mode_wanted:
        return
    if a.sercos or enters_without_torque(a, mode):  # SERCOS: the mode is a parameter
        refuse_mode(x, a, mode)
        return
    a.mode_wanted = mode
    a.waiting_cycles = 0
    if a.state != OPERATION_ENABLED:
        a.mode = mode
    a.followed = 0


cdef void apply_state(axes_t *x, axis_t *a, uint8_t requested_state) noexcept nogil:
    """Put a newly requested state in force; a stop of the core ends."""
    if a.requested_state == ENABLED and requested_state != ENABLED:
        begin_stop(a)
    a.requested_state = requested_state
    # Only an edge resets: a request in every cycle must not keep bit 7 clear for ever.
    a.clear_reset = a.state == FAULT and a.command & FAULT_RESET != 0
    a.flags &= ~(DROPPED | MODE_REFUSED)
    a.stop_reason = STOP_NONE
    a.mode_refused = NO_MODE
    a.stopping = 0
    a.holding = 0
    a.armed = 0
    a.climbing_cycles = 0
    if a.requested_state != ENABLED:
        a.followed = 0
    if a.lost:
        stop_axis(x, a, STOP_DEVICE_LOST)  # the request must not take effect later


cdef void take_request(axes_t *x, axis_t *a, const target_t *t, uint32_t i) noexcept nogil:
    """Process a new request, and count how long a request to enable has been pending."""
    if t.request[i] != a.request:
        a.request = t.request[i]
        apply_state(x, a, t.requested_state[i] if t.requested_state[i] <= RESET else DISABLED)
    if a.requested_state == ENABLED and not a.followed and not a.holding:
        if not t.header.hold:
            if is_commanded(x, a.mode):
                a.armed = 1
            elif quantity_of(a.mode) == TORQUE:
                a.armed = 0  # this torque is not valid any more
        if a.armed or quantity_of(a.mode) == POSITION:
            a.climbing_cycles += 1
        if a.climbing_cycles > x.climbing_limit:
            stop_axis(x, a, STOP_NOT_ENABLED)


cdef void guard_take_orders(axes_t *x, axis_t *a, const target_t *t, uint32_t i) noexcept nogil:
    """Process the application's requests: mode of operation and state."""
    if t.mode[i] != a.mode_wanted or a.mode_refused != NO_MODE:
        take_mode(x, a, t.mode[i])
    take_request(x, a, t, i)


cdef void guard_stop(axes_t *x, uint8_t reason) noexcept nogil:
    """Stop every axis for a reason; each needs a new request afterwards.

    The stop of an operator is also the reason of an axis that is disabled already, so that the
    application does not enable it as if nothing had happened.
    """
    cdef axis_t *a
    cdef uint32_t i
    for i in range(x.axis_count):
        a = &x.axes[i]
        stop_axis(x, a, reason)
        if reason == STOP_OPERATOR:
            a.stop_reason = reason
            a.stop_cycle = x.number


cdef inline bint may_be_braking(const axis_t *a) noexcept nogil:
    """Return True if a drive that shows OPERATION_ENABLED may be braking, after a stop began.

    A drive that clears bit 12 is reacting. A lost device may return, still powered: its first frame
    must not remove the voltage. A SERCOS drive keeps its state while it brakes and while its brake
    closes. Before the stop, it may have cleared bit 12 already (delay after drive on, or a lost
    device). It may even show the bit: then the core decelerates the axis, except in CST.
    """
    cdef bint follows = a.status & FOLLOWS_COMMAND != 0
    if a.sercos and (not follows or quantity_of(a.mode) != TORQUE):
        return True
    return a.lost or (a.followed_at_stop and not follows)


cdef uint16_t stop_command(axes_t *x, axis_t *a) noexcept nogil:
    """Return the command for an axis in OPERATION_ENABLED that must stop.

    A drive that may be braking has time until the stop deadline.
    """
    cdef uint32_t patience = max(x.stop_patience, 4 * a.divider)
    cdef bint quick = a.requested_state == QUICK_STOP or (a.stopping and a.on_loss != LOSS_DISABLE)
    if quantity_of(a.mode) == TORQUE:
        patience = max(x.stop_patience_torque, 4 * a.divider)
    if may_be_braking(a):
        patience = max(patience, x.stop_limit)
    if a.stop_cycles <= patience:
        return QUICK_STOP_COMMAND if quick else DISABLE_OPERATION
    if a.stop_cycles <= patience + max(x.cut_patience, a.divider):
        return DISABLE_OPERATION
    return DISABLE_VOLTAGE


cdef inline bint may_lose_voltage(const axes_t *x, const axis_t *a) noexcept nogil:
    """Return True if a quick stop may end: at rest, or after the deadline.

    The deadline covers drives whose velocity is never below the standstill limit.
    """
    return a.still_cycles >= x.still_limit or a.stop_cycles > x.stop_limit


cdef uint16_t guard_lead(axes_t *x, axis_t *a, uint16_t bits) noexcept nogil:
    """Return the controlword that leads an axis to its requested state, or keeps it there."""
    cdef uint8_t requested_state = a.requested_state
    cdef uint16_t command
    if requested_state == ENABLED and not a.armed and quantity_of(a.mode) in (VELOCITY, TORQUE):
        # A brake must not open before a set-point holds the load.
        if not a.followed and a.state != OPERATION_ENABLED:
            requested_state = DISABLED
    if a.state == OPERATION_ENABLED and (requested_state != ENABLED or is_switching_off(a)):
        command = stop_command(x, a)
    else:
        if a.state == QUICK_STOP_ACTIVE and not may_lose_voltage(x, a):
            requested_state = QUICK_STOP  # every other exit disables, and the axis would coast
        command = cia402_command(a.state, requested_state, a.command)
    if a.clear_reset:
        command &= ~FAULT_RESET
        a.clear_reset = 0
    a.command = command
    if a.state == OPERATION_ENABLED and requested_state == ENABLED:
        command |= bits & MODE_BITS
    return command | (bits & FREE_BITS)


# ---- modes of operation

cdef inline double demanded_torque(const axis_t *a) noexcept nogil:
    """Return the torque that a powered drive applies now: 0x6074 if mapped, else the actual torque;
    0 if it is not finite.
    """
    cdef double torque = a.demand_torque if a.torque_demand.present else a.torque
    return torque if isfinite(torque) else 0.0


cdef void prepare_mode(axis_t *a, int8_t mode) noexcept nogil:
    """Set the target with which a powered axis enters another mode without a jump."""
    cdef uint8_t quantity = quantity_of(mode)
    if quantity == quantity_of(a.mode) and mode != CSP:
        return  # same quantity: keep the target, except for that of PP, which may be far away
    if quantity == POSITION:
        a.commanded_position = a.position
    elif quantity == VELOCITY:
        a.commanded_velocity = a.velocity if isfinite(a.velocity) else 0.0
    elif quantity == TORQUE:
        a.commanded_torque = demanded_torque(a)


cdef void prepare_other_mode(axis_t *a) noexcept nogil:
    """Set the target of a powered drive for a mode that is requested or shown, but not in force."""
    cdef int8_t other = a.mode_wanted if a.mode_wanted != a.mode else a.mode_shown
    if other != a.mode:
        prepare_mode(a, other)


cdef void begin_setpoints(axis_t *a) noexcept nogil:
    """Discard the previous set-points; the axis holds its command."""
    a.setpoint = a.commanded_position
    a.ghost = a.commanded_position
    a.setpoint_velocity = 0.0
    a.previous_velocity = 0.0
    a.setpoint_stamp = 0
    a.accepted = 0
    a.command_velocity = 0.0
    a.fallback_cycles = 0
    a.refused_cycles = 0
    a.late_cycles = 0
    a.beyond_cycles = 0
    a.waiting_cycles = 0
    a.returning = 0
    a.worked = 0
    a.yielded = 0
    a.gap_cycles = 0


cdef void enter_mode(axis_t *a) noexcept nogil:
    """Put the requested mode in force, because 0x6061 shows it."""
    prepare_mode(a, a.mode_wanted)
    a.mode = a.mode_wanted
    begin_setpoints(a)


cdef void refuse_mode(axes_t *x, axis_t *a, int8_t mode) noexcept nogil:
    """Restore the mode in force, because the requested mode is not shown or not allowed."""
    a.mode_refused = mode
    a.mode_wanted = a.mode
    a.waiting_cycles = 0
    a.flags |= MODE_REFUSED
    x.cycle_flags |= DROPPED_SOME


# ---- after the inputs

cdef bint is_mapped(const axis_t *a) noexcept nogil:
    """Return True if the target of the mode is mapped in the process data."""
    cdef uint8_t quantity = quantity_of(a.mode)
    if quantity == POSITION:
        return a.target_position.present
    if quantity == VELOCITY:
        return a.target_velocity.present
    return quantity != TORQUE or a.target_torque.present


cdef bint is_trusted(axes_t *x, axis_t *a) noexcept nogil:
    """Return True if the drive follows its targets, according to mode and bit 12.

    Call it once per cycle, because it counts the cycles without bit 12. An axis that is followed is
    stopped when its drive shows the bit for the first time.
    """
    if (a.requested_state != ENABLED or a.state != OPERATION_ENABLED or a.lost or a.holding
            or a.mode_wanted != a.mode or not is_mapped(a) or not shows_mode(a)
            or is_switching_off(a)):
        if a.mute_cycles < x.mute_limit:
            a.mute_cycles = 0
        return False
    if a.mode not in (CSP, CSV, CST):
        return True
    if a.status & FOLLOWS_COMMAND:
        if a.followed and not a.shows_following:
            stop_axis(x, a, STOP_NOT_FOLLOWING)  # it implements the bit, so it has not followed until now
        a.shows_following = 1
        a.gap_cycles = 0
        return a.requested_state == ENABLED
    if a.worked and a.shows_following:
        a.gap_cycles += 1
        return a.gap_cycles <= BIT_12_GAP * a.divider
    if a.mute_cycles < x.mute_limit:
        a.mute_cycles += 1
    return not a.shows_following and a.mute_cycles >= x.mute_limit


cdef void observe_requested_state(axes_t *x, axis_t *a, uint8_t state_before) noexcept nogil:
    """Adapt the requested state to state changes that the drive made by itself."""
    if a.requested_state == ENABLED:
        if a.state >= FAULT_REACTION_ACTIVE and state_before < FAULT_REACTION_ACTIVE:
            stop_axis(x, a, STOP_FAULT)
        elif (state_before == OPERATION_ENABLED and a.state != OPERATION_ENABLED
                and not is_drive_off(a)):
            stop_axis(x, a, STOP_LEFT_OPERATION)
    elif a.requested_state == QUICK_STOP:
        if a.state != OPERATION_ENABLED and a.state != QUICK_STOP_ACTIVE:
            a.requested_state = DISABLED
        elif a.state == QUICK_STOP_ACTIVE and may_lose_voltage(x, a):
            a.requested_state = DISABLED
    elif a.requested_state == RESET and a.state != FAULT:
        a.requested_state = DISABLED


cdef void guard_observe(axes_t *x, axis_t *a, uint8_t state_before,
                        uint64_t number) noexcept nogil:
    """Update requested state, mode in force and `followed` from the inputs of a cycle. Stop an axis
    that is lost, has a fault or has left OPERATION_ENABLED.
    """
    if a.invalid_in_row > 0:
        if a.invalid_in_row >= x.lost_limit and not a.lost:
            a.lost = 1
            stop_axis(x, a, STOP_DEVICE_LOST)
        return
    if a.lost:
        a.lost = 0
        begin_stop(a)
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
