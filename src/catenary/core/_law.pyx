# cython: boundscheck=False, wraparound=False, cdivision=True
"""Law in the cycle: its memory and parameters, its budget, and its end.

Theory of operation. The law is a function of native/law.h. Parameters and a new memory are passed
through triple buffers and take effect together before a step. Its memory is copied for the
application after a step: on request if the cycle has its own thread (`wanted`, `given`), otherwise
each time. `status` is a futex word and contains the reason for the end. A step over the budget is
counted; `overrun_limit` of them in a row end the law. The engine's monitor aborts a step that never
returns.

Budget: 30 ns in addition to the law, without memory.
"""

import os

from cpython.exc cimport PyErr_CheckSignals
from libc.math cimport isfinite
from libc.stdint cimport int64_t, uint32_t, uint64_t, uintptr_t
from libc.stdlib cimport calloc, free
from libc.string cimport memcpy

from catenary.core._axes cimport axes_t
from catenary.core._guard cimport TORQUE, VELOCITY, quantity_of
from catenary.core._handover cimport actual_t, target_t
from catenary.core._memory cimport cat_memory_free, memory_take
from catenary.core._native cimport (
    CAT_LAW_ABORTED,
    CAT_LAW_FINISHED,
    CAT_LAW_GOES_ON,
    cat_change32,
    cat_futex_wait,
    cat_futex_wake,
    cat_law_call,
    cat_law_monitor,
    cat_law_monitor_activate,
    cat_law_monitor_park,
    cat_law_monitor_start,
    cat_law_monitor_stop,
    cat_law_numbers,
    cat_law_step,
    cat_load_acquire32,
    cat_store_release32,
    cat_triple_init,
    cat_triple_publish,
    cat_triple_take,
)

LAW_RUNNING = RUNNING
LAW_FINISHED = FINISHED
LAW_STOPPED = STOPPED_BY_APPLICATION
LAW_RAISED = RAISED
LAW_NEVER_RETURNED = NEVER_RETURNED
LAW_NOT_FINITE = NOT_FINITE
LAW_OVERRUN = OVERRUN
LAW_ABORTED = CAT_LAW_ABORTED

cdef enum:
    NUMBERS_MAX = 4096         # limits the time to copy them in every cycle
    STUCK_NS = 20_000_000      # processor time in one call, after which it counts as stuck
    REHEARSALS = 3
    ANSWER_NS = 200_000_000    # longest wait for a copy of the memory
    SLICE_NS = 10_000_000      # longest wait between two checks for signals


# ---- numbers that are replaced together

cdef inline void give(exchange_t *numbers, const double *values) noexcept nogil:
    if numbers.count:
        memcpy(numbers.slots[numbers.triple.back], values, numbers.count * sizeof(double))
        cat_triple_publish(&numbers.triple)


cdef inline bint take(exchange_t *numbers, double *values) noexcept nogil:
    """Take the newest numbers; return False if nothing is new."""
    if numbers.count == 0 or not cat_triple_take(&numbers.triple):
        return False
    memcpy(values, numbers.slots[numbers.triple.front], numbers.count * sizeof(double))
    return True


# ---- in the cycle

cdef bint law_begin(law_t *law, cat_law_monitor *monitor, int64_t instant) noexcept nogil:
    """Begin a law and activate its monitor. Return False if the application has withdrawn it."""
    law.begun = instant
    if not cat_change32(&law.status, WAITING, RUNNING):
        return False
    cat_law_monitor_activate(monitor, law.limit)
    return True


cdef void law_end(law_t *law, uint32_t status, uint64_t number) noexcept nogil:
    law.ended_at = number
    give(&law.memory_out, law.numbers.memory)
    cat_store_release32(&law.status, status)
    cat_futex_wake(&law.status)


cdef int first_not_finite(const axes_t *axes, const target_t *target) noexcept nogil:
    """Return the first axis with a set-point that is NaN or infinite; -1: none."""
    cdef uint32_t i
    cdef double value
    for i in range(axes.axis_count):
        if quantity_of(target.mode[i]) == VELOCITY:
            value = target.velocity[i]
        elif quantity_of(target.mode[i]) == TORQUE:
            value = target.torque[i]
        else:
            value = target.position[i]
        if not isfinite(value):
            return <int>i
    return -1


cdef bint law_run(law_t *law, cat_law_monitor *monitor, const axes_t *axes,
                  const actual_t *actual, target_t *target, int64_t instant,
                  uint64_t number) noexcept nogil:
    """Run one step; end the law if it has finished or failed. Return True if it continues.

    Targets of a failed step must not be sent.
    """
    cdef int rc, axis
    take(&law.parameters_in, law.numbers.parameters)
    take(&law.memory_in, law.numbers.memory)
    rc = cat_law_call(&monitor.guard, law.step, actual.header, target.header,
                      &law.numbers, <double>(instant - law.begun) * 1e-9)
    law.steps += 1
    if rc != CAT_LAW_GOES_ON and rc != CAT_LAW_FINISHED:
        law_end(law, NEVER_RETURNED if rc == CAT_LAW_ABORTED else RAISED, number)
        return False
    axis = first_not_finite(axes, target)
    if axis >= 0:
        law.axis = <uint32_t>axis
        law_end(law, NOT_FINITE, number)
        return False
    if rc == CAT_LAW_FINISHED:
        law_end(law, FINISHED, number)
        return False
    return True


cdef void law_report(law_t *law) noexcept nogil:
    """Copy the memory of a law that continues: on request if `threaded`, otherwise each time."""
    cdef uint32_t wanted
    if not law.threaded:
        give(&law.memory_out, law.numbers.memory)
        return
    wanted = cat_load_acquire32(&law.wanted)
    if wanted != law.given:
        give(&law.memory_out, law.numbers.memory)
        cat_store_release32(&law.given, wanted)
        cat_futex_wake(&law.given)


cdef bint law_took(law_t *law, int64_t duration, uint64_t number) noexcept nogil:
    """Record the duration of a step. End the law after `overrun_limit` overruns in a row.

    Return True if it continues.
    """
    law.longest = max(law.longest, duration)
    if law.budget == 0 or duration <= law.budget:
        law.overruns_in_row = 0
        return True
    law.overruns += 1
    law.overruns_in_row += 1
    if law.overruns_in_row < law.overrun_limit:
        return True
    law_end(law, OVERRUN, number)
    return False


# ---- the monitor

cdef int law_monitor_start(cat_law_monitor *monitor, int priority) except -1:
    """Start the thread that watches the laws of one runner, unless it runs already."""
    cdef int rc = cat_law_monitor_start(monitor, priority)
    if rc < 0:
        raise OSError(-rc, f"cannot start the thread that watches laws: {os.strerror(-rc)}")
    return 0


cdef void law_monitor_stop(cat_law_monitor *monitor) noexcept:
    with nogil:
        cat_law_monitor_stop(monitor)


cdef void law_monitor_park(cat_law_monitor *monitor) noexcept nogil:
    cat_law_monitor_park(monitor)


# ---- Python interface

cdef class Law:
    def __cinit__(self, uintptr_t address, memory, parameters, *, int64_t budget_ns,
                  uint32_t overrun_limit, int priority):
        cdef double *place
        if address == 0:
            raise ValueError("address: 0 is not the address of a function")
        if budget_ns < 0 or overrun_limit == 0:
            raise ValueError(
                f"budget_ns: {budget_ns} (must not be negative), overrun_limit: {overrun_limit}"
                " (must be at least 1)"
            )
        if max(len(memory), len(parameters)) > NUMBERS_MAX:
            raise ValueError(f"a law has at most {NUMBERS_MAX} numbers of memory or parameters")
        self.c.step = <cat_law_step><void *>address
        self.c.budget = budget_ns
        self.c.overrun_limit = overrun_limit
        self.c.memory_in.count = self.c.memory_out.count = len(memory)
        self.c.parameters_in.count = len(parameters)
        count = 7 * len(memory) + 4 * len(parameters)
        place = <double *>memory_take(&self.memory_block, count, sizeof(double))
        self.c.numbers.memory = place
        self.c.numbers.memory_count = len(memory)
        place += len(memory)
        self.c.numbers.parameters = place
        self.c.numbers.parameter_count = len(parameters)
        place += len(parameters)
        self.allocate(&self.c.memory_in, &place)
        self.allocate(&self.c.memory_out, &place)
        self.allocate(&self.c.parameters_in, &place)
        for i, value in enumerate(memory):
            self.c.numbers.memory[i] = value
        for i, value in enumerate(parameters):
            self.c.numbers.parameters[i] = value
        give(&self.c.memory_out, self.c.numbers.memory)
        self.c.limit = max(STUCK_NS, 2 * budget_ns)
        self.priority = priority

    cdef allocate(self, exchange_t *numbers, double **place):
        cdef int slot
        cat_triple_init(&numbers.triple)
        for slot in range(3):
            numbers.slots[slot] = place[0]
            place[0] += numbers.count

    cdef fill(self, exchange_t *numbers, values):
        cdef double *slot
        if len(values) != numbers.count:
            raise ValueError(f"expected {numbers.count} numbers, received {len(values)}")
        checked = [float(value) for value in values]
        slot = numbers.slots[numbers.triple.back]  # only now, because float() may run arbitrary code
        for i, value in enumerate(checked):
            slot[i] = value
        if numbers.count:
            cat_triple_publish(&numbers.triple)

    def set_memory(self, values):
        self.fill(&self.c.memory_in, values)

    def set_parameters(self, values):
        self.fill(&self.c.parameters_in, values)

    @property
    def memory(self):
        cdef exchange_t *numbers = &self.c.memory_out
        cdef uint32_t i
        if numbers.count and self.c.threaded:
            self.request_memory()
        if numbers.count:
            cat_triple_take(&numbers.triple)
        return [numbers.slots[numbers.triple.front][i] for i in range(numbers.count)]

    cdef int request_memory(self) except -1:
        """Wait until the cycle has copied the memory after its next step, or the law has ended.

        The wait ends after ANSWER_NS in any case. Then the last copy is used.
        """
        cdef uint32_t wanted = self.c.wanted + 1
        cdef uint32_t given
        cdef int64_t waited = 0
        cat_store_release32(&self.c.wanted, wanted)
        while waited < ANSWER_NS and cat_load_acquire32(&self.c.status) <= RUNNING:
            given = cat_load_acquire32(&self.c.given)
            if given == wanted:
                return 0
            with nogil:
                cat_futex_wait(&self.c.given, given, SLICE_NS)
            waited += SLICE_NS
            PyErr_CheckSignals()
        return 0

    @property
    def status(self):
        return cat_load_acquire32(&self.c.status)

    @property
    def ended(self):
        return cat_load_acquire32(&self.c.status) > RUNNING

    cdef void supersede(self) noexcept:
        """Withdraw the law if the cycle has not started it yet."""
        if cat_change32(&self.c.status, WAITING, STOPPED_BY_APPLICATION):
            give(&self.c.memory_out, self.c.numbers.memory)
            cat_futex_wake(&self.c.status)

    cdef bint ended_before(self, uint64_t number) noexcept:
        """Return True if the law ended in this cycle or before."""
        return cat_load_acquire32(&self.c.status) > RUNNING and number >= self.c.ended_at

    cdef bint failed(self) noexcept:
        return cat_load_acquire32(&self.c.status) > STOPPED_BY_APPLICATION

    @property
    def axis(self):
        return self.c.axis

    @property
    def figures(self):
        return {
            "steps": self.c.steps,
            "overruns": self.c.overruns,
            "longest_ns": self.c.longest,
        }

    def wait(self, int64_t timeout_ns):
        cdef uint32_t status = cat_load_acquire32(&self.c.status)
        if status <= RUNNING:
            with nogil:
                cat_futex_wait(&self.c.status, status, timeout_ns)
        return cat_load_acquire32(&self.c.status) > RUNNING

    def rehearse(self, bytes actual not None, bytes target not None):
        cdef int rc = CAT_LAW_GOES_ON
        cdef int k
        cdef cat_law_numbers copied = self.c.numbers
        cdef const char *source = actual
        cdef const char *wanted = target
        cdef size_t size = len(target)
        cdef size_t numbers = self.c.memory_in.count * sizeof(double)
        cdef size_t behind = (size // sizeof(double) + 1) * sizeof(double)
        cdef char *scratch = <char *>calloc(behind + numbers + 1, 1)
        if scratch == NULL:
            raise MemoryError
        copied.memory = <double *>(scratch + behind)
        try:
            law_monitor_start(&self.rehearsal, self.priority)
            cat_law_monitor_activate(&self.rehearsal, self.c.limit)
            for k in range(REHEARSALS):
                memcpy(scratch, wanted, size)
                memcpy(copied.memory, self.c.numbers.memory, numbers)
                with nogil:
                    rc = cat_law_call(
                        &self.rehearsal.guard, self.c.step, source, scratch, &copied, 0.0
                    )
                if rc == CAT_LAW_ABORTED:
                    break
            return rc
        finally:
            law_monitor_stop(&self.rehearsal)
            free(scratch)

    def __dealloc__(self):
        cat_memory_free(&self.memory_block)
