# cython: boundscheck=False, wraparound=False, cdivision=True
"""One cycle in both execution modes, and the cycle starts.

Theory of operation.

    threaded        wait, latch, compute outputs, send, collect until the deadline, publish
    threaded, law   wait, apply late stop requests, send, collect, law, compute outputs, publish
    inline          wait, collect (never blocks), [Python], compute outputs, send

`cycle_native` is one threaded cycle, with or without a law. An inline loop runs it in its caller's
thread while a law runs. A law computes after the frames of its cycle are back, for the next cycle
(`computed`). Like Python, it has one period from input to output, and its frames leave at the cycle
start. Its first step follows the collect of the cycle in which it was requested. Its last targets
are sent in the cycle after its last step. Requests of the application during a law apply one cycle
later, except for stops, requested states that remove power, and control bits (`axes_apply_late`).

In virtual time all modes run in the caller's thread. Cycle starts are origin + k·period. The
reference clock, or a rate that Python sets (`steering`), lengthens or shortens periods. A cycle
that begins late is sent if its frames can return before the next cycle start (`turnaround`). With a
law, they must return before the law's reserve begins. Otherwise the cycle is skipped and counted.
Cycles are never sent in bursts to catch up. Inline, a body that ends after the next cycle start
skips that cycle, because its frames cannot return in time. With clocks, frames that leave later
than the margin before SYNC0 are sent and counted (`missed_sync`). Another process can start the
cycles (_trigger.pyx). Its cycle start is then that of the cycle.

Phases, from → to:
    period          last wake-up → wake-up
    lateness        cycle start → wake-up
    receive         wake-up (inline) or last frame (threaded) → inputs usable
    process         begin → end of the application's body, or of the law's step
    send            wake-up (inline: end of the body) → last cyclic frame handed to the kernel
    in_controller   receive + process + send
    post_processing last cyclic frame handed to the kernel (threaded: publication) → next wait
    round_trip      last cyclic frame handed to the kernel → last frame received (threaded)
    output_delay    cycle start → last cyclic frame handed to the kernel
    input_age       frames handed to the kernel → law or body begins with their inputs
    interpreter     Python's thread awake → it has the interpreter (added by the engine)
Budget: 1 us for three drives, without the link.
"""

from libc.errno cimport EINTR
from libc.stdint cimport int32_t, int64_t, uint8_t, uint32_t, uint64_t
from libc.string cimport memcpy, memset

from catenary.core._axes cimport (
    axes_apply_late,
    axes_follow_now,
    axes_hand_over,
    axes_read,
    axes_report,
    axes_write,
)
from catenary.core._axis_log cimport axis_log_put
from catenary.core._clocks cimport clock_close
from catenary.core._copies cimport copies_write
from catenary.core._handover cimport (
    BEFORE_LAW,
    CLOCKS,
    DROPPED_SOME,
    DRY,
    LATE,
    LAW_DONE,
    LAW_FAILED,
    LIMITED_SOME,
    NONE,
    OF_LAW,
    OK,
    PRIVATE,
    REFUSED_SOME,
    STICKY,
    STOPPED,
    UNCOMMITTED,
    WORKING_COUNTER,
    actual_header_t,
    handover_latch,
    handover_publish,
    handover_wake,
)
from catenary.core._histogram cimport histogram_add
from catenary.core._acyclic_queue cimport acyclic_send
from catenary.core._law cimport (
    FINISHED,
    RUNNING,
    STOPPED_BY_APPLICATION,
    law_begin,
    law_end,
    law_monitor_park,
    law_run,
    law_t,
    law_report,
    law_took,
)
from catenary.core._native cimport (
    cat_add32,
    cat_load_acquire_pointer,
    cat_load_relaxed64,
    cat_or32,
    cat_pointer_claim,
    cat_pointer_is_offered,
    cat_pointer_release,
    cat_pointer_take,
    cat_trigger_send,
)
from catenary.core._stream cimport stream_t, stream_take
from catenary.core._trigger cimport trigger_await, trigger_seek

CYCLE_OK = OK
CYCLE_LATE = LATE
CYCLE_LIMITED = LIMITED_SOME
CYCLE_WORKING_COUNTER = WORKING_COUNTER
CYCLE_DROPPED = DROPPED_SOME
CYCLE_REFUSED = REFUSED_SOME
CYCLE_UNCOMMITTED = UNCOMMITTED
CYCLE_LAW_DONE = LAW_DONE
CYCLE_LAW_FAILED = LAW_FAILED
CYCLE_DRY = DRY
CYCLE_CLOCKS = CLOCKS
CYCLE_STOPPED = STOPPED
CYCLE_NONE = NONE

EXECUTION_MODES = {"threaded": THREADED, "inline": INLINE}
PHASE_NAMES = {
    "period": PERIOD,
    "lateness": LATENESS,
    "receive": RECEIVE,
    "process": PROCESS,
    "send": SEND,
    "post_processing": POST_PROCESSING,
    "round_trip": ROUND_TRIP,
    "in_controller": IN_CONTROLLER,
    "output_delay": OUTPUT_DELAY,
    "input_age": INPUT_AGE,
    "interpreter": INTERPRETER,
}
RECORD_FIELDS = [
    ("number", "<u8"),
    ("scheduled_ns", "<i8"),
    ("wake_ns", "<i8"),
    ("period_ns", "<i4"),
    ("lateness_ns", "<i4"),
    ("receive_ns", "<i4"),
    ("process_ns", "<i4"),
    ("send_ns", "<i4"),
    ("post_processing_ns", "<i4"),
    ("round_trip_ns", "<i4"),
    ("output_delay_ns", "<i4"),
    ("input_age_ns", "<i4"),
    ("flags", "<u4"),
    ("lost_in_row", "<u4"),
    ("skipped", "<u4"),
    ("missing_frames", "<u2"),
    ("al_counter", "<u2"),
    ("al_status", "u1"),
    ("reserved", "3u1"),
]


cdef inline int64_t now(const cycle_t *c) noexcept nogil:
    return c.link.now(c.link.self)


cdef inline record_t *record_of(cycle_t *c) noexcept nogil:
    return &c.records[c.number & c.records_mask]


cdef void clear_next_record(cycle_t *c) noexcept nogil:
    """Clear the record of the next cycle in advance, not at the start of that cycle."""
    cdef record_t *record = &c.records[(c.number + 1) & c.records_mask]
    memset(record, 0, sizeof(record_t))
    record.period_ns = -1
    record.receive_ns = -1
    record.process_ns = -1
    record.send_ns = -1
    record.post_processing_ns = -1
    record.round_trip_ns = -1
    record.output_delay_ns = -1
    record.input_age_ns = -1


cdef inline int32_t short_ns(int64_t value) noexcept nogil:
    return <int32_t>value if value < 0x7FFFFFFF else 0x7FFFFFFF


# ---- cycle starts

cdef bint skip_missed(cycle_t *c, int64_t present) noexcept nogil:
    """Skip the cycles whose frames cannot be collected before the following cycle start. Inline,
    also skip a cycle that starts before the last frames were sent. Return True if cycles were
    skipped and the next cycle start is in the future.
    """
    cdef int64_t late = present - c.next
    cdef int64_t reserve = c.law_reserve if c.law != NULL else 0
    cdef int64_t missed
    if late < 0:
        return False
    missed = late // c.period
    if not c.patient and late % c.period > 0 and (
        late % c.period + c.turnaround + reserve >= c.period
    ):
        missed += 1
    if not c.patient and c.outstanding and c.sent >= c.next + missed * c.period:
        missed += 1
    if missed == 0:
        return False
    c.next += missed * c.period
    c.skipped += <uint32_t>missed
    c.late += <uint64_t>missed
    return c.next > present


cdef int cycle_wait(cycle_t *c) noexcept nogil:
    """Wait for the next cycle start and begin its cycle. Return 0 or -errno; after -EINTR, call it
    again."""
    cdef int64_t present
    cdef int rc
    skip_missed(c, now(c))
    if c.trigger.awaits != NULL and not c.trigger.following:
        c.next += trigger_seek(&c.trigger, c.next, c.period, now(c))
    cycle_await_acyclic(c, c.next - c.busy_wait)
    rc = wait_for_trigger(c) if c.trigger.following else wait_for_time(c)
    if rc < 0:
        return rc
    present = now(c)
    if skip_missed(c, present):
        return -EINTR
    if c.trigger.awaits != NULL and not c.trigger.following:
        c.trigger.missed += 1
    begin(c, present)
    return 0


cdef int wait_for_time(cycle_t *c) noexcept nogil:
    """Wait until the next cycle start. Return 0 or -errno."""
    cdef int64_t present
    cdef int rc = c.link.wait_until(c.link.self, c.next - c.busy_wait, 0)
    if rc < 0:
        return rc
    present = now(c)
    if present < c.next - c.busy_wait:
        return -EINTR
    while present < c.next:  # at most busy_wait
        present = now(c)
    return 0


cdef int wait_for_trigger(cycle_t *c) noexcept nogil:
    """Wait until the sender begins its next cycle, whose start becomes the next cycle start. Return
    0, also after the deadline, or -errno."""
    cdef int64_t start, missed
    cdef int rc = 0
    if c.busy_wait > 0:
        rc = c.link.wait_until(c.link.self, c.next - c.busy_wait, 0)
    if rc >= 0:
        rc = trigger_await(&c.trigger, c.link, c.next, c.period, c.busy_wait, &start)
    if rc <= 0:
        return rc
    missed = (start - c.next + c.period // 2) // c.period
    c.skipped += <uint32_t>missed
    c.late += <uint64_t>missed
    c.next = start
    return 0


cdef void cycle_await_acyclic(cycle_t *c, int64_t until) noexcept nogil:
    """Receive acyclic frames as they arrive (threaded), so that the next request is sent in the
    next cycle. An inline loop receives them at the next cycle start.
    """
    if c.execution != THREADED:
        return
    while c.acyclic.under_way > 0 and now(c) < until:
        if c.link.wait_until(c.link.self, until, 1) <= 0:
            return
        c.image.drain(c.image.self)


cdef void begin(cycle_t *c, int64_t wake) noexcept nogil:
    """Begin a cycle. Only work that the frames need is done here; figures are computed later."""
    cdef record_t *record
    c.number += 1
    c.scheduled = c.next
    c.next += c.period
    record = record_of(c)
    record.number = c.number
    record.scheduled_ns = c.scheduled
    record.wake_ns = wake
    record.skipped = c.skipped
    record.lateness_ns = short_ns(wake - c.scheduled)
    c.interval = -1
    if c.begun > 0:
        c.interval = wake - c.wake
        record.period_ns = short_ns(c.interval)
    c.begun += 1
    c.wake = wake
    c.flags = LATE if c.skipped else 0
    c.process = -1
    c.input_age = -1
    c.skipped = 0


# ---- receive and send

cdef void collect(cycle_t *c, actual_t *actual, int64_t deadline) noexcept nogil:
    """Collect and decode the frames of a cycle, then update the next cycle start and the flags."""
    cdef int rc = c.image.collect(c.image.self, deadline)
    c.missing = rc if rc >= 0 else -1
    c.outstanding = 0
    axes_read(c.axes, actual, c.number, c.scheduled)
    follow_clock(c)
    follow_steering(c)
    judge(c)


cdef inline void follow_clock(cycle_t *c) noexcept nogil:
    """Adjust the next cycle start after the frames of a cycle, and set the flag of the clocks."""
    if c.clock != NULL:
        c.next += clock_close(c.clock)
        if c.clock.changes != c.clock.acknowledged:
            c.flags |= CLOCKS


cdef inline void follow_steering(cycle_t *c) noexcept nogil:
    """Adjust the next cycle start as Python requests, which follows an external clock. A reference
    clock that follows the MainDevice keeps its phase: its epoch moves by the same time.
    """
    cdef int64_t steering = <int64_t>cat_load_relaxed64(&c.steering)
    cdef int64_t shift
    if steering == 0:
        return
    c.steering_rest += steering
    shift = c.steering_rest >> STEERING_BITS
    c.steering_rest -= shift * STEERING_ONE
    c.next += shift
    if c.clock != NULL:
        c.clock.epoch -= shift


cdef inline void judge(cycle_t *c) noexcept nogil:
    """Update the flags and the loss counters from the collected frames."""
    if c.image.ok[0]:
        c.flags |= OK
        if c.image.whole[0]:
            c.lost_in_row = 0
    else:
        c.lost += 1
        c.lost_in_row += 1
        if c.lost_in_row >= c.lost_limit:
            c.flags |= WORKING_COUNTER


cdef void report(cycle_t *c, actual_t *actual, const target_t *target) noexcept nogil:
    """Write the results of the cycle: axes, header, log, sticky flags."""
    cdef actual_header_t *header = actual.header
    cdef record_t *record = record_of(c)
    cdef uint32_t unit
    axes_report(c.axes, actual)
    c.flags |= c.axes.cycle_flags
    c.axes.cycle_flags = 0
    header.ok = c.flags & OK
    header.number = c.number
    header.time_ns = c.scheduled - c.origin
    header.sent_ns = c.sent
    header.flags = c.flags
    header.lost_in_row = c.lost_in_row
    header.skipped = record.skipped
    header.moving = c.axes.moving
    header.missing_frames = <uint16_t>c.missing if c.missing >= 0 else 0xFFFF
    header.al_counter = c.image.al_counter[0]
    header.al_status = c.image.al_status[0]
    for unit in range(c.image.unit_count):
        actual.unit_valid[unit] = c.image.unit_valid[unit]
        actual.unit_counter[unit] = c.image.unit_counter[unit]
    record.flags = c.flags
    record.lost_in_row = c.lost_in_row
    record.missing_frames = header.missing_frames
    record.al_counter = header.al_counter
    record.al_status = header.al_status
    if c.axis_log.rows != NULL:
        axis_log_put(&c.axis_log, c.number, actual, target)
    if c.flags & STICKY:
        cat_or32(&c.handover.sticky, c.flags & STICKY)


cdef void send(cycle_t *c) noexcept nogil:
    """Send the output image. A frame that could not be sent is counted by the image and is missing
    at collect.
    """
    cdef record_t *record = record_of(c)
    if c.clock != NULL:
        c.clock.scheduled = c.scheduled
    c.image.emit(c.image.self)
    c.outstanding = 1
    c.sent = now(c)
    if c.clock != NULL and c.begun > 0 and c.sent - c.scheduled > c.sync_margin:
        c.missed_sync += 1
    record.output_delay_ns = short_ns(c.sent - c.scheduled)
    if c.trigger.sends != NULL:
        cat_trigger_send(c.trigger.sends, c.scheduled, c.period)


cdef inline void write_outputs(cycle_t *c, const target_t *target, bint fresh,
                               uint64_t number) noexcept nogil:
    """Write all outputs of cycle `number` into the image."""
    axes_write(c.axes, target, fresh, number)
    if c.copies != NULL:
        copies_write(c.copies)


cdef bint take_streamed(cycle_t *c, target_t *target, bint fresh, uint64_t number) noexcept nogil:
    """Take the next row of the stream for the outputs of cycle `number`. Return True for fresh
    set-points. Once a row was taken, an empty stream is an underrun. After the stream was removed,
    a hand-over begins.
    """
    cdef stream_t *stream
    if not cat_pointer_is_offered(&c.stream):
        if target.header.streamed and not fresh:
            target.header.hold = 1
        target.header.streamed = 0
        return fresh
    target.header.streamed = 0
    stream = <stream_t *>cat_pointer_claim(&c.stream)
    if stream != NULL and stream_take(stream, target):
        target.header.hold = 0
        target.header.streamed = 1
        target.header.stamp = number
        fresh = True
    elif stream != NULL and stream.taken > 0:
        target.header.hold = 0
        target.header.streamed = 1
        c.axes.cycle_flags |= DRY
        c.underruns += 1
        fresh = False
    cat_pointer_release(&c.stream)
    return fresh


cdef int64_t give(cycle_t *c, record_t *record, int64_t since, const actual_t *actual,
                  const target_t *target) noexcept nogil:
    """Pass the cycle to the sink; return the duration of the post-processing with the sink.

    The record that the sink receives contains the duration without the sink.
    """
    record.post_processing_ns = short_ns(now(c) - since)
    c.sink.put(c.sink.self, c.number, record, actual.header, target.header)
    return now(c) - since


cdef void post_process(cycle_t *c, int64_t since, const actual_t *actual,
                       const target_t *target) noexcept nogil:
    """Run the post-processing: acyclic frames, then the figures of the cycle, then the sink."""
    cdef record_t *record
    cdef histogram_t *h = <histogram_t *>cat_load_acquire_pointer(<void **>&c.histograms)
    cdef int64_t took
    acyclic_send(c.acyclic, c.link, since - c.scheduled)
    if c.number == 0:
        return
    record = record_of(c)
    histogram_add(&h[LATENESS], c.wake - c.scheduled)
    if c.interval >= 0:
        histogram_add(&h[PERIOD], c.interval)
    if record.receive_ns >= 0:
        histogram_add(&h[RECEIVE], record.receive_ns)
    if record.send_ns >= 0:
        histogram_add(&h[SEND], record.send_ns)
    if record.round_trip_ns >= 0:
        histogram_add(&h[ROUND_TRIP], record.round_trip_ns)
    if record.output_delay_ns >= 0:
        histogram_add(&h[OUTPUT_DELAY], record.output_delay_ns)
    if c.input_age >= 0:
        record.input_age_ns = short_ns(c.input_age)
        histogram_add(&h[INPUT_AGE], c.input_age)
    if c.process >= 0:
        record.process_ns = short_ns(c.process)
        histogram_add(&h[PROCESS], c.process)
        if record.receive_ns >= 0 and record.send_ns >= 0:
            histogram_add(&h[IN_CONTROLLER], c.process + record.receive_ns + record.send_ns)
    took = give(c, record, since, actual, target) if c.sink != NULL else now(c) - since
    record.post_processing_ns = short_ns(took)
    histogram_add(&h[POST_PROCESSING], took)
    clear_next_record(c)


# ---- laws

cdef int64_t cycle_law_reserve(const cycle_t *c, int64_t budget) noexcept nogil:
    """Return the part of the period reserved for a law and the post-processing [ns]. A `budget` of
    0 means the default, two fifths of the period.
    """
    return (budget if budget > 0 else c.period * 2 // 5) + c.period // 20


cdef void end_law(cycle_t *c, uint32_t status) noexcept nogil:
    """Begin the hand-over after a law: targets committed before it are no longer valid. A `status`
    of RUNNING means that the law has ended by itself; `compute_next` then prepares the axes.
    """
    if c.law == NULL:
        return
    c.handover.target[c.handover.target_triple.front].header.hold = 1
    c.handover.target[OF_LAW].header.hold = 1
    if status != RUNNING:
        axes_hand_over(c.axes)
        law_end(c.law, status, c.number)
    forget_law(c)


cdef void forget_law(cycle_t *c) noexcept nogil:
    """Release the law; afterwards the engine may free it."""
    c.law = NULL
    law_monitor_park(&c.monitor)
    cat_pointer_release(&c.law_request)


cdef void take_law(cycle_t *c, const target_t *orders) noexcept nogil:
    """End the running law and start the requested one, if any, from the commanded values."""
    cdef target_t *target = &c.handover.target[OF_LAW]
    cdef void *requested
    cdef uint32_t i
    end_law(c, STOPPED_BY_APPLICATION)  # first: a request that is taken replaces the claimed law
    if not cat_pointer_take(&c.law_request, &requested) or requested == NULL:
        return
    c.law = <law_t *>requested
    memcpy(target.header, orders.header, c.handover.target_size)
    for i in range(c.axes.axis_count):
        target.position[i] = c.axes.axes[i].commanded_position
        target.velocity[i] = c.axes.axes[i].commanded_velocity
        target.torque[i] = c.axes.axes[i].commanded_torque
    target.header.hold = 1
    target.header.background = 0
    target.header.seen = c.number
    c.law_reserve = cycle_law_reserve(c, c.law.budget)
    if not law_begin(c.law, &c.monitor, c.scheduled):
        forget_law(c)


cdef void take_orders(cycle_t *c, const target_t *committed) noexcept nogil:
    """Copy the application's requested states, modes and control bits, and the bytes of areas.

    A law cannot access these.
    """
    cdef target_t *target = &c.handover.target[OF_LAW]
    cdef uint32_t axes = c.handover.counts.axes
    memcpy(target.request, committed.request, axes * sizeof(uint32_t))
    memcpy(target.controlword_bits, committed.controlword_bits, axes * sizeof(uint16_t))
    memcpy(target.mode, committed.mode, axes)
    memcpy(target.requested_state, committed.requested_state, axes)
    memcpy(target.output_bytes, committed.output_bytes, c.handover.counts.output_bytes)


cdef bint step_law(cycle_t *c, actual_t *actual, target_t *target) noexcept nogil:
    """Run one step of the law; return True if its targets may be sent.

    If the law has failed, restore the targets and stop all axes.
    """
    cdef law_t *law = c.law
    cdef int64_t since = now(c)
    cdef bint goes_on
    c.input_age = since - c.sent
    axes_follow_now(c.axes, target)
    take_streamed(c, target, False, c.number + 1)
    target.header.hold = 0
    target.header.stamp = c.number + 1
    target.header.seen = c.number
    actual.header.ok = c.image.ok[0]
    memcpy(c.handover.target[BEFORE_LAW].header, target.header, c.handover.target_size)
    goes_on = law_run(law, &c.monitor, c.axes, actual, target, c.scheduled, c.number)
    c.process = now(c) - since
    if goes_on and law_took(law, c.process, c.number):
        return True
    if law.status == FINISHED:
        c.flags |= LAW_DONE
        end_law(c, RUNNING)
        target.header.hold = 0  # its last targets are sent
        return True
    c.flags |= LAW_FAILED
    memcpy(target.header, c.handover.target[BEFORE_LAW].header, c.handover.target_size)
    cat_add32(&c.axes.stop_asked, 1)
    end_law(c, RUNNING)
    return False


cdef void compute_next(cycle_t *c, actual_t *actual, target_t *target) noexcept nogil:
    """Run a law's part of a cycle: one step, and the outputs of the next cycle."""
    cdef bint fresh = step_law(c, actual, target)
    write_outputs(c, target, fresh, c.number + 1)
    if c.image.fill != NULL:
        c.image.fill(c.image.self)
    c.computed = 1
    if c.law != NULL:
        law_report(c.law)
    else:
        axes_hand_over(c.axes)


# ---- execution modes

cdef void cycle_start(cycle_t *c, int64_t origin) noexcept nogil:
    """Set the first cycle start: one period from now, or on the grid of `origin`. After a stop the
    old grid continues.
    """
    cdef int64_t present = now(c)
    if c.origin == 0:
        c.origin = origin if origin > 0 else present + c.period
    c.next = c.origin
    if present >= c.origin:
        c.next += ((present - c.origin) // c.period + 1) * c.period
    c.scheduled = c.next - c.period  # start for frames that leave before the first cycle
    c.skipped = 0
    c.usable = 0
    c.begun = 0
    c.computed = 0
    c.outstanding = 0
    c.kept = 0
    c.trigger.following = False
    c.monitor.guard.known = 0  # the cycle may run in another thread now
    clear_next_record(c)


cdef void write_committed(cycle_t *c, target_t *committed, bint fresh) noexcept nogil:
    """Write the outputs of a cycle without a law: the committed targets, or a row of the stream."""
    if fresh:
        c.process = committed.header.process_ns
        c.input_age = committed.header.input_age_ns
    fresh = take_streamed(c, committed, fresh, c.number)
    write_outputs(c, committed, fresh, c.number)
    if not fresh and not c.axes.handed_over:
        c.flags |= UNCOMMITTED
        if not committed.header.streamed:  # else an underrun
            c.uncommitted += 1


cdef void note_return(cycle_t *c) noexcept nogil:
    """Record how long the frames took, after a collect with a deadline."""
    cdef int64_t seen = c.image.frame_stamp[0]
    if c.missing == 0:
        record_of(c).round_trip_ns = short_ns(seen - c.sent)
        c.turnaround = min(seen - c.wake, c.period // 2)


cdef void cycle_native(cycle_t *c) noexcept nogil:
    """Run one threaded cycle after the wait."""
    cdef bint fresh
    cdef target_t *committed = handover_latch(c.handover, &fresh)
    cdef target_t *target = committed
    cdef actual_t *actual = &c.handover.actual[c.handover.actual_triple.back]
    cdef int64_t reserve = c.law_reserve if c.law != NULL and not c.patient else 0
    cdef int64_t published
    if c.outstanding:  # left by an inline cycle
        c.image.collect(c.image.self, 0)
        axes_read(c.axes, actual, c.number, c.scheduled)
    fresh = fresh or c.kept
    c.kept = 0
    if c.computed:
        target = &c.handover.target[OF_LAW]
        if fresh:
            take_orders(c, committed)
        if axes_apply_late(c.axes, target, fresh) and c.image.fill != NULL:
            c.image.fill(c.image.self)
        c.computed = 0
        c.kept = fresh and c.law == NULL  # set-points after the end of the law
    else:
        write_committed(c, committed, fresh)
    send(c)
    record_of(c).send_ns = short_ns(c.sent - c.wake)
    collect(c, actual, min(c.wake + c.collect_deadline, c.next - reserve))
    note_return(c)
    if cat_pointer_is_offered(&c.law_request):
        take_law(c, committed)
    if c.law != NULL:
        target = &c.handover.target[OF_LAW]
        record_of(c).receive_ns = short_ns(now(c) - c.image.frame_stamp[0])
        compute_next(c, actual, target)
    report(c, actual, target)
    handover_publish(c.handover)
    published = now(c)
    handover_wake(c.handover)
    if record_of(c).receive_ns < 0:
        record_of(c).receive_ns = short_ns(published - c.image.frame_stamp[0])
    post_process(c, published, actual, target)


cdef bint cycle_wants_native(cycle_t *c) noexcept nogil:
    """Return True if the next cycle of an inline loop runs a law or sends its last outputs."""
    if c.law != NULL or c.computed:
        return True
    return cat_pointer_is_offered(&c.law_request)


cdef void cycle_inputs(cycle_t *c, actual_t *actual) noexcept nogil:
    """Read the inputs of an inline cycle after the wait."""
    collect(c, actual, 0)
    report(c, actual, &c.handover.target[PRIVATE])


cdef void cycle_usable(cycle_t *c) noexcept nogil:
    """Record the time from which Python can use the inputs of an inline cycle."""
    c.usable = now(c)
    c.input_age = c.usable - c.sent
    record_of(c).receive_ns = short_ns(c.usable - c.wake)


cdef void cycle_outputs(cycle_t *c, target_t *target, bint application) noexcept nogil:
    """Send the outputs of an inline cycle after Python's body. With `application` False, the cycle
    is part of a hand-over.
    """
    cdef int64_t done = now(c)
    cdef actual_t *actual = &c.handover.actual[PRIVATE]
    target.header.seen = c.number
    target.header.stamp = c.number
    target.header.hold = not application
    write_outputs(c, target, take_streamed(c, target, True, c.number), c.number)
    send(c)
    if c.number > 0 and c.usable != 0:
        record_of(c).send_ns = short_ns(c.sent - done)
        c.turnaround = min(c.sent - c.wake + c.period // 10, c.period // 2)
        if application:
            c.process = done - c.usable
    if c.sink != NULL:
        axes_report(c.axes, actual)
    post_process(c, c.sent, actual, target)
