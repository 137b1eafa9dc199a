# cython: boundscheck=False, wraparound=False, cdivision=True
"""Engine: owner of all parts of a cyclic exchange and their only interface to Python.

Theory of operation. In the threaded mode, `native` is set and a native thread runs the cycles.
`step` commits the targets and waits for the newest cycle. Inline, and in virtual time, `step` runs
the cycle in the caller's thread: `inline_outputs` and `inline_inputs`, or `lockstep` for a threaded
cycle. `hold` runs cycles without an application: a hand-over. Waits release the GIL, except if no
other program shares the virtual time (`alone`). `law` and `stream` are the ones that compute the
set-points; `laws` and `streams` keep every one that the cycle may still use.
`committed` marks targets that were committed before `next`, `emitted` inline frames that were sent.
`left` is the time at which the body began, and `input_age` the age of its inputs at that time.

Budget of `next`, without the link: 1 us for three drives.
"""

import os

cimport cython
from cpython.exc cimport PyErr_CheckSignals
from libc.errno cimport EINTR
from libc.stdint cimport int64_t, uint32_t, uint64_t
from libc.string cimport memcpy

from catenary.core._axes cimport Axes, axes_follow
from catenary.core._capsules cimport image_in, link_in, sink_in
from catenary.core._clocks cimport Clock
from catenary.core._copies cimport Copies
from catenary.core._cycle cimport (
    INLINE,
    INTERPRETER,
    STEERING_ONE,
    cycle_await_acyclic,
    cycle_inputs,
    cycle_law_reserve,
    cycle_native,
    cycle_outputs,
    cycle_start,
    cycle_t,
    cycle_usable,
    cycle_wait,
    cycle_wants_native,
    record_t,
)
from catenary.core._cycle import EXECUTION_MODES
from catenary.core._figures cimport Figures
from catenary.core._frames cimport Frames, frames_flush
from catenary.core._handover cimport (
    LATE,
    LAW_DONE,
    LAW_FAILED,
    NONE,
    PRIVATE,
    STOPPED,
    TARGETS,
    Handover,
    actual_header_t,
    actual_t,
    handover_commit,
    handover_swap,
    target_header_t,
    target_t,
)
from catenary.core._histogram cimport histogram_add
from catenary.core._acyclic_queue cimport AcyclicQueue
from catenary.core._law cimport WAITING, Law, law_monitor_start, law_monitor_stop
from catenary.core._memory cimport (
    cat_memory_add_state,
    cat_memory_settle,
    cat_memory_state,
    memory_text,
)
from catenary.core._native cimport (
    CAT_AL_OP,
    CAT_LINK_SHARED_TIME,
    CAT_LINK_SPENDS,
    CAT_LINK_VIRTUAL_TIME,
    CAT_POINTER_NONE,
    cat_add32,
    cat_exchange32,
    cat_fence,
    cat_futex_wait,
    cat_futex_wake,
    cat_link,
    cat_load_acquire32,
    cat_load_relaxed64,
    cat_pointer_is_used,
    cat_pointer_offer,
    cat_sink,
    cat_store_release32,
    cat_store_release64,
)
from catenary.core._motion cimport motion_attach
from catenary.core._stream cimport Stream
from catenary.core._trigger cimport TriggerBlock
from catenary.core._thread cimport (
    cat_scheduling,
    scheduling_restore,
    scheduling_save,
    scheduling_text,
    thread_join,
    thread_schedule,
    thread_start,
)

cdef double STEERING_LIMIT = 1e-3  # as RATE_LIMIT in plan/clocks.py

cdef enum:
    SIGNALS_NS = 10_000_000    # longest run of native cycles between two calls of signal handlers
    PIDS = 1 << 22             # Linux has no larger process numbers
    SILENCE_NS = 1_000_000_000 # plus four periods: longest wait for a cycle of a live thread


cdef void thread_loop(void *argument) noexcept nogil:
    """Run the native thread until it is asked to end, or until a wait on the link fails."""
    cdef engine_t *e = <engine_t *>argument
    cdef int rc
    while not cat_load_acquire32(&e.thread.stop):
        rc = cycle_wait(&e.cycle)
        if rc == 0:
            cycle_native(&e.cycle)
        elif rc != -EINTR:
            e.error = rc
            break
    cat_store_release32(&e.done, 1)
    cat_add32(&e.cycle.handover.published, 1)
    cat_futex_wake(&e.cycle.handover.published)


def counts_of(columns, areas):
    """Return the number of columns in each bank, and the bytes of the areas."""
    banks = [sum(column.bank == bank for column in columns) for bank in range(3)]
    return [*banks, sum(area.size for area in areas)]


def check_plan(plan):
    """Raise ValueError if a number of the plan is out of range."""
    if plan.execution not in EXECUTION_MODES:
        raise ValueError(f"execution: {plan.execution!r}, must be one of {', '.join(EXECUTION_MODES)}")
    if not 1000 <= plan.period_ns <= 1 << 40:
        raise ValueError(f"period_ns: {plan.period_ns}, must be 1000 to 2^40")
    if not 0 <= plan.collect_deadline_ns <= plan.period_ns:
        raise ValueError(
            f"collect_deadline_ns: {plan.collect_deadline_ns}, must not exceed the"
            f" period of {plan.period_ns}"
        )
    if plan.priority is not None and not 1 <= plan.priority <= 99:
        raise ValueError(f"priority: {plan.priority}, must be 1 to 99 or None")
    if plan.cpu is not None and not 0 <= plan.cpu < 1024:
        raise ValueError(f"cpu: {plan.cpu}, must be 0 to 1023 or None")
    if not 0 <= plan.busy_wait_ns < plan.period_ns:
        raise ValueError(f"busy_wait_ns: {plan.busy_wait_ns}, must be less than the period")
    if not 1 <= plan.log_cycles <= 1 << 24:
        raise ValueError(f"log_cycles: {plan.log_cycles}, must be 1 to {1 << 24}")


@cython.no_gc_clear  # its parts must outlive the native thread
cdef class Engine:
    def __cinit__(self, plan, link, image=None):
        check_plan(plan)
        self.e.thread.priority = plan.priority or 0
        self.e.thread.cpu = -1 if plan.cpu is None else plan.cpu
        self.device_count = plan.device_count
        self.owners = (link, image)
        if image is None:
            self.frames = Frames(plan, link)
            self.image = &self.frames.c.image
            self.link = self.frames.c.link
        else:
            self.image = image_in(image, plan)
            self.link = link_in(link)
        self.acyclic = AcyclicQueue(plan.acyclic_ns)
        self.axes = Axes(plan)
        if plan.copies:
            self.copies = Copies(plan)
        if plan.clock is not None:
            self.clock = Clock(plan.clock, plan.period_ns)
        self.handover = Handover(
            len(plan.axes),
            len(plan.sync_units),
            counts_of(plan.input_columns, plan.input_areas),
            counts_of(plan.output_columns, plan.output_areas),
        )
        self.figures = Figures()
        self.connect(plan)
        self._buffers = self.handover.fields()
        self.laws = []
        self.streams = []
        self.native = self.e.cycle.execution != INLINE and not self.virtual
        self.left = -1

    cdef connect(self, plan):
        """Connect the parts."""
        cdef cycle_t *c = &self.e.cycle
        cdef uint32_t i
        cdef int slot
        self.figures.attach(c, plan.log_cycles, len(plan.axes) if plan.log_axes else 0)
        if self.frames is not None:
            self.frames.c.acyclic = &self.acyclic.c
        self.axes.c.image = self.image
        self.axes.c.link = self.link
        if self.clock is not None:
            self.frames.carry_time(&self.clock.c)
            c.clock = &self.clock.c
            c.sync_margin = plan.clock.allowance_ns
        c.link = self.link
        c.image = self.image
        c.axes = &self.axes.c
        if self.copies is not None:
            self.copies.c.image = self.image
            c.copies = &self.copies.c
        c.acyclic = &self.acyclic.c
        c.handover = &self.handover.c
        self.virtual = c.link.flags & CAT_LINK_VIRTUAL_TIME != 0
        self.alone = self.virtual and not c.link.flags & CAT_LINK_SHARED_TIME
        c.execution = EXECUTION_MODES[plan.execution]
        c.period = plan.period_ns
        c.busy_wait = 0 if self.virtual else plan.busy_wait_ns
        c.collect_deadline = plan.collect_deadline_ns
        c.lost_limit = plan.lost_limit
        self.h = &self.handover.c
        for slot in range(4):
            self.h.actual[slot].header.period = c.period * 1e-9
        for slot in range(TARGETS):
            for i in range(c.axes.axis_count):
                self.h.target[slot].mode[i] = c.axes.axes[i].mode
        for i in range(c.axes.axis_count):
            self.h.actual[PRIVATE].position[i] = c.axes.axes[i].position
            self.h.actual[PRIVATE].velocity[i] = c.axes.axes[i].velocity
            self.h.actual[PRIVATE].torque[i] = c.axes.axes[i].torque

    # ---- the cycle that `actual` belongs to

    cdef actual_header_t *actual_header(self) noexcept:
        """Return the header of Python's actual values; it lives as long as the engine."""
        return self.h.actual[PRIVATE].header

    cdef void begin_iteration(self) noexcept:
        """Make the current cycle start the zero of times, unless it is already set."""
        if self.zero == 0:
            self.zero = self.e.cycle.origin + self.h.actual[PRIVATE].header.time_ns

    @property
    def zero_ns(self):
        return self.zero

    @zero_ns.setter
    def zero_ns(self, int64_t zero):
        self.zero = zero

    cdef int64_t now_ns(self) noexcept:
        return self.e.cycle.link.now(self.e.cycle.link.self)

    def now(self):
        return self.now_ns()

    @property
    def scheduled_ns(self):
        return <int64_t>cat_load_relaxed64(<uint64_t *>&self.e.cycle.scheduled)

    def steer(self, double rate):
        if not -STEERING_LIMIT <= rate <= STEERING_LIMIT:
            raise ValueError(f"steer: rate {rate}, must be within {STEERING_LIMIT:g}")
        cat_store_release64(&self.e.cycle.steering,
                            <uint64_t><int64_t>(rate * self.e.cycle.period * STEERING_ONE))

    @property
    def buffers(self):
        return dict(self._buffers)

    def blocks(self):
        return self.handover.blocks()

    def law_fields(self):
        return self.handover.law_fields()

    def sink_fields(self):
        return self.handover.sink_fields()

    @property
    def sink_sizes(self):
        return sizeof(record_t), self.h.actual_size, self.h.target_size

    @property
    def number(self):
        return self.h.actual[PRIVATE].header.number

    @property
    def time_ns(self):
        return self.h.actual[PRIVATE].header.time_ns

    @property
    def flags(self):
        return self.h.actual[PRIVATE].header.flags

    @property
    def lost_in_row(self):
        return self.h.actual[PRIVATE].header.lost_in_row

    @property
    def skipped(self):
        return self.h.actual[PRIVATE].header.skipped

    @property
    def missing_frames(self):
        return self.h.actual[PRIVATE].header.missing_frames

    @property
    def al_status(self):
        return self.h.actual[PRIVATE].header.al_status

    @property
    def al_counter(self):
        return self.h.actual[PRIVATE].header.al_counter

    @property
    def disturbed(self):
        cdef uint32_t unit
        image = self.image
        for unit in range(image.unit_count):
            if not image.unit_valid[unit]:
                return True
        return image.al_counter[0] != self.device_count or image.al_status[0] != CAT_AL_OP

    # ---- start and stop

    def start(self, int64_t origin_ns=0):
        cdef int rc
        if self.running:
            raise RuntimeError("the engine is already running")
        if self.forgotten:
            raise self.not_running()
        if self.frames is not None:
            frames_flush(&self.frames.c)
        self.e.error = 0
        if self.copies is not None:
            self.copies.c.ended = 0
        self.e.done = 0
        self.left = -1
        handover_swap(self.h)  # discard the values of an earlier run
        if not self.virtual:
            self.settle_memory()
        self.e.thread.body = thread_loop
        self.e.thread.argument = &self.e
        if self.native:
            cycle_start(&self.e.cycle, origin_ns)
            rc = thread_start(&self.e.thread)
            if rc < 0:
                raise OSError(-rc, f"cannot start the native thread: {os.strerror(-rc)}")
        elif not self.virtual:
            self.saved_scheduling = scheduling_save(&self.scheduling_before) == 0
            thread_schedule(&self.e.thread)
            cycle_start(&self.e.cycle, origin_ns)
        else:
            cycle_start(&self.e.cycle, origin_ns)
        self.running = True

    def stop(self):
        if not self.running:
            return
        self.running = False
        with nogil:
            thread_join(&self.e.thread)
        if self.saved_scheduling:
            scheduling_restore(&self.scheduling_before)
            self.saved_scheduling = False

    def forget(self):
        thread_join(&self.e.thread)
        law_monitor_stop(&self.e.cycle.monitor)
        if self.saved_scheduling:
            scheduling_restore(&self.scheduling_before)
            self.saved_scheduling = False
        self.running = False
        self.forgotten = True

    cdef not_running(self):
        """Return the error for a call that needs cycles."""
        if self.forgotten:
            return RuntimeError("the loop runs in the parent process: a forked child cannot use it")
        if self.e.cycle.origin != 0:
            return RuntimeError("the loop is closed and its cycle has ended: open it again")
        return RuntimeError("the engine is not running: start it first")

    # ---- steps

    def next(self, int64_t timeout_ns=0):
        return self.step(timeout_ns)

    def commit_targets(self):
        if self.e.cycle.execution != INLINE:
            self.commit(self.is_led())
            self.committed = True

    def keep_targets(self):
        self.committed = self.e.cycle.execution != INLINE

    @property
    def background(self):
        return self.h.target[PRIVATE].header.background != 0

    @background.setter
    def background(self, bint value):
        if self.e.cycle.execution == INLINE:
            raise ValueError("an inline cycle cannot repeat targets in the background")
        self.h.target[PRIVATE].header.background = value
        self.h.target[PRIVATE].header.updated = 0

    @property
    def led(self):
        return self.is_led()

    def begin_update(self):
        self.writing = True
        self.writing_since = self.h.actual[PRIVATE].header.number

    def end_update(self, bint commit):
        cdef target_header_t *header = self.h.target[PRIVATE].header
        if commit:
            if not self.is_led():
                header.updated = max(self.e.cycle.number, <uint64_t>1)
            self.commit_targets()
        self.writing = False
        if self.law is None and self.stream is None:  # `follow` skipped this during the update
            axes_follow(&self.axes.c, &self.h.actual[PRIVATE], &self.h.target[PRIVATE])

    @property
    def origin(self):
        return self.e.cycle.origin

    def take_turns(self):
        self.e.cycle.patient = not self.native

    cdef uint32_t step(self, int64_t timeout_ns=0) except? 0xFFFFFFFF:
        """Run one step. A `timeout_ns` of 0 means one second and four periods."""
        if not self.running:
            raise self.not_running()
        if timeout_ns == 0:
            timeout_ns = SILENCE_NS + 4 * self.e.cycle.period
        if self.native:
            return self.step_native(timeout_ns)
        if self.is_native_cycle(True):
            if not self.committed:
                self.commit(self.is_led())
            self.committed = False
            self.lockstep()
        else:
            self.inline_outputs(True)
            self.inline_inputs()
        self.follow()
        return self.flags_since()

    cdef bint is_led(self) noexcept:
        """Return True if a started law, or a stream, sets the set-points."""
        return self.stream is not None or (self.law is not None and self.law.c.status != WAITING)

    cdef uint32_t flags_since(self) noexcept:
        """Return the flags of the cycle, with the sticky ones of cycles that Python has missed."""
        cdef actual_header_t *header = self.h.actual[PRIVATE].header
        if cat_load_acquire32(&self.h.sticky):
            header.flags |= cat_exchange32(&self.h.sticky, 0)
        return header.flags

    cdef bint is_native_cycle(self, bint application) noexcept nogil:
        """Return True if the next cycle of the caller's thread is a threaded one. In the inline
        mode, this is so only while a law runs. Before a law starts, send Python's last outputs.
        """
        cdef cycle_t *c = &self.e.cycle
        if c.execution != INLINE:
            return True
        if not cycle_wants_native(c):
            return False
        if c.law == NULL and not c.computed:
            self.inline_outputs(application)
        return True

    cdef void follow(self) noexcept:
        """Update Python's targets after new actual values.

        Without a law or stream, only the targets of axes that are not followed change. While a
        stream is set or a law runs, all targets change. This includes the cycle in which the law
        ended. Then the law is released.
        """
        cdef actual_t *actual = &self.h.actual[PRIVATE]
        if self.law is None and self.stream is None:
            if not self.writing:
                axes_follow(&self.axes.c, actual, &self.h.target[PRIVATE])
            return
        if not self.writing:
            self.take_commanded()
        if self.law is not None and self.law.ended_before(actual.header.number):
            # Python may have missed the cycle with this flag.
            actual.header.flags |= LAW_FAILED if self.law.failed() else LAW_DONE
            self.law = None

    cdef void inline_outputs(self, bint application) noexcept nogil:
        """Send once per cycle, even if a signal interrupts the wait and it is repeated."""
        if not self.emitted:
            cycle_outputs(&self.e.cycle, &self.h.target[PRIVATE], application)
            self.emitted = True

    cdef int inline_inputs(self) except -1:
        """Wait for the cycle start and read the inputs, in Python's thread."""
        cdef cycle_t *c = &self.e.cycle
        cdef int rc
        while True:
            if self.alone:
                rc = cycle_wait(c)
            else:
                with nogil:
                    rc = cycle_wait(c)
            if rc == 0:
                break
            self.interrupted(rc)
        if not self.alone:
            histogram_add(&c.histograms[INTERPRETER], self.now_ns() - c.wake)
        cycle_inputs(c, &self.h.actual[PRIVATE])
        cycle_usable(c)
        self.emitted = False
        return 0

    cdef int lockstep(self) except -1:
        """Run one threaded cycle in the caller's thread: in virtual time, or inline with a law."""
        cdef actual_header_t *header = self.h.actual[PRIVATE].header
        cdef uint64_t before = header.number
        cdef int rc
        while True:
            if self.alone:
                rc = self.native_cycle_here()
            else:
                with nogil:
                    rc = self.native_cycle_here()
            if rc == 0:
                if before > 0 and header.number > before + 1:
                    header.flags |= LATE  # cycles ran in `spend`
                self.enter_body()
                return 0
            self.interrupted(rc)

    cdef int native_cycle_here(self) noexcept nogil:
        cdef int rc = cycle_wait(&self.e.cycle)
        if rc == 0:
            cycle_native(&self.e.cycle)
            handover_swap(self.h)
            self.emitted = False
        return rc

    cdef int inline_cycle_here(self) noexcept nogil:
        """Run one inline cycle without an application."""
        cdef cycle_t *c = &self.e.cycle
        cdef int rc
        self.inline_outputs(False)
        rc = cycle_wait(c)
        if rc == 0:
            cycle_inputs(c, &self.h.actual[PRIVATE])
            cycle_usable(c)
            self.emitted = False
        return rc

    cdef uint32_t step_native(self, int64_t timeout_ns) except? 0xFFFFFFFF:
        cdef actual_header_t *header = self.h.actual[PRIVATE].header
        cdef uint64_t before = header.number
        cdef uint32_t flags
        if not self.committed:
            self.commit(self.is_led())
        self.committed = False
        flags = self.await_cycle(timeout_ns)
        self.follow()
        self.enter_body()
        if before > 0 and header.number > before + 1:
            header.flags |= LATE
        return self.flags_since() | flags

    cdef void enter_body(self) noexcept:
        """Record when the application begins to compute, and the age of its inputs."""
        self.left = self.now_ns()
        self.input_age = self.left - self.h.actual[PRIVATE].header.sent_ns

    cdef void commit(self, bint hold) noexcept:
        cdef target_t *target = &self.h.target[PRIVATE]
        target.header.hold = hold
        target.header.seen = self.h.actual[PRIVATE].header.number
        target.header.stamp = target.header.seen + 1
        if self.writing:  # no position target for axes that became followed since the update began
            target.header.seen = self.writing_since
        target.header.process_ns = -1
        target.header.input_age_ns = -1
        if self.left >= 0 and not hold:
            target.header.process_ns = self.now_ns() - self.left
            target.header.input_age_ns = self.input_age
        handover_commit(self.h)

    cdef int await_cycle(self, int64_t timeout_ns) except -1:
        """Swap in the newest cycle; wait for one if needed. Return 0, NONE or STOPPED."""
        cdef int64_t deadline = -1
        cdef int64_t left, woken
        cdef uint32_t seen
        cdef int rc
        while not handover_swap(self.h):
            if cat_load_acquire32(&self.e.done):
                if self.e.error < 0:
                    self.interrupted(self.e.error)
                return STOPPED
            if deadline < 0:
                deadline = self.now_ns() + timeout_ns
            left = deadline - self.now_ns()
            if left <= 0:
                return NONE
            cat_store_release32(&self.h.waiting, 1)
            cat_fence()  # set waiting before reading published; the writer does the reverse
            seen = cat_load_acquire32(&self.h.published)
            rc = 0
            if not handover_swap(self.h):
                with nogil:
                    if not cat_load_acquire32(&self.e.done):
                        rc = cat_futex_wait(&self.h.published, seen, left)
                    woken = self.link.now(self.link.self)
                histogram_add(&self.e.cycle.histograms[INTERPRETER], self.now_ns() - woken)
            else:
                cat_store_release32(&self.h.waiting, 0)
                return 0
            cat_store_release32(&self.h.waiting, 0)
            if rc == -EINTR:
                PyErr_CheckSignals()
        return 0

    def run(self, int64_t cycles):
        if not self.running:
            raise self.not_running()
        flags = self.hold(cycles, False, 0)
        self.left = -1
        return flags | self.flags_since()

    cdef uint32_t hold(self, int64_t cycles, bint until_stopped, int64_t deadline) except? 0xFFFFFFFF:
        """Run cycles without an application: a number of them, until all axes stop, or the deadline
        [ns]."""
        cdef actual_t *actual = &self.h.actual[PRIVATE]
        cdef int64_t batch
        cdef uint32_t flags = actual.header.flags
        self.commit(True)  # a hand-over also around an inline law
        if self.e.cycle.execution != INLINE:
            handover_swap(self.h)  # count cycles from the commit on
        while cycles > 0:
            batch = 1 if until_stopped else min(cycles, max(SIGNALS_NS // self.e.cycle.period, 1))
            flags = self.hold_native(batch) if self.native else self.hold_here(batch)
            if flags & (STOPPED | NONE):
                break
            PyErr_CheckSignals()
            cycles -= batch
            if until_stopped and (actual.header.moving == 0 or self.now_ns() >= deadline):
                break
        if not self.writing:
            self.take_commanded()
        return flags

    cdef uint32_t hold_native(self, int64_t cycles) except? 0xFFFFFFFF:
        """Let the native thread run this number of cycles."""
        cdef uint64_t last = self.h.actual[PRIVATE].header.number + cycles
        cdef uint32_t flags
        while self.h.actual[PRIVATE].header.number < last:
            flags = self.await_cycle(SILENCE_NS + 4 * self.e.cycle.period)
            if flags:
                return self.h.actual[PRIVATE].header.flags | flags
        return self.h.actual[PRIVATE].header.flags

    cdef uint32_t hold_here(self, int64_t cycles) except? 0xFFFFFFFF:
        """Run this number of cycles in the caller's thread, without the GIL."""
        cdef int rc = 0
        while cycles > 0:
            with nogil:
                while cycles > 0 and rc == 0:
                    if self.is_native_cycle(False):
                        rc = self.native_cycle_here()
                    else:
                        rc = self.inline_cycle_here()
                    if rc == 0:
                        cycles -= 1
            if rc != 0:
                self.interrupted(rc)
                rc = 0
        return self.h.actual[PRIVATE].header.flags

    cdef void take_commanded(self) noexcept:
        """Set the application's targets to the commanded values."""
        cdef actual_t *actual = &self.h.actual[PRIVATE]
        cdef target_t *target = &self.h.target[PRIVATE]
        cdef uint32_t axes = self.h.counts.axes
        memcpy(target.position, actual.commanded_position, axes * sizeof(double))
        memcpy(target.velocity, actual.commanded_velocity, axes * sizeof(double))
        memcpy(target.torque, actual.commanded_torque, axes * sizeof(double))
        axes_follow(&self.axes.c, actual, target)

    cdef int interrupted(self, int rc) except -1:
        """Handle a failed wait: run signal handlers, or raise OSError."""
        if rc == -EINTR:
            PyErr_CheckSignals()
            return 0
        raise OSError(-rc, f"waiting on the link failed: {os.strerror(-rc)}")

    def spend(self, int64_t duration_ns):
        cdef cycle_t *c = &self.e.cycle
        cdef int64_t since, slice, left = duration_ns
        if duration_ns < 0:
            raise ValueError(f"duration_ns: {duration_ns}, must not be negative")
        if not self.running:
            raise self.not_running()
        if not self.virtual:
            self.compute(duration_ns)
            return
        while left > 0:
            slice = left
            if c.execution != INLINE:
                slice = min(left, max(c.next - self.now_ns(), <int64_t>0))
            self.pass_time(slice)
            since = self.now_ns()
            while c.execution != INLINE and c.next <= self.now_ns():
                self.spend_cycle()
            left -= slice + self.now_ns() - since  # the cycles do not use the application's time

    cdef void compute(self, int64_t duration_ns) noexcept:
        """Compute for this long in real time."""
        cdef int64_t end = self.now_ns() + duration_ns
        with nogil:
            while self.e.cycle.link.now(self.e.cycle.link.self) < end:
                pass

    cdef int spend_cycle(self) except -1:
        """Run a cycle while the application computes; its values are not swapped in yet."""
        cdef int rc
        with nogil:
            rc = cycle_wait(&self.e.cycle)
            if rc == 0:
                cycle_native(&self.e.cycle)
        return self.interrupted(rc) if rc < 0 else 0

    cdef int pass_time(self, int64_t duration) except -1:
        """Let time pass: as execution time if the link supports it."""
        cdef const cat_link *link = self.e.cycle.link
        cdef int64_t until = self.now_ns() + duration
        cdef int rc
        if link.flags & CAT_LINK_SPENDS:
            while True:
                with nogil:
                    rc = link.spend(link.self, duration)
                if rc >= 0:
                    return 0
                self.interrupted(rc)
        while self.now_ns() < until:
            with nogil:
                rc = link.wait_until(link.self, until, 0)
            if rc < 0:
                self.interrupted(rc)
        return 0

    def quick_stop_all(self):
        cat_add32(&self.axes.c.stop_asked, 1)

    def end_copies(self):
        if self.copies is not None:
            cat_store_release32(&self.copies.c.ended, 1)

    def run_until_stopped(self, int64_t timeout_ns):
        if not self.running:
            raise self.not_running()
        self.hold(1 << 62, True, self.now_ns() + timeout_ns)
        return self.h.actual[PRIVATE].header.moving == 0

    @property
    def scheduling(self):
        if self.virtual:
            return "virtual time"
        return f"{scheduling_text(&self.e.thread)}, {self.memory_text()}"

    cdef void settle_memory(self) noexcept:
        """Touch and lock the memory of the cycle. The log is last, so that it is the first to be refused."""
        if self.frames is not None:
            cat_memory_settle(&self.frames.memory)
        if self.clock is not None:
            cat_memory_settle(&self.clock.memory)
        cat_memory_settle(&self.axes.memory)
        if self.copies is not None:
            cat_memory_settle(&self.copies.memory)
        cat_memory_settle(&self.handover.memory)
        cat_memory_settle(&self.acyclic.memory)
        cat_memory_settle(&self.figures.memory)
        cat_memory_settle(&self.figures.log_memory)

    cdef memory_text(self):
        """Return a text about the locked memory of the cycle, its laws and its streams."""
        cdef cat_memory_state state = cat_memory_state(locked=0, touched=0, error=0)
        cdef Law law
        cdef Stream stream
        if self.frames is not None:
            cat_memory_add_state(&self.frames.memory, &state)
        if self.clock is not None:
            cat_memory_add_state(&self.clock.memory, &state)
        cat_memory_add_state(&self.axes.memory, &state)
        if self.copies is not None:
            cat_memory_add_state(&self.copies.memory, &state)
        cat_memory_add_state(&self.handover.memory, &state)
        cat_memory_add_state(&self.acyclic.memory, &state)
        cat_memory_add_state(&self.figures.memory, &state)
        cat_memory_add_state(&self.figures.log_memory, &state)
        for law in self.laws:
            cat_memory_add_state(&law.memory_block, &state)
        for stream in self.streams:
            cat_memory_add_state(&stream.memory, &state)
        return memory_text(&state)

    # ---- laws

    def start_law(self, Law law not None):
        if not self.running:
            raise self.not_running()
        self.check_reserve(law.c.budget)
        law_monitor_start(&self.e.cycle.monitor, law.priority)
        if self.law is not None:
            self.law.supersede()
        if not self.virtual:
            cat_memory_settle(&law.memory_block)
        self.laws = [*self.laws, law]  # keeps the law alive; must precede the offer to the cycle
        self.law = law
        law.c.threaded = self.native
        self.h.target[PRIVATE].header.updated = 0  # not valid after the law
        cat_pointer_offer(&self.e.cycle.law_request, &law.c)
        self.laws = [known for known in self.laws if self.is_law_used(known)]

    cdef int check_reserve(self, int64_t budget) except -1:
        """Raise ValueError if a law leaves too little of the period for the frames."""
        cdef cycle_t *c = &self.e.cycle
        cdef int64_t left = c.period - cycle_law_reserve(c, budget)
        if left > c.turnaround:
            return 0
        raise ValueError(
            f"a law with a budget of {budget / 1e3:g} us leaves {left / 1e3:g} us of the period of"
            f" {c.period / 1e3:g} us for the frames, which take {c.turnaround / 1e3:g} us: give it"
            " a smaller budget or the loop a longer period"
        )

    def stop_law(self):
        if self.law is not None:
            self.law.supersede()
        cat_pointer_offer(&self.e.cycle.law_request, CAT_POINTER_NONE)

    cdef bint is_law_used(self, Law law) noexcept:
        """Return True if the cycle runs the law or has not processed its request yet."""
        return cat_pointer_is_used(&self.e.cycle.law_request, &law.c)

    def run_law(self, int64_t duration_ns, uint32_t trouble):
        cdef int64_t cycles = duration_ns // self.e.cycle.period + 1
        cdef uint32_t flags = self.h.actual[PRIVATE].header.flags
        cdef Law law = self.law
        if not self.running or law is None:
            raise RuntimeError("no law runs: start one first")
        if self.native:
            law.wait(duration_ns)
            handover_swap(self.h)
            flags = self.h.actual[PRIVATE].header.flags
            if cat_load_acquire32(&self.e.done):
                flags |= STOPPED
        else:
            self.commit(True)
            while cycles > 0 and not law.ended and not flags & trouble:
                flags = self.hold_here(1)
                cycles -= 1
        self.follow()
        self.left = -1
        return flags | self.flags_since()

    # ---- sinks

    def set_sink(self, capsule):
        cdef const cat_sink *sink = NULL
        if self.running:
            raise RuntimeError("the engine is running: stop it before you set or remove a sink")
        if capsule is not None:
            sink = sink_in(capsule, self.sink_sizes, self.axes.c.axis_count)
        self.e.cycle.sink = sink
        self.attach_motion(sink)
        self.sink = capsule

    cdef int attach_motion(self, const cat_sink *sink) except -1:
        """Connect the motion words of a sink, or none. Every jog ends."""
        cdef uint32_t i
        cdef bytes seed = os.urandom(sizeof(uint64_t))
        for i in range(self.axes.c.axis_count):
            self.axes.c.axes[i].jogged = 0
        motion_attach(&self.axes.c.motion, sink, self.axes.c.axis_count,
                      (<uint64_t *><const char *>seed)[0])
        return 0

    def set_trigger(self, TriggerBlock block not None, bint sends):
        if self.running:
            raise RuntimeError("the engine is running: stop it before you set a trigger")
        if not self.native:
            raise ValueError("a trigger needs a native thread: a threaded cycle in real time")
        self.trigger = block
        self.e.cycle.trigger.sends = block.c if sends else NULL
        self.e.cycle.trigger.awaits = NULL if sends else block.c

    @property
    def following(self):
        return bool(self.e.cycle.trigger.following)

    @property
    def stopper(self):
        if self.axes.c.motion.words == NULL:
            return 0
        pid = cat_load_relaxed64(&self.axes.c.motion.words.stopper)
        return pid if pid < PIDS else 0

    # ---- streams

    def set_stream(self, Stream stream):
        if stream is not None and stream.c.axes != self.axes.c.axis_count:
            raise ValueError(f"the stream has {stream.c.axes} axes, the engine {self.axes.c.axis_count}")
        if stream is not None:
            if not self.virtual:
                cat_memory_settle(&stream.memory)
            self.streams = [*self.streams, stream]  # as with laws, must precede the offer
        self.stream = stream
        self.h.target[PRIVATE].header.updated = 0  # not valid after the stream
        cat_pointer_offer(&self.e.cycle.stream, NULL if stream is None else &stream.c)
        self.streams = [known for known in self.streams if self.is_stream_used(known)]
        handover_swap(self.h)
        self.take_commanded()

    cdef bint is_stream_used(self, Stream stream) noexcept:
        """Return True if the cycle may be reading the stream."""
        return cat_pointer_is_used(&self.e.cycle.stream, &stream.c)

    # ---- figures

    @property
    def counters(self):
        frames = {} if self.frames is None else self.frames.c.counters
        return {
            "cycles": self.e.cycle.number,
            "lost": self.e.cycle.lost,
            "late": self.e.cycle.late,
            "uncommitted": self.e.cycle.uncommitted,
            "underrun": self.e.cycle.underruns,
            "missed_sync": self.e.cycle.missed_sync,
            "missed_triggers": self.e.cycle.trigger.missed,
            "page_faults": self.e.thread.page_faults,
            "stale": 0,
            "alien": 0,
            "corrupt": 0,
            "duplicate": 0,
            "unprocessed": 0,
            "repeated": 0,
            "acyclic_sent": self.acyclic.c.sent,
            "acyclic_received": self.acyclic.c.received,
            "acyclic_dropped": self.acyclic.c.dropped,
            "send_errors": 0,
            "receive_errors": 0,
            **frames,
        }

    def histograms(self):
        return self.figures.histograms()

    def histogram_counts(self, str phase not None):
        return self.figures.counts(phase)

    def reset_histograms(self):
        self.figures.reset()

    def log(self):
        return self.figures.log()

    # ---- the acyclic queue

    def acyclic_push(self, bytes frame not None):
        return self.acyclic.push(frame)

    def acyclic_pop(self):
        return self.acyclic.pop()

    def acyclic_wait(self, int64_t timeout_ns):
        cdef int64_t until
        if not self.virtual:
            return self.acyclic.wait(timeout_ns)
        until = min(self.e.cycle.next, self.e.cycle.link.now(self.e.cycle.link.self) + timeout_ns)
        with nogil:
            cycle_await_acyclic(&self.e.cycle, until)
        return self.acyclic.wait(0)

    def __dealloc__(self):
        with nogil:
            thread_join(&self.e.thread)
        law_monitor_stop(&self.e.cycle.monitor)
