# cython: boundscheck=False, wraparound=False, cdivision=True
"""Engine: owns all parts of one cyclic exchange and is the only way in from Python.

Where another thread could want the GIL it is released round waits only; in virtual time not even
there. Budget of `next` beside the link: 1 us for three drives.
"""

import os

cimport cython
from cpython.exc cimport PyErr_CheckSignals
from cpython.pycapsule cimport PyCapsule_GetPointer, PyCapsule_IsValid
from libc.errno cimport EINTR
from libc.stdint cimport int64_t, uint32_t, uint64_t
from libc.stdlib cimport calloc, free
from libc.string cimport memcpy

from catenary.core._axes cimport Axes, axes_follow
from catenary.core._cycle cimport (
    INLINE,
    LATE,
    LAW,
    LOG_LENGTH,
    NONE,
    PHASES,
    RECORDS,
    STOPPED,
    cycle_inputs,
    cycle_law,
    cycle_open,
    cycle_outputs,
    cycle_sleep,
    cycle_start,
    cycle_t,
    cycle_threaded,
    cycle_usable,
    cycle_wait,
    record_t,
)
from catenary.core._cycle import ORDERS, PHASE_NAMES
from catenary.core._frames cimport Frames, frames_flush
from catenary.core._handover cimport (
    PRIVATE,
    Handover,
    actual_header_t,
    actual_t,
    handover_commit,
    handover_swap,
    target_t,
)
from catenary.core._histogram cimport (
    histogram_counts,
    histogram_reset,
    histogram_summary,
    histogram_t,
)
from catenary.core._lane cimport Lane
from catenary.core._native cimport (
    CAT_LAW_CAPSULE,
    CAT_LAW_VERSION,
    CAT_LINK_VIRTUAL_TIME,
    cat_add32,
    cat_fence,
    cat_futex_wait,
    cat_futex_wake,
    cat_law,
    cat_load_acquire32,
    cat_store_release32,
)
from catenary.core._thread cimport (
    cat_scheduling,
    scheduling_restore,
    scheduling_save,
    scheduling_text,
    thread_join,
    thread_schedule,
    thread_start,
    thread_t,
)

cdef enum:
    SIGNALS_NS = 10_000_000    # native cycles in a row, before signal handlers get their turn
    SILENCE_NS = 1_000_000_000 # and periods: longest wait for a cycle of a thread that lives


cdef void thread_loop(void *argument) noexcept nogil:
    """The native thread's life. Ends when asked, or when the link's wait fails."""
    cdef engine_t *e = <engine_t *>argument
    cdef int rc
    while not cat_load_acquire32(&e.thread.stop):
        rc = cycle_wait(&e.cycle)
        if rc == 0:
            native_cycle(e)
        elif rc != -EINTR:
            e.error = rc
            break
    cat_store_release32(&e.done, 1)
    cat_add32(&e.cycle.handover.published, 1)
    cat_futex_wake(&e.cycle.handover.published)


cdef inline void native_cycle(engine_t *e) noexcept nogil:
    if e.cycle.order == LAW:
        cycle_law(&e.cycle)
    else:
        cycle_threaded(&e.cycle)


def columns_by_bank(columns):
    """How many columns each bank has."""
    return [sum(column.bank == bank for column in columns) for bank in range(3)]


@cython.no_gc_clear  # its parts must outlive the native thread
cdef class Engine:
    def __cinit__(self, plan, link):
        if plan.order not in ORDERS:
            raise ValueError(f"order: {plan.order!r}, must be one of {', '.join(ORDERS)}")
        if not 1000 <= plan.period_ns <= 1 << 40:
            raise ValueError(f"period_ns: {plan.period_ns}")
        if not 0 <= plan.collect_deadline_ns <= plan.period_ns:
            raise ValueError(
                f"collect_deadline_ns: {plan.collect_deadline_ns}, must lie in the period"
                f" of {plan.period_ns}"
            )
        if plan.priority is not None and not 1 <= plan.priority <= 99:
            raise ValueError(f"priority: {plan.priority}, must be 1 to 99 or None")
        if plan.cpu is not None and not 0 <= plan.cpu < 1024:
            raise ValueError(f"cpu: {plan.cpu}")
        if not 0 <= plan.lead_ns < plan.period_ns:
            raise ValueError(f"lead_ns: {plan.lead_ns}, must be less than the period")
        self.e.thread.priority = plan.priority or 0
        self.e.thread.cpu = -1 if plan.cpu is None else plan.cpu
        self.lead = plan.lead_ns
        self.frames = Frames(plan, link)
        self.lane = Lane(plan.period_ns)
        self.axes = Axes(plan)
        self.handover = Handover(
            len(plan.axes),
            len(plan.sync_units),
            columns_by_bank(plan.input_columns),
            columns_by_bank(plan.output_columns),
        )
        self.connect(plan)
        self._buffers = self.handover.fields()

    cdef connect(self, plan):
        """Lets the parts know each other."""
        cdef cycle_t *c = &self.e.cycle
        cdef uint32_t i
        cdef int slot
        c.records = <record_t *>calloc(RECORDS, sizeof(record_t))
        c.histograms = <histogram_t *>calloc(PHASES, sizeof(histogram_t))
        self.spare_histograms = <histogram_t *>calloc(PHASES, sizeof(histogram_t))
        if not (c.records and c.histograms and self.spare_histograms):
            raise MemoryError
        self.frames.c.lane = &self.lane.c
        self.axes.c.image = &self.frames.c.image
        c.link = self.frames.c.link
        c.image = &self.frames.c.image
        c.axes = &self.axes.c
        c.lane = &self.lane.c
        c.handover = &self.handover.c
        c.order = ORDERS[plan.order]
        c.period = plan.period_ns
        c.collect_deadline = plan.collect_deadline_ns
        c.lost_limit = plan.lost_limit
        self.h = &self.handover.c
        self.virtual = c.link.flags & CAT_LINK_VIRTUAL_TIME != 0
        self.native = c.order != INLINE and not self.virtual
        self.left = -1
        for slot in range(4):
            for i in range(c.axes.axis_count):
                self.h.target[slot].mode[i] = c.axes.axes[i].mode
        for i in range(c.axes.axis_count):
            self.h.actual[PRIVATE].position[i] = c.axes.axes[i].position
            self.h.actual[PRIVATE].velocity[i] = c.axes.axes[i].velocity
            self.h.actual[PRIVATE].torque[i] = c.axes.axes[i].torque

    # ---- life

    def start(self):
        cdef int rc
        if self.running:
            raise RuntimeError("the engine is running")
        frames_flush(&self.frames.c)
        self.e.error = 0
        self.e.done = 0
        self.left = -1
        handover_swap(self.h)  # what an earlier run left
        self.e.thread.body = thread_loop
        self.e.thread.argument = &self.e
        if self.native:
            cycle_start(&self.e.cycle)
            rc = thread_start(&self.e.thread)
            if rc < 0:
                raise OSError(-rc, f"native thread: {os.strerror(-rc)}")
        elif not self.virtual:
            self.saved_scheduling = scheduling_save(&self.scheduling_before) == 0
            thread_schedule(&self.e.thread)
            cycle_start(&self.e.cycle)
        else:
            cycle_start(&self.e.cycle)
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

    # ---- steps

    def next(self, int64_t timeout_ns=SILENCE_NS):
        return self.step(timeout_ns)

    cdef uint32_t step(self, int64_t timeout_ns=SILENCE_NS) except? 0xFFFFFFFF:
        if not self.running:
            raise RuntimeError("the engine is not running: start it first")
        if self.native:
            return self.step_native(timeout_ns)
        if self.e.cycle.order == INLINE:
            self.inline_outputs(True)
            self.inline_inputs()
        else:
            self.commit(False)
            self.lockstep()
        axes_follow(&self.axes.c, &self.h.actual[PRIVATE], &self.h.target[PRIVATE])
        return self.h.actual[PRIVATE].header.flags

    cdef actual_header_t *actual_header(self) noexcept:
        """Of the cycle that Python's actual values belong to; lives as long as the engine."""
        return self.h.actual[PRIVATE].header

    cdef void inline_outputs(self, bint application) noexcept nogil:
        """Once a cycle: a wait that a signal ended must not send a second time."""
        if not self.emitted:
            cycle_outputs(&self.e.cycle, &self.h.target[PRIVATE], application)
            self.emitted = True

    cdef int inline_inputs(self) except -1:
        """The wait, and the half of the cycle behind it, in Python's thread. With a lead it wakes
        ahead of the instant, takes the GIL back and calls the rehearsal, if there is time: then
        what Python needs next is in the caches when the inputs come."""
        cdef cycle_t *c = &self.e.cycle
        cdef int rc
        while True:
            if self.virtual:
                rc = cycle_sleep(c, 0)
            else:
                with nogil:
                    rc = cycle_sleep(c, self.lead)
            if rc == 0:
                break
            self.interrupted(rc)
        if self.rehearsal is not None and 3 * (c.next - self.now_ns()) > self.lead > 0:
            self.rehearsal()
        cycle_open(c)
        cycle_inputs(c, &self.h.actual[PRIVATE])
        cycle_usable(c)
        self.emitted = False
        return 0

    cdef int lockstep(self) except -1:
        """One cycle of an order that has its own thread in real time, in the caller's here."""
        cdef actual_header_t *header = self.h.actual[PRIVATE].header
        cdef uint64_t before = header.number
        cdef int rc
        while True:
            rc = cycle_wait(&self.e.cycle)
            if rc == 0:
                native_cycle(&self.e)
                handover_swap(self.h)
                if before > 0 and header.number > before + 1:
                    header.flags |= LATE  # cycles happened in `spend`
                self.left = self.now_ns()
                return 0
            self.interrupted(rc)

    cdef uint32_t step_native(self, int64_t timeout_ns) except? 0xFFFFFFFF:
        cdef actual_header_t *header = self.h.actual[PRIVATE].header
        cdef uint64_t before = header.number
        cdef uint32_t flags
        self.commit(False)
        flags = self.await_cycle(timeout_ns)
        axes_follow(&self.axes.c, &self.h.actual[PRIVATE], &self.h.target[PRIVATE])
        self.left = self.now_ns()
        if flags:
            return header.flags | flags
        if before > 0 and header.number > before + 1:
            header.flags |= LATE
        return header.flags

    cdef void commit(self, bint hold) noexcept:
        cdef target_t *target = &self.h.target[PRIVATE]
        target.header.hold = hold
        target.header.seen = self.h.actual[PRIVATE].header.number
        target.header.process_ns = -1
        if self.left >= 0 and not hold:
            target.header.process_ns = self.now_ns() - self.left
        handover_commit(self.h)

    cdef int await_cycle(self, int64_t timeout_ns) except -1:
        """Swaps the newest cycle in, waiting for one if need be. 0, NONE or STOPPED."""
        cdef int64_t deadline = -1
        cdef int64_t left
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
            cat_fence()  # waiting before published is read: the writer does it the other way round
            seen = cat_load_acquire32(&self.h.published)
            rc = 0
            if not handover_swap(self.h):
                with nogil:
                    if not cat_load_acquire32(&self.e.done):
                        rc = cat_futex_wait(&self.h.published, seen, left)
            else:
                cat_store_release32(&self.h.waiting, 0)
                return 0
            cat_store_release32(&self.h.waiting, 0)
            if rc == -EINTR:
                PyErr_CheckSignals()
        return 0

    def run(self, int64_t cycles):
        if not self.running:
            raise RuntimeError("the engine is not running: start it first")
        flags = self.hold(cycles, False, 0)
        self.left = -1
        return flags

    cdef uint32_t hold(self, int64_t cycles, bint until_stopped, int64_t deadline) except? 0xFFFFFFFF:
        """Cycles without an application: so many, or until nothing moves or the deadline [ns]."""
        cdef actual_t *actual = &self.h.actual[PRIVATE]
        cdef int64_t batch
        cdef uint32_t flags = actual.header.flags
        if self.e.cycle.order != INLINE:
            self.commit(True)
            handover_swap(self.h)  # cycles are counted from the commit on
        while cycles > 0:
            batch = 1 if until_stopped else min(cycles, max(SIGNALS_NS // self.e.cycle.period, 1))
            flags = self.hold_native(batch) if self.native else self.hold_here(batch)
            if flags & (STOPPED | NONE):
                break
            PyErr_CheckSignals()
            cycles -= batch
            if until_stopped and (actual.header.moving == 0 or self.now_ns() >= deadline):
                break
        self.take_commanded()
        return flags

    cdef uint32_t hold_native(self, int64_t cycles) except? 0xFFFFFFFF:
        """Lets the native thread do so many cycles."""
        cdef uint64_t last = self.h.actual[PRIVATE].header.number + cycles
        cdef uint32_t flags
        while self.h.actual[PRIVATE].header.number < last:
            flags = self.await_cycle(SILENCE_NS + 4 * self.e.cycle.period)
            if flags:
                return self.h.actual[PRIVATE].header.flags | flags
        return self.h.actual[PRIVATE].header.flags

    cdef uint32_t hold_here(self, int64_t cycles) except? 0xFFFFFFFF:
        """Does so many cycles in the caller's thread, without the GIL."""
        cdef cycle_t *c = &self.e.cycle
        cdef int rc = 0
        while cycles > 0:
            with nogil:
                while cycles > 0 and rc == 0:
                    if c.order == INLINE:
                        self.inline_outputs(False)
                        rc = cycle_wait(c)
                        if rc == 0:
                            cycle_inputs(c, &self.h.actual[PRIVATE])
                            cycle_usable(c)
                            self.emitted = False
                    else:
                        rc = cycle_wait(c)
                        if rc == 0:
                            native_cycle(&self.e)
                            handover_swap(self.h)
                    if rc == 0:
                        cycles -= 1
            if rc != 0:
                self.interrupted(rc)
                rc = 0
        return self.h.actual[PRIVATE].header.flags

    cdef void take_commanded(self) noexcept:
        """The application goes on from what is being sent."""
        cdef actual_t *actual = &self.h.actual[PRIVATE]
        cdef target_t *target = &self.h.target[PRIVATE]
        cdef uint32_t axes = self.h.counts.axes
        memcpy(target.position, actual.commanded_position, axes * sizeof(double))
        memcpy(target.velocity, actual.commanded_velocity, axes * sizeof(double))
        memcpy(target.torque, actual.commanded_torque, axes * sizeof(double))
        axes_follow(&self.axes.c, actual, target)

    cdef int interrupted(self, int rc) except -1:
        """After a wait that failed: signal handlers, or OSError."""
        if rc == -EINTR:
            PyErr_CheckSignals()
            return 0
        raise OSError(-rc, f"link: {os.strerror(-rc)}")

    def spend(self, int64_t duration_ns):
        cdef int64_t until
        if duration_ns < 0:
            raise ValueError(f"duration_ns: {duration_ns}")
        if not self.running:
            raise RuntimeError("the engine is not running: start it first")
        if not self.virtual:
            raise RuntimeError("on this link time passes by itself")
        until = self.now_ns() + duration_ns
        if self.e.cycle.order != INLINE:
            while self.e.cycle.next <= until:
                self.spend_cycle()
        self.interrupted_wait(until)

    cdef int spend_cycle(self) except -1:
        """A cycle that happens while the application computes: it does not see it yet."""
        cdef int rc = cycle_wait(&self.e.cycle)
        if rc == 0:
            native_cycle(&self.e)
            return 0
        return self.interrupted(rc)

    cdef int interrupted_wait(self, int64_t until) except -1:
        cdef int rc
        while self.now_ns() < until:
            rc = self.e.cycle.link.wait_until(self.e.cycle.link.self, until, 0)
            if rc < 0:
                self.interrupted(rc)
        return 0

    def quick_stop_all(self):
        cat_add32(&self.axes.c.stop_asked, 1)

    def run_until_stopped(self, int64_t timeout_ns):
        if not self.running:
            raise RuntimeError("the engine is not running: start it first")
        self.hold(1 << 62, True, self.now_ns() + timeout_ns)
        return self.h.actual[PRIVATE].header.moving == 0

    # ---- the cycle that `actual` belongs to

    cdef inline int64_t now_ns(self) noexcept:
        return self.e.cycle.link.now(self.e.cycle.link.self)

    def now(self):
        return self.now_ns()

    @property
    def buffers(self):
        return dict(self._buffers)

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

    # ---- figures

    @property
    def counters(self):
        frames = self.frames.c.counters
        return {
            "cycles": self.e.cycle.number,
            "lost": self.e.cycle.lost,
            "late": self.e.cycle.late,
            "uncommitted": self.e.cycle.uncommitted,
            "stale": frames.stale,
            "alien": frames.alien,
            "corrupt": frames.corrupt,
            "duplicate": frames.duplicate,
            "unprocessed": frames.unprocessed,
            "lane_sent": self.lane.c.sent,
            "lane_received": self.lane.c.received,
            "lane_dropped": self.lane.c.dropped,
            "send_errors": frames.send_errors,
            "receive_errors": frames.receive_errors,
        }

    def histograms(self):
        return {
            name: histogram_summary(&self.e.cycle.histograms[phase])
            for name, phase in PHASE_NAMES.items()
        }

    def histogram_counts(self, str phase not None):
        if phase not in PHASE_NAMES:
            raise ValueError(f"phase {phase!r}: must be one of {', '.join(PHASE_NAMES)}")
        return histogram_counts(&self.e.cycle.histograms[<int>PHASE_NAMES[phase]])

    def reset_histograms(self):
        """By exchanging them: the native thread may be adding to the old ones this very moment."""
        cdef histogram_t *old = self.e.cycle.histograms
        cdef int phase
        for phase in range(PHASES):
            histogram_reset(&self.spare_histograms[phase])
        cat_fence()
        self.e.cycle.histograms = self.spare_histograms
        self.spare_histograms = old

    def log(self):
        cdef uint64_t last = self.e.cycle.number
        cdef uint64_t count = min(last, <uint64_t>LOG_LENGTH)
        cdef uint64_t number
        parts = []
        for number in range(last - count + 1, last + 1):
            parts.append((<char *>&self.e.cycle.records[number % RECORDS])[: sizeof(record_t)])
        return b"".join(parts)

    @property
    def scheduling(self):
        if self.virtual:
            return "virtual time"
        return scheduling_text(&self.e.thread)

    # ---- the acyclic lane

    def lane_push(self, bytes frame not None):
        return self.lane.push(frame)

    def lane_pop(self):
        return self.lane.pop()

    def lane_wait(self, int64_t timeout_ns):
        return self.lane.wait(timeout_ns)

    def set_rehearsal(self, rehearsal):
        self.rehearsal = rehearsal

    # ---- law

    def set_law(self, law):
        if self.running:
            raise RuntimeError("a law is set while the engine is stopped")
        if law is not None and not PyCapsule_IsValid(law, CAT_LAW_CAPSULE):
            raise ValueError("law: not a capsule \"catenary.law\"")
        cdef const cat_law *table = NULL
        if law is not None:
            table = <const cat_law *>PyCapsule_GetPointer(law, CAT_LAW_CAPSULE)
            if table.version != CAT_LAW_VERSION:
                raise ValueError(f"law: table version {table.version}")
        self.law = law
        self.e.cycle.law = table
        self.e.cycle.law_done = 0

    def __dealloc__(self):
        with nogil:
            thread_join(&self.e.thread)
        free(self.e.cycle.records)
        free(self.e.cycle.histograms)
        free(self.spare_histograms)
