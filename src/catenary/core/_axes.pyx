# cython: boundscheck=False, wraparound=False, cdivision=True
"""Axes, columns and areas: conversion of process images (bytes) from and to arrays in SI units.

Theory of operation. An axis is a slot of a CiA 402 drive, or a SERCOS drive whose two words are
translated (_sercos.pyx). The plan contains the position of each
quantity in the image; a quantity may be absent. `axes_read` runs after the inputs of a cycle. It
decodes the actual values and unwraps position counters of any width to 64 bits (`counts`,
`last_raw`); then _guard.pyx judges the axis. `axes_write` runs before the outputs: requests
(_guard.pyx), set-points (_setpoints.pyx), controlword, bytes. A set-point is written only if it
differs from the last one (`put_t`). Requests of other processes come between those of the
application and a stop (_jog.pyx). `axes_apply_late` applies late stop requests to outputs that a
law has computed. `axes_report` reports the axes after the frames. `cycle_flags` collects the flags
of the cycle, `handed_over` counts the cycles of a hand-over, and `stop_asked` counts stop requests
of any thread. Areas are bytes of an image that are copied without interpretation. _axes.pxd defines
every field of an axis.

Budget: 60 ns per axis and direction.
"""

from libc.math cimport INFINITY, NAN, isfinite
from libc.stdint cimport int8_t, int64_t, uint8_t, uint16_t, uint32_t, uint64_t
from libc.string cimport memcpy

from catenary.core._cia402 cimport (
    ENABLED,
    FAULT_REACTION_ACTIVE,
    OPERATION_ENABLED,
    QUICK_STOP_ACTIVE,
    RESET,
    cia402_state,
)
from catenary.core._guard cimport (
    CSP,
    CST,
    CSV,
    NO_MODE,
    STOP_OPERATOR,
    STOP_REQUEST,
    TORQUE,
    VELOCITY,
    guard_controlword,
    guard_observe,
    guard_orders,
    guard_stop,
    guard_take_orders,
    guard_works,
    quantity_of,
)
from catenary.core._handover cimport LIMITED_SOME, REFUSED_SOME
from catenary.core._jog cimport jog_judge, jog_take_requests
from catenary.core._memory cimport cat_memory, cat_memory_free, memory_take
from catenary.core._motion cimport jog_t, motion_stop_requested
from catenary.core._native cimport cat_load_acquire32
from catenary.core._numbers cimport REAL as REAL_KIND
from catenary.core._numbers cimport (
    make_number,
    number_bits,
    number_integer,
    number_put_bits,
    number_put_integer,
    number_put_value,
    number_put_wrapped,
    number_value,
)
from catenary.core._sercos cimport SYNCHRONISATION, sercos_control, sercos_status
from catenary.core._setpoints cimport axis_setpoints

AXIS_FOLLOWED = FOLLOWED
AXIS_LIMITED = LIMITED
AXIS_DROPPED = DROPPED
AXIS_REFUSED = REFUSED
AXIS_FALLBACK = FALLBACK
AXIS_MODE_REFUSED = MODE_REFUSED

STILL_NS = 5_000_000                   # at rest for this long: the axis has stopped
BEYOND_NS = 20_000_000                 # CSV, PV: time outside a limit, moving away, until the stop
CLIMBING_NS = 10_000_000_000           # a request to enable expires
MUTE_NS = 1_000_000_000                # missing bit 12; longer than a brake takes to open
KEEP_NS = 10_000_000                   # in an underrun, CSP keeps its velocity for this long
MODE_NS = 100_000_000                  # 0x6061 must show the requested mode within this time
GAP_NS = 10_000_000                    # bit 12 lost for this long: the axis is stopped
STOP_NS = 50_000_000                   # a quick stop must show an effect within this time
STOP_TORQUE_NS = 20_000_000            # the same in CST
CUT_NS = 20_000_000                    # disable operation must show an effect within this time
LATE_CYCLES = 3                        # minimum of a late limit
ON_LOSS = {"quick_stop": 0, "disable": 1, "csp_hold": 2}


# ---- inputs

cdef inline void read_position(axis_t *a, const uint8_t *inputs, double elapsed) noexcept nogil:
    """Decode the position, and estimate a velocity that is not mapped.

    `elapsed`: time since the last reading [s].
    """
    cdef number_t *n = &a.actual_position
    cdef uint64_t raw
    cdef double before = a.position
    if n.kind == REAL_KIND:
        a.position = number_value(n, inputs)
    else:
        raw = number_bits(n, inputs)
        if not a.known:
            a.counts = number_integer(n, inputs)
        else:  # the shorter direction
            a.counts += (<int64_t>((raw - a.last_raw) << n.right)) >> n.right
        a.last_raw = raw
        a.position = <double>a.counts * n.scale + n.offset
    if a.actual_velocity.present:
        return
    if not a.known:
        a.velocity = 0.0
    elif elapsed > 0:  # 0: second collect of a cycle, when a law starts in an inline loop
        a.velocity = (a.position - before) / elapsed


cdef inline double demand_error(axis_t *a, const uint8_t *inputs) noexcept nogil:
    """Return demanded minus actual position [rad]; integers wrap at the width of their types."""
    cdef uint64_t raw
    if a.position_demand.kind == REAL_KIND or a.actual_position.kind == REAL_KIND:
        return number_value(&a.position_demand, inputs) - a.position
    raw = <uint64_t>number_integer(&a.position_demand, inputs) - a.last_raw
    return <double>((<int64_t>(raw << a.position_demand.right)) >> a.position_demand.right) \
        * a.position_demand.scale


cdef inline void read_axis(axes_t *x, axis_t *a, const uint8_t *inputs,
                           int64_t instant) noexcept nogil:
    a.status = <uint16_t>number_bits(&a.statusword, inputs)
    if a.sercos:
        a.status = sercos_status(a.status)
    a.state = cia402_state(a.status)
    a.mode_shown = a.mode
    if a.mode_actual.present:
        a.mode_shown = <int8_t>number_integer(&a.mode_actual, inputs)
    if a.actual_velocity.present:
        a.velocity = number_value(&a.actual_velocity, inputs)
    if a.actual_position.present:
        read_position(a, inputs, (instant - a.read_at) * 1e-9)
    if a.actual_torque.present:
        a.torque = number_value(&a.actual_torque, inputs)
    if a.position_demand.present:
        a.demand_position = a.position + demand_error(a, inputs)
    if a.torque_demand.present:
        a.demand_torque = number_value(&a.torque_demand, inputs)
    a.known = 1
    a.read_at = instant
    if -a.standstill <= a.velocity <= a.standstill:
        if a.still_cycles < x.still_limit:
            a.still_cycles += 1
    else:
        a.still_cycles = 0


cdef void read_columns(const axes_t *x, actual_t *out) noexcept nogil:
    cdef const column_t *c
    cdef uint32_t k
    for k in range(x.input_count):
        c = &x.input_columns[k]
        if c.bank == BANK_REAL:
            out.input_reals[c.rank] = number_value(&c.number, x.image.inputs)
        elif c.bank == BANK_INTEGER:
            out.input_integers[c.rank] = number_integer(&c.number, x.image.inputs)
        else:
            out.input_bits[c.rank] = number_bits(&c.number, x.image.inputs) != 0


cdef inline void read_areas(const axes_t *x, actual_t *out) noexcept nogil:
    cdef const area_t *a
    cdef uint32_t k
    for k in range(x.input_area_count):
        a = &x.input_areas[k]
        memcpy(out.input_bytes + a.place, x.image.inputs + a.image_offset, a.size)


cdef void axes_read(axes_t *x, actual_t *out, uint64_t number, int64_t instant) noexcept nogil:
    """Decode the input image into the actual values of cycle `number`, after its collect.

    The state of each axis is updated, and a lost axis is stopped (`guard_observe`). `axes_report`
    adds the other values later. `instant`: cycle start of this cycle [ns].
    """
    cdef const uint8_t *inputs = x.image.inputs
    cdef axis_t *a
    cdef uint32_t i
    cdef uint8_t before
    x.number = number
    for i in range(x.axis_count):
        a = &x.axes[i]
        before = a.state
        if x.image.unit_fresh[a.unit]:
            read_axis(x, a, inputs, instant)
        a.invalid_in_row = x.image.unit_missed[a.unit]
        guard_observe(x, a, before, number)
        out.position[i] = a.position
        out.velocity[i] = a.velocity
        out.torque[i] = a.torque
        out.enabled[i] = follows_application(a)
    read_columns(x, out)
    read_areas(x, out)


cdef void axes_report(axes_t *x, actual_t *out) noexcept nogil:
    """Add the state of the axes and the last outputs to the values of `axes_read`; set `moving`."""
    cdef const axis_t *a
    cdef uint32_t i
    x.moving = 0
    for i in range(x.axis_count):
        a = &x.axes[i]
        if not a.lost and (a.state == OPERATION_ENABLED or a.state == QUICK_STOP_ACTIVE
                           or a.state == FAULT_REACTION_ACTIVE):
            x.moving += 1
        out.commanded_position[i] = a.commanded_position
        out.commanded_velocity[i] = a.commanded_velocity
        out.commanded_torque[i] = a.commanded_torque
        out.followed_since[i] = a.followed_since
        out.statusword[i] = a.status
        out.controlword[i] = a.controlword_sent
        out.mode[i] = a.mode_shown
        out.state[i] = a.state
        out.enabled[i] = follows_application(a)
        out.jogged[i] = a.followed and a.jogged
        out.stop_reason[i] = a.stop_reason
        out.stop_cycle[i] = a.stop_cycle
        out.flags[i] = a.flags | (FOLLOWED if follows_application(a) else 0) | (a.requested_state << REQUESTED_SHIFT)


# ---- outputs

cdef inline bint takes(put_t *put, double value) noexcept nogil:
    """Store a value; return True if it changed. Set-points of inactive modes rarely change."""
    if value == put.value:
        return False
    put.value = value
    return True


cdef inline void write_sercos(const axes_t *x, axis_t *a, uint8_t *outputs,
                              uint16_t controlword) noexcept nogil:
    """Write S-0-0134. Its synchronisation bit toggles with each exchange of the unit.

    After a fault the drive brakes with bit 14 set, at most until the stop deadline.
    """
    cdef bint reacts = a.state == FAULT_REACTION_ACTIVE and a.stop_cycles <= x.stop_limit
    cdef uint16_t word = sercos_control(controlword, reacts)
    if (x.number // a.divider) & 1:
        word |= SYNCHRONISATION
    a.controlword_sent = controlword
    number_put_bits(&a.controlword, outputs, word)


cdef inline void write_axis(const axes_t *x, axis_t *a, uint8_t *outputs,
                            uint16_t controlword) noexcept nogil:
    if a.sercos:
        write_sercos(x, a, outputs, controlword)
    elif controlword != a.controlword_sent or a.mode_wanted != a.mode_sent or not a.written:
        a.written = 1
        a.controlword_sent = controlword
        a.mode_sent = a.mode_wanted
        number_put_bits(&a.controlword, outputs, controlword)
        if a.mode_target.present:
            number_put_bits(&a.mode_target, outputs, <uint64_t><int64_t>a.mode_wanted)
    if a.target_position.present and a.known:
        if takes(&a.put_position, a.commanded_position):
            a.put_position.cut = number_put_wrapped(&a.target_position, outputs, a.commanded_position)
    if a.target_velocity.present and takes(&a.put_velocity, a.commanded_velocity):
        a.put_velocity.cut = number_put_value(&a.target_velocity, outputs, a.commanded_velocity)
    if a.target_torque.present and takes(&a.put_torque, a.commanded_torque):
        a.put_torque.cut = number_put_value(&a.target_torque, outputs, a.commanded_torque)
    if a.put_position.cut or a.put_velocity.cut or a.put_torque.cut:
        a.flags |= LIMITED


cdef inline void lead_axis(axes_t *x, axis_t *a, uint16_t bits) noexcept nogil:
    """Write the commanded set-points and the controlword that leads to the requested state."""
    write_axis(x, a, x.image.outputs, guard_controlword(x, a, bits))


cdef inline bint apply_stop(axes_t *x) noexcept nogil:
    """Stop all axes if the application or an operator has requested it since the last call.

    Return True if they were stopped.
    """
    cdef uint32_t asked = cat_load_acquire32(&x.stop_asked)
    cdef bint by_operator = motion_stop_requested(&x.motion)
    if asked == x.stop_seen and not by_operator:
        return False
    guard_stop(x, STOP_REQUEST if asked != x.stop_seen else STOP_OPERATOR)
    x.stop_seen = asked
    return True


cdef void write_columns(axes_t *x, const target_t *t) noexcept nogil:
    """Write the columns. A column that is not finite keeps its last value."""
    cdef const column_t *c
    cdef uint32_t k
    for k in range(x.output_count):
        c = &x.output_columns[k]
        if c.bank == BANK_REAL:
            if not isfinite(t.output_reals[c.rank]):
                x.cycle_flags |= REFUSED_SOME
            elif number_put_value(&c.number, x.image.outputs, t.output_reals[c.rank]):
                x.cycle_flags |= LIMITED_SOME
        elif c.bank == BANK_INTEGER:
            if number_put_integer(&c.number, x.image.outputs, t.output_integers[c.rank]):
                x.cycle_flags |= LIMITED_SOME
        else:
            number_put_bits(&c.number, x.image.outputs, t.output_bits[c.rank] != 0)


cdef inline void write_areas(axes_t *x, const target_t *t) noexcept nogil:
    cdef const area_t *a
    cdef uint32_t k
    for k in range(x.output_area_count):
        a = &x.output_areas[k]
        memcpy(x.image.outputs + a.image_offset, t.output_bytes + a.place, a.size)


cdef void write_velocity_offsets(axes_t *x) noexcept nogil:
    """Write 0x60B1 after the columns, for axes that do not follow their set-points.

    It is the velocity of the command in CSP, and 0 in other modes. An axis that follows its
    set-points keeps the value of the application.
    """
    cdef axis_t *a
    cdef uint32_t i
    for i in range(x.axis_count):
        a = &x.axes[i]
        if not a.velocity_offset.present:
            continue
        if follows_application(a) and not a.flags & FALLBACK:
            a.offset_sent = number_value(&a.velocity_offset, x.image.outputs)
            continue
        a.offset_sent = 0.0
        number_put_value(&a.velocity_offset, x.image.outputs,
                         a.command_velocity if a.mode == CSP else 0.0)


cdef inline bint update_counts(const target_t *t, uint64_t number, uint32_t timeout) noexcept nogil:
    """Return True if the last update of a background program is still valid in cycle `number`."""
    return t.header.updated > 0 and number <= t.header.updated + timeout


cdef void axes_write(axes_t *x, const target_t *target, bint fresh, uint64_t number) noexcept nogil:
    """Process the requests, then write the outputs of cycle `number`: valid targets and columns.

    `fresh`: the targets were committed since the last cycle.
    """
    cdef axis_t *a
    cdef uint32_t i
    x.number = number
    x.background = target.header.background and not target.header.streamed
    x.velocity_counts = update_counts(target, number, x.command_timeout_velocity)
    x.torque_counts = update_counts(target, number, x.command_timeout_torque)
    if target.header.hold:
        if x.handed_over == 0:
            x.handed_over_at = number
        x.handed_over += 1
        fresh = False
    elif fresh:
        x.handed_over = 0
    for i in range(x.axis_count):
        guard_orders(x, &x.axes[i], target, i)
    if x.motion.words != NULL:
        jog_take_requests(x, target)
    apply_stop(x)
    if x.motion.words != NULL:
        jog_judge(x)
    for i in range(x.axis_count):
        a = &x.axes[i]
        axis_setpoints(x, a, target, i, fresh)
        lead_axis(x, a, target.controlword_bits[i])
        if a.flags & LIMITED:
            x.cycle_flags |= LIMITED_SOME
        if a.flags & REFUSED:
            x.cycle_flags |= REFUSED_SOME
    write_columns(x, target)
    write_velocity_offsets(x)
    write_areas(x, target)


cdef void axes_hand_over(axes_t *x) noexcept nogil:
    """Prepare the axes for a new source of set-points, so that commands do not jump."""
    cdef uint32_t i
    for i in range(x.axis_count):
        x.axes[i].returning = x.axes[i].accepted > 0


cdef inline bint removes_power(const target_t *target, uint32_t i) noexcept nogil:
    return target.requested_state[i] != ENABLED and target.requested_state[i] != RESET


cdef bint axes_apply_late(axes_t *x, const target_t *target, bint fresh) noexcept nogil:
    """Apply late stop requests to outputs that a law has computed.

    Stop requests take effect at once. With fresh targets, so do requested states that remove power,
    and the control bits of axes that work. Requests that enable or reset an axis take effect at the
    next write, together with their set-points. Return True if the outputs may have changed.
    """
    cdef axis_t *a
    cdef uint32_t i
    if apply_stop(x):
        for i in range(x.axis_count):
            lead_axis(x, &x.axes[i], target.controlword_bits[i])
        return True
    if not fresh:
        return False
    for i in range(x.axis_count):
        a = &x.axes[i]
        if target.request[i] != a.request and removes_power(target, i):
            guard_take_orders(x, a, target, i)
            lead_axis(x, a, target.controlword_bits[i])
        elif guard_works(a):
            lead_axis(x, a, target.controlword_bits[i])
    return True


cdef inline void follow(target_t *target, uint32_t i, bint followed, uint64_t since,
                        double commanded_position, double commanded_velocity,
                        double commanded_torque) noexcept nogil:
    """Set the target of an axis that is not followed to the value that is sent to it.

    An axis that has become followed since the last commit starts from the commanded value, because
    earlier targets were not meant for it. Its torque stays, because the axis was enabled with it.
    """
    if not followed:
        target.position[i] = commanded_position
        target.velocity[i] = commanded_velocity
        target.torque[i] = commanded_torque
    elif since > target.header.seen:
        target.position[i] = commanded_position
        target.velocity[i] = commanded_velocity


cdef inline void follow_update(const axes_t *x, const actual_t *actual, target_t *target, uint32_t i,
                               double velocity, double torque) noexcept nogil:
    """Set the target as `follow` does, for a program in the background.

    Velocity and torque stay while the last update is valid, because it may enable the axis.
    Afterwards they are the commanded values, so that a later update of another axis does not revive
    them.
    """
    cdef uint64_t number = actual.header.number
    cdef uint8_t quantity = quantity_of(target.mode[i])
    if quantity == VELOCITY:
        if update_counts(target, number, x.command_timeout_velocity):
            target.velocity[i] = velocity
        else:
            target.velocity[i] = actual.commanded_velocity[i]
    elif quantity == TORQUE:
        if update_counts(target, number, x.command_timeout_torque):
            target.torque[i] = torque
        else:
            target.torque[i] = actual.commanded_torque[i]


cdef void axes_follow(const axes_t *x, const actual_t *actual, target_t *target) noexcept nogil:
    """Adapt the application's targets to its newest actual values."""
    cdef uint32_t i
    cdef double position, velocity, torque
    for i in range(x.axis_count):
        position, velocity, torque = actual.position[i], target.velocity[i], target.torque[i]
        if actual.state[i] == OPERATION_ENABLED:
            position = actual.commanded_position[i]
        follow(target, i, actual.flags[i] & FOLLOWED, actual.followed_since[i], position,
               actual.commanded_velocity[i], actual.commanded_torque[i])
        if target.header.background:
            follow_update(x, actual, target, i, velocity, torque)


cdef void axes_follow_now(const axes_t *x, target_t *target) noexcept nogil:
    """Adapt a law's targets to the present state of the axes."""
    cdef const axis_t *a
    cdef uint32_t i
    for i in range(x.axis_count):
        a = &x.axes[i]
        follow(target, i, follows_application(a), a.followed_since,
               a.commanded_position if a.state == OPERATION_ENABLED else a.position,
               a.commanded_velocity, a.commanded_torque)


# ---- Python interface

def finite_or(value, double absent, where, *, positive=True):
    """Return a limit, or `absent` if it is None. Raise ValueError if it is invalid."""
    if value is None:
        return absent
    if not isfinite(value) or (positive and value <= 0):
        raise ValueError(f"{where}: {value}, must be finite{' and positive' * positive}")
    return value


def cycles_of(duration_ns, period_ns, where):
    """Return the number of cycles that last at least `duration_ns`; 0 stays 0 (off)."""
    if not 0 <= duration_ns < 1 << 62:
        raise ValueError(f"{where}: {duration_ns} ns, must be 0 to 2^62")
    return min(-(-duration_ns // period_ns), 0x7FFFFFFF)


cdef class Axes:
    def __cinit__(self, plan):
        cdef cat_memory *memory = &self.memory
        inputs, outputs = len(plan.input_columns), len(plan.output_columns)
        self.c.axes = <axis_t *>memory_take(memory, len(plan.axes) + 1, sizeof(axis_t))
        self.c.motion.jogs = <jog_t *>memory_take(memory, len(plan.axes) + 1, sizeof(jog_t))
        self.c.input_columns = <column_t *>memory_take(memory, inputs + 1, sizeof(column_t))
        self.c.output_columns = <column_t *>memory_take(memory, outputs + 1, sizeof(column_t))
        self.c.input_areas = <area_t *>memory_take(memory, len(plan.input_areas) + 1, sizeof(area_t))
        self.c.output_areas = <area_t *>memory_take(memory, len(plan.output_areas) + 1, sizeof(area_t))
        if plan.lost_limit < 1:
            raise ValueError(f"lost_limit: {plan.lost_limit}, must be at least 1")
        self.c.period = plan.period_ns / 1e9
        self.c.lost_limit = min(plan.lost_limit, 0x7FFFFFFF)
        self.make_limits_in_time(plan)
        self.c.climbing_limit = cycles_of(CLIMBING_NS, plan.period_ns, "")
        self.c.mute_limit = max(cycles_of(MUTE_NS, plan.period_ns, ""), 1)
        self.c.still_limit = max(cycles_of(STILL_NS, plan.period_ns, ""), 3)
        self.c.beyond_limit = cycles_of(BEYOND_NS, plan.period_ns, "")
        for axis in plan.axes:
            self.make_axis(axis, plan)
            if axis.mode == CST and self.c.late_limit_torque == 0:
                raise ValueError(
                    "late_limit_torque_ns: must not be 0, which would keep a stale torque forever"
                )
        self.c.input_count = self.make_columns(plan.input_columns, plan.input_size, True)
        self.c.output_count = self.make_columns(plan.output_columns, plan.output_size, False)
        self.c.input_area_count = self.make_areas(plan.input_areas, plan.input_size, True)
        self.c.output_area_count = self.make_areas(plan.output_areas, plan.output_size, False)

    def make_limits_in_time(self, plan):
        def limit(name):
            cycles = cycles_of(getattr(plan, name), plan.period_ns, name)
            return max(cycles, LATE_CYCLES) if cycles else 0

        self.c.late_limit_position = limit("late_limit_position_ns")
        self.c.late_limit_velocity = limit("late_limit_velocity_ns")
        self.c.late_limit_torque = limit("late_limit_torque_ns")
        self.c.handover_limit = max(cycles_of(plan.handover_ns, plan.period_ns, "handover_ns"), 1)
        self.c.command_timeout_velocity = max(
            cycles_of(plan.command_timeout_velocity_ns, plan.period_ns, "command_timeout_velocity_ns"),
            LATE_CYCLES,
        )
        self.c.command_timeout_torque = max(
            cycles_of(plan.command_timeout_torque_ns, plan.period_ns, "command_timeout_torque_ns"),
            LATE_CYCLES,
        )
        self.c.keep_limit = max(cycles_of(KEEP_NS, plan.period_ns, ""), LATE_CYCLES)
        self.c.mode_limit = max(cycles_of(MODE_NS, plan.period_ns, ""), 4)
        self.c.gap_limit = cycles_of(GAP_NS, plan.period_ns, "")
        self.c.stop_patience = cycles_of(STOP_NS, plan.period_ns, "")
        self.c.stop_patience_torque = cycles_of(STOP_TORQUE_NS, plan.period_ns, "")
        self.c.cut_patience = max(cycles_of(CUT_NS, plan.period_ns, ""), 1)
        self.c.stop_limit = cycles_of(plan.stop_deadline_ns, plan.period_ns, "stop_deadline_ns")

    def make_axis(self, plan, cycle):
        name = f"axis {plan.name}"
        cdef axis_t *a = &self.c.axes[self.c.axis_count]
        if plan.controlword is None or plan.statusword is None:
            raise ValueError(f"{name}: controlword and statusword must be mapped")
        for where, number in (("controlword", plan.controlword), ("statusword", plan.statusword)):
            if number.bit_length != 16:
                raise ValueError(f"{name}: {where} has {number.bit_length} bits, must be 16")
        if plan.target_position is not None and plan.actual_position is None:
            raise ValueError(f"{name}: a position target without an actual position cannot be held")
        if not 0 <= plan.sync_unit < len(cycle.sync_units):
            raise ValueError(
                f"{name}: no sync unit {plan.sync_unit}, the plan has {len(cycle.sync_units)}"
            )
        divider = cycle.sync_units[plan.sync_unit].divider
        if not 1 <= divider <= 0x7FFFFFFF:
            raise ValueError(f"{name}: divider {divider} of its sync unit, must be at least 1")
        if not -128 <= plan.mode <= 127:
            raise ValueError(f"{name}: mode {plan.mode}, must be -128 to 127")
        self.check_profile(plan, name)
        a.sercos = plan.profile == "sercos"
        outputs, inputs = cycle.output_size, cycle.input_size
        make_number(&a.controlword, plan.controlword, outputs, f"{name} controlword")
        make_number(&a.statusword, plan.statusword, inputs, f"{name} statusword")
        make_number(&a.mode_target, plan.mode_target, outputs, f"{name} mode_target")
        make_number(&a.mode_actual, plan.mode_actual, inputs, f"{name} mode_actual")
        make_number(&a.target_position, plan.target_position, outputs, f"{name} target_position")
        make_number(&a.target_velocity, plan.target_velocity, outputs, f"{name} target_velocity")
        make_number(&a.target_torque, plan.target_torque, outputs, f"{name} target_torque")
        make_number(&a.actual_position, plan.actual_position, inputs, f"{name} actual_position")
        make_number(&a.actual_velocity, plan.actual_velocity, inputs, f"{name} actual_velocity")
        make_number(&a.actual_torque, plan.actual_torque, inputs, f"{name} actual_torque")
        make_number(&a.position_demand, plan.position_demand, inputs, f"{name} position_demand")
        make_number(&a.torque_demand, plan.torque_demand, inputs, f"{name} torque_demand")
        make_number(&a.velocity_offset, plan.velocity_offset, outputs, f"{name} velocity_offset")
        self.make_limits(plan, name)
        a.unit = plan.sync_unit
        a.divider = divider
        a.mode = a.mode_wanted = plan.mode
        a.mode_refused = NO_MODE
        a.mode_shown = 0
        a.position = a.velocity = a.torque = NAN
        a.put_position.value = a.put_velocity.value = a.put_torque.value = NAN
        self.c.axis_count += 1

    def check_profile(self, plan, name):
        if plan.profile not in ("cia402", "sercos"):
            raise ValueError(f"{name}: profile {plan.profile!r}, must be 'cia402' or 'sercos'")
        if plan.profile == "cia402":
            return
        if plan.mode not in (CSP, CSV, CST):
            raise ValueError(f"{name}: mode {plan.mode}, a SERCOS drive has 8, 9 or 10 (CSP, CSV, CST)")
        if plan.mode_target is not None or plan.mode_actual is not None:
            raise ValueError(f"{name}: a SERCOS drive has no modes 0x6060 and 0x6061")
        if plan.on_loss == "csp_hold":
            raise ValueError(f"{name}: on_loss 'csp_hold' needs a change of mode")

    def make_limits(self, plan, name):
        cdef axis_t *a = &self.c.axes[self.c.axis_count]
        limits = plan.limits
        a.position_min = finite_or(limits.position_min, -INFINITY, f"{name} position_min", positive=False)
        a.position_max = finite_or(limits.position_max, INFINITY, f"{name} position_max", positive=False)
        if a.position_min >= a.position_max:
            raise ValueError(
                f"{name}: position_min {a.position_min} is not below position_max {a.position_max}"
            )
        if plan.actual_position is None and (limits.position_min, limits.position_max) != (None, None):
            raise ValueError(f"{name}: position limits need an actual position")
        a.velocity_limit = finite_or(limits.velocity, INFINITY, f"{name} velocity limit")
        a.torque_limit = finite_or(limits.torque, INFINITY, f"{name} torque limit")
        a.step_limit = finite_or(limits.step, 0.0, f"{name} step limit")
        a.acceleration = finite_or(plan.acceleration, INFINITY, f"{name} acceleration")
        a.deceleration = finite_or(plan.deceleration, INFINITY, f"{name} deceleration")
        a.torque_slope = finite_or(plan.torque_slope, INFINITY, f"{name} torque_slope")
        a.step_floor = finite_or(plan.step_floor, 0.0, f"{name} step_floor")
        a.standstill = finite_or(plan.standstill, 0.0, f"{name} standstill")
        if plan.on_loss not in ON_LOSS:
            raise ValueError(f"{name} on_loss: {plan.on_loss!r}, must be one of {', '.join(ON_LOSS)}")
        a.on_loss = ON_LOSS[plan.on_loss]

    def make_columns(self, columns, image_size, bint inputs):
        cdef column_t *c = self.c.input_columns if inputs else self.c.output_columns
        ranks = [0, 0, 0]
        for k, column in enumerate(columns):
            if column.bank not in (BANK_REAL, BANK_INTEGER, BANK_BIT) or column.number is None:
                raise ValueError(
                    f"column {column.name}: bank {column.bank} is unknown, or no number is set"
                )
            if column.number.kind == REAL_KIND and column.bank != BANK_REAL:
                raise ValueError(f"column {column.name}: a real number belongs in the real bank")
            make_number(&c[k].number, column.number, image_size, f"column {column.name}")
            c[k].bank = column.bank
            c[k].rank = ranks[column.bank]
            ranks[column.bank] += 1
        return len(columns)

    def make_areas(self, areas, image_size, bint inputs):
        cdef area_t *a = self.c.input_areas if inputs else self.c.output_areas
        place = 0
        for k, area in enumerate(areas):
            if area.size < 0 or not 0 <= area.image_offset <= image_size - area.size:
                raise ValueError(
                    f"area {area.name}: bytes {area.image_offset} to"
                    f" {area.image_offset + area.size - 1} exceed the image of {image_size} bytes"
                )
            a[k].image_offset = area.image_offset
            a[k].place = place
            a[k].size = area.size
            place += area.size
        return len(areas)

    def __dealloc__(self):
        cat_memory_free(&self.memory)
