# cython: boundscheck=False, wraparound=False, cdivision=True
"""One cycle in its three orders, and the instants it keeps.

    threaded   wait, emit, collect by a deadline, publish               in the native thread
    inline     wait, collect, [Python], emit                            in Python's thread
    law        wait, collect, law, emit, publish                        in the native thread
      ahead    [lead: collect, law], wait, emit, publish                where all frames are back by then

A law may be asked for while another order runs: its cycles take the law's order until it ends.

In virtual time all three run in the caller's thread. Instants are origin + k·period: late ones are
skipped and counted, never made up for by a burst.

Phases. receive: wait returned → inputs usable (threaded: last frame seen → inputs published).
process: the application's body, ahead of the instant where its cycle is marked so. send: its end →
the last cyclic send returned (threaded and ahead: wake →). in_controller: their sum. tail: what
remains before the next wait. round_trip: sent → last frame seen (threaded only: the others look at
the next instant). Budget: 1 us for three drives, without the link.
"""

from libc.errno cimport EINTR
from libc.stdint cimport int32_t, int64_t, uint8_t, uint32_t, uint64_t
from libc.string cimport memcpy, memset

from catenary.core._axes cimport (
    axes_follow_now,
    axes_hand_over,
    axes_hear,
    axes_read,
    axes_rehearse,
    axes_tell,
    axes_write,
)
from catenary.core._clocks cimport clock_close
from catenary.core._handover cimport (
    BEFORE_LAW,
    OF_LAW,
    PRIVATE,
    actual_header_t,
    handover_latch,
    handover_publish,
    handover_wake,
)
from catenary.core._histogram cimport histogram_add
from catenary.core._lane cimport lane_send
from catenary.core._law cimport (
    FINISHED,
    RUNNING,
    STOPPED_BY_APPLICATION,
    law_begin,
    law_end,
    law_rehearse,
    law_run,
    law_t,
    law_tell,
    law_took,
)
from catenary.core._native cimport cat_add32, cat_load_acquire32
from catenary.core._stream cimport stream_t, stream_take

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
CYCLE_AHEAD = AHEAD
CYCLE_STOPPED = STOPPED
CYCLE_NONE = NONE

ORDERS = {"threaded": THREADED, "inline": INLINE, "law": LAW}
PHASE_NAMES = {
    "period": PERIOD,
    "lateness": LATENESS,
    "receive": RECEIVE,
    "process": PROCESS,
    "send": SEND,
    "tail": TAIL,
    "round_trip": ROUND_TRIP,
    "in_controller": IN_CONTROLLER,
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
    ("tail_ns", "<i4"),
    ("round_trip_ns", "<i4"),
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


cdef inline record_t *next_record(cycle_t *c) noexcept nogil:
    return &c.records[(c.number + 1) & c.records_mask]


cdef void clear_next_record(cycle_t *c) noexcept nogil:
    """Behind a cycle, and not at the head of the next one."""
    cdef record_t *record = next_record(c)
    memset(record, 0, sizeof(record_t))
    record.period_ns = -1
    record.receive_ns = -1
    record.process_ns = -1
    record.send_ns = -1
    record.tail_ns = -1
    record.round_trip_ns = -1


cdef inline int32_t short_ns(int64_t value) noexcept nogil:
    return <int32_t>value if value < 0x7FFFFFFF else 0x7FFFFFFF


# ---- instants

cdef inline void skip(cycle_t *c, int64_t instants) noexcept nogil:
    c.next += instants * c.period
    c.skipped += <uint32_t>instants
    c.late += <uint64_t>instants


cdef int cycle_wait(cycle_t *c) noexcept nogil:
    """Waits for the next instant and opens its cycle. 0; -EINTR: call again; or -errno."""
    cdef int rc = cycle_sleep(c, 0)
    if rc == 0:
        cycle_open(c)
    return rc


cdef int cycle_sleep(cycle_t *c, int64_t lead) noexcept nogil:
    """Sleeps until `lead` before the next instant. 0; -EINTR: call again; or -errno."""
    cdef int64_t present = now(c)
    cdef int rc
    if present > c.next and (not c.patient or present - c.next >= c.period):
        skip(c, (present - c.next + c.period - 1) // c.period)
    cycle_await_lane(c, c.next - lead)
    rc = c.link.wait_until(c.link.self, c.next - lead, 0)
    if rc < 0:
        return rc
    return 0 if now(c) >= c.next - lead else -EINTR


cdef void cycle_await_lane(cycle_t *c, int64_t until) noexcept nogil:
    """threaded: takes acyclic frames when they come, so that the next question goes out with the
    next cycle and not the one after. The other orders collect them at the next instant, before
    the next frames are sent."""
    if c.order != THREADED or c.law != NULL:
        return
    while c.lane.under_way > 0 and now(c) < until:
        if c.link.wait_until(c.link.self, until, 1) <= 0:
            return
        c.image.drain(c.image.self)


cdef inline void take_early(cycle_t *c, actual_t *actual) noexcept nogil:
    """The inputs of the cycle that is to come, if all of its frames are back."""
    if c.taken or c.image.collect(c.image.self, 0) != 0:
        return
    c.missing = 0
    axes_read(c.axes, actual, c.number + 1, c.next)
    c.taken = 1


cdef void cycle_prepare(cycle_t *c) noexcept nogil:
    """In the lead: takes the inputs that have come back. Where all are there a law computes now, and
    at the instant only the frames are left to go; a long one is late, but less than if it began
    there. Else, and for Python, the way of the cycle is gone once without effect, so that all of it
    is in the caches."""
    cdef actual_t *actual = &c.handover.actual[PRIVATE]
    cdef int64_t left
    if c.law != NULL:
        actual = &c.handover.actual[c.handover.actual_triple.back]
    take_early(c, actual)
    left = c.next - now(c)
    if 3 * left < c.lead:
        return
    if c.law != NULL and c.taken:
        compute_ahead(c, actual)
    else:
        rehearse(c, actual, left)
    next_record(c).wake_ns = 0  # fetched
    if c.image.rehearse != NULL:
        c.image.rehearse(c.image.self)
    take_early(c, actual)


cdef void rehearse(cycle_t *c, const actual_t *actual, int64_t left) noexcept nogil:
    """A step of the law on scratch, its targets to outputs that are not sent. A long step would be
    late; it is also warm sooner."""
    cdef target_t *scratch = &c.handover.target[BEFORE_LAW]
    cdef target_t *target = &c.handover.target[OF_LAW if c.law != NULL else PRIVATE]
    memcpy(scratch.header, target.header, c.handover.target_size)
    if c.law != NULL and 2 * c.process < left:
        law_rehearse(c.law, actual, scratch, c.next)
    axes_rehearse(c.axes, scratch)


cdef void compute_ahead(cycle_t *c, actual_t *actual) noexcept nogil:
    """The law's part of the cycle that is to come, and its outputs as far as they lead without a
    frame. What the application says from now on counts a cycle later, but for what `axes_hear` hears
    at the instant."""
    cdef bint fresh
    cdef target_t *target = take_orders(c, &fresh)
    fresh = step_law(c, actual, target, c.number + 1, c.next, now(c))
    axes_write(c.axes, target, fresh, c.number + 1)
    c.ahead = 1


cdef void cycle_open(cycle_t *c) noexcept nogil:
    """Opens the cycle of the next instant, as soon as it is there: what is left of the lead is
    waited for without sleep."""
    cdef int64_t present = now(c)
    while present < c.next:
        present = now(c)
    if present - c.next >= c.period:
        skip(c, (present - c.next) // c.period)
    begin(c, present)


cdef void begin(cycle_t *c, int64_t wake) noexcept nogil:
    """The inputs are waited for: only what must be said now. Figures follow in the tail."""
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
    if c.ahead:
        c.flags |= AHEAD
    else:
        c.process = -1
    c.skipped = 0


# ---- halves

cdef void collect(cycle_t *c, actual_t *actual, int64_t deadline) noexcept nogil:
    """The compiled half after the wire: frames → images → actual values."""
    cdef int rc = c.image.collect(c.image.self, deadline)
    if not c.taken:
        c.missing = rc if rc >= 0 else -1
        axes_read(c.axes, actual, c.number, c.scheduled)
    c.taken = 0
    follow_clock(c)
    judge(c)


cdef inline void follow_clock(cycle_t *c) noexcept nogil:
    """Behind the frames of a cycle and before the next are stamped."""
    if c.clock != NULL:
        c.next += clock_close(c.clock)
        if c.clock.changes != c.clock.acknowledged:
            c.flags |= CLOCKS


cdef inline void judge(cycle_t *c) noexcept nogil:
    """Whether the frames that were collected make a good cycle."""
    if c.image.ok[0]:
        c.flags |= OK
        if c.image.whole[0]:
            c.lost_in_row = 0
    else:
        c.lost += 1
        c.lost_in_row += 1
        if c.lost_in_row >= c.lost_limit:
            c.flags |= WORKING_COUNTER


cdef void tell(cycle_t *c, actual_t *actual) noexcept nogil:
    """What is said of the cycle beside its values: of the axes, in the header and in the log."""
    cdef actual_header_t *header = actual.header
    cdef record_t *record = record_of(c)
    cdef uint32_t unit
    axes_tell(c.axes, actual)
    if c.axes.limited:
        c.flags |= LIMITED_SOME
        c.limits += 1
    if c.axes.refused:
        c.flags |= REFUSED_SOME
        c.refusals += 1
    if c.dry:
        c.flags |= DRY
        c.dries += 1
    if c.axes.dropped:
        c.flags |= DROPPED_SOME
        c.axes.dropped = 0
        c.drops += 1
    header.drops = c.drops
    header.refusals = c.refusals
    header.limits = c.limits
    header.dries = c.dries
    header.ok = c.flags & OK
    header.number = c.number
    header.time_ns = c.scheduled - c.origin
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


cdef void send(cycle_t *c) noexcept nogil:
    """The outputs as they stand in the image. A frame that could not go is counted by the image and
    is missing at collect."""
    if c.clock != NULL:
        c.clock.scheduled = c.scheduled
    c.image.emit(c.image.self)


cdef void emit(cycle_t *c, const target_t *target, bint fresh) noexcept nogil:
    """The compiled half before the wire: targets → images → frames."""
    axes_write(c.axes, target, fresh, c.number)
    send(c)


cdef bint take_streamed(cycle_t *c, target_t *target, bint fresh) noexcept nogil:
    """Take the next row of the stream, if there is one. Return True for fresh set-points; an empty
    stream is an underrun."""
    cdef stream_t *stream = c.stream
    c.dry = 0
    target.header.streamed = 0
    if stream == NULL:
        return fresh
    if stream_take(stream, target):
        target.header.hold = 0
        target.header.streamed = 1
        target.header.stamp = c.number
        return True
    if stream.taken == 0:
        return fresh
    target.header.hold = 0
    c.dry = 1
    return False


cdef int64_t give(cycle_t *c, record_t *record, int64_t since, const actual_t *actual,
                  const target_t *target) noexcept nogil:
    """The cycle for the sink; what the tail took with it. The sink's own time cannot be in what it
    is given."""
    record.tail_ns = short_ns(now(c) - since)
    c.sink.put(c.sink.self, c.number, record, actual.header, target.header)
    return now(c) - since


cdef void tail(cycle_t *c, int64_t since, const actual_t *actual, const target_t *target) noexcept nogil:
    """Acyclic frames; then the figures of the cycle, and whoever is given them."""
    cdef record_t *record
    cdef histogram_t *h = c.histograms
    cdef int64_t took
    lane_send(c.lane, c.link)
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
    if c.process >= 0:
        record.process_ns = short_ns(c.process)
        histogram_add(&h[PROCESS], c.process)
        if record.receive_ns >= 0 and record.send_ns >= 0:
            histogram_add(&h[IN_CONTROLLER], c.process + record.receive_ns + record.send_ns)
    took = give(c, record, since, actual, target) if c.sink != NULL else now(c) - since
    record.tail_ns = short_ns(took)
    histogram_add(&h[TAIL], took)
    clear_next_record(c)


# ---- orders

cdef void cycle_start(cycle_t *c, int64_t origin) noexcept nogil:
    """The first instant is one period from now, or on the grid of `origin`; after a stop the old
    grid goes on."""
    cdef int64_t present = now(c)
    cdef bint fresh
    if c.origin == 0:
        c.origin = origin if origin > 0 else present + c.period
    c.next = c.origin
    if present >= c.origin:
        c.next += ((present - c.origin) // c.period + 1) * c.period
    c.scheduled = c.next - c.period  # of frames that leave before the first cycle
    c.skipped = 0
    c.usable = 0
    c.begun = 0
    clear_next_record(c)
    if c.order == LAW:  # its first collect finds the frames of this
        emit(c, handover_latch(c.handover, &fresh), False)


cdef void cycle_threaded(cycle_t *c) noexcept nogil:
    cdef bint fresh
    cdef target_t *target = handover_latch(c.handover, &fresh)
    cdef actual_t *actual = &c.handover.actual[c.handover.actual_triple.back]
    cdef record_t *record = record_of(c)
    cdef int64_t sent, seen, published
    if fresh:
        c.process = target.header.process_ns
    fresh = take_streamed(c, target, fresh)
    emit(c, target, fresh)
    sent = now(c)
    record.send_ns = short_ns(sent - c.wake)
    if not fresh and c.axes.running:
        c.flags |= UNCOMMITTED
        c.uncommitted += 1
    collect(c, actual, c.wake + c.collect_deadline)
    tell(c, actual)
    handover_publish(c.handover)
    published = now(c)
    handover_wake(c.handover)
    seen = c.image.frame_stamp[0]
    record.receive_ns = short_ns(published - seen)
    if c.missing == 0:
        record.round_trip_ns = short_ns(seen - sent)
    tail(c, published, actual, target)


cdef void cycle_native(cycle_t *c) noexcept nogil:
    """One cycle after the wait, in the order that holds now. A threaded cycle before the first one
    of a law sends a second time: the law's first collect finds those frames."""
    cdef bint fresh
    if c.order == LAW or c.law != NULL or c.ahead:  # ahead: it may have ended with that step
        cycle_law(c)
    else:
        cycle_threaded(c)
    if c.law_seen != cat_load_acquire32(&c.law_request):
        if c.order == THREADED and c.law == NULL and c.law_asked != NULL:
            cycle_take_law(c, handover_latch(c.handover, &fresh))
            c.image.emit(c.image.self)  # what was sent last, once more
        else:
            cycle_take_law(c, handover_latch(c.handover, &fresh))


cdef void cycle_take_law(cycle_t *c, const target_t *orders) noexcept nogil:
    """From the next cycle on the law that was asked for runs, from what is commanded now."""
    cdef target_t *target = &c.handover.target[OF_LAW]
    cdef uint32_t i
    c.law_seen = cat_load_acquire32(&c.law_request)
    end_law(c, STOPPED_BY_APPLICATION)
    c.law = c.law_asked
    if c.law == NULL:
        return
    memcpy(target.header, orders.header, c.handover.target_size)
    for i in range(c.axes.axis_count):
        target.position[i] = c.axes.axes[i].commanded_position
        target.velocity[i] = c.axes.axes[i].commanded_velocity
        target.torque[i] = c.axes.axes[i].commanded_torque
    target.header.hold = 1
    target.header.seen = c.number
    if not law_begin(c.law, c.next):
        c.law = NULL


cdef void end_law(cycle_t *c, uint32_t status) noexcept nogil:
    """The axes hold from now on: what was committed before the law counts no longer."""
    if c.law == NULL:
        return
    c.handover.target[c.handover.target_triple.front].header.hold = 1
    c.handover.target[OF_LAW].header.hold = 1
    axes_hand_over(c.axes)
    if status != RUNNING:
        law_end(c.law, status, c.number)
    c.law = NULL


cdef target_t *take_orders(cycle_t *c, bint *fresh) noexcept nogil:
    """The law's targets, with what the application still says while it runs: goals and modes."""
    cdef target_t *committed = handover_latch(c.handover, fresh)
    cdef target_t *target = &c.handover.target[OF_LAW]
    cdef uint32_t axes = c.handover.counts.axes
    if fresh[0]:
        memcpy(target.request, committed.request, axes * sizeof(uint32_t))
        memcpy(target.controlword_bits, committed.controlword_bits, axes * sizeof(uint16_t))
        memcpy(target.mode, committed.mode, axes)
        memcpy(target.goal, committed.goal, axes)
    return target


cdef bint step_law(cycle_t *c, actual_t *actual, target_t *target, uint64_t number, int64_t instant,
                   int64_t since) noexcept nogil:
    """The step of the law for cycle `number`. False: what it left in the targets must not be sent."""
    cdef law_t *law = c.law
    cdef bint goes_on
    axes_follow_now(c.axes, target)
    take_streamed(c, target, False)
    target.header.hold = 0
    target.header.stamp = number
    target.header.seen = number  # the law has read them: a streamed row passes through its hands
    actual.header.ok = c.image.ok[0]
    memcpy(c.handover.target[BEFORE_LAW].header, target.header, c.handover.target_size)
    goes_on = law_run(law, c.axes, actual, target, instant, number)
    c.process = now(c) - since
    if goes_on and law_took(law, c.process, number):
        return True
    if law.status == FINISHED:
        c.law_flags |= LAW_DONE
        end_law(c, RUNNING)
        target.header.hold = 0  # its last targets are sent
        return True
    c.law_flags |= LAW_FAILED
    memcpy(target.header, c.handover.target[BEFORE_LAW].header, c.handover.target_size)
    cat_add32(&c.axes.stop_asked, 1)
    end_law(c, RUNNING)
    return False


cdef int64_t send_ahead(cycle_t *c, const target_t *target, bint fresh) noexcept nogil:
    """The frames of what was computed ahead; when they were out. All else follows behind them."""
    cdef int64_t sent
    axes_hear(c.axes, target, fresh)
    follow_clock(c)
    send(c)
    sent = now(c)
    judge(c)
    c.taken = 0
    c.ahead = 0
    record_of(c).receive_ns = 0
    record_of(c).send_ns = short_ns(sent - c.wake)
    return sent


cdef int64_t compute_and_send(cycle_t *c, actual_t *actual, target_t *target) noexcept nogil:
    """All of it behind the instant; without a law, or after its end, axes hold. When the frames
    were out."""
    cdef record_t *record = record_of(c)
    cdef bint fresh = False
    cdef int64_t usable, done, sent
    collect(c, actual, 0)
    usable = now(c)
    record.receive_ns = short_ns(usable - c.wake)
    done = usable
    if c.law != NULL:
        fresh = step_law(c, actual, target, c.number, c.scheduled, usable)
        done = usable + c.process
    else:
        target.header.hold = 1
    emit(c, target, fresh)
    sent = now(c)
    record.send_ns = short_ns(sent - done)
    return sent


cdef void cycle_law(cycle_t *c) noexcept nogil:
    cdef bint fresh
    cdef target_t *target = take_orders(c, &fresh)
    cdef actual_t *actual = &c.handover.actual[c.handover.actual_triple.back]
    cdef int64_t sent
    sent = send_ahead(c, target, fresh) if c.ahead else compute_and_send(c, actual, target)
    c.flags |= c.law_flags
    c.law_flags = 0
    if c.law != NULL:
        law_tell(c.law)
    tell(c, actual)
    handover_publish(c.handover)
    handover_wake(c.handover)
    tail(c, sent, actual, target)


cdef void cycle_inputs(cycle_t *c, actual_t *actual) noexcept nogil:
    """inline, after the wait."""
    collect(c, actual, 0)
    tell(c, actual)


cdef void cycle_usable(cycle_t *c) noexcept nogil:
    """inline: from here on Python works with the inputs."""
    c.usable = now(c)
    record_of(c).receive_ns = short_ns(c.usable - c.wake)


cdef void cycle_outputs(cycle_t *c, target_t *target, bint application) noexcept nogil:
    """inline, after Python's body; `application` False: nobody computed."""
    cdef int64_t done = now(c)
    cdef int64_t sent
    cdef actual_t *actual = &c.handover.actual[PRIVATE]
    target.header.seen = c.number
    target.header.stamp = c.number
    target.header.hold = not application
    emit(c, target, take_streamed(c, target, True))
    sent = now(c)
    if c.number > 0 and c.usable != 0:
        record_of(c).send_ns = short_ns(sent - done)
        if application:
            c.process = done - c.usable
    if c.sink != NULL:
        axes_tell(c.axes, actual)
    tail(c, sent, actual, target)
