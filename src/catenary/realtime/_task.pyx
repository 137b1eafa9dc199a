# cython: boundscheck=False, wraparound=False, cdivision=True
"""Compiled part of tasks: the memory that supervisor and task share, and the task's releases.

This module waits (without the GIL), computes releases and updates all statistics.
"""

from cpython.exc cimport PyErr_CheckSignals
from libc.stdint cimport int32_t, int64_t, uint8_t, uint32_t, uint64_t
from libc.string cimport memcpy, memset, strlen

from catenary.realtime._clock cimport CAT_CLOCK_FOREVER, Memory, Timer, cat_clock

cdef extern from "atomics.h" nogil:
    uint32_t cat_load_acquire32(const uint32_t *p)
    void cat_store_release32(uint32_t *p, uint32_t v)
    void cat_store_release64(uint64_t *p, uint64_t v)

cdef extern from "futex.h" nogil:
    int cat_futex_wait_shared(uint32_t *word, uint32_t value, int64_t deadline_ns)
    void cat_futex_wake_shared(uint32_t *word)

cdef extern from "histogram.h" nogil:
    enum:
        CAT_BUCKETS
    ctypedef struct cat_histogram:
        uint64_t count
        int64_t low, high
        uint64_t buckets[1]
    int64_t cat_histogram_edge(uint32_t bucket)
    double cat_histogram_percentile(const cat_histogram *h, double fraction)
    double cat_histogram_mean(const cat_histogram *h)
    double cat_histogram_deviation(const cat_histogram *h)

cdef extern from "task_block.h" nogil:
    enum:
        TASK_FAILURE_SIZE, TASK_SCHEDULING_SIZE, FIGURES, TASK_NEW, TASK_STARTED, TASK_ENDED, TASK_FAILED
    ctypedef struct task_block:
        uint32_t state, stop, sporadic, skip, origin_set, busy
        int32_t process
        int64_t origin, period, deadline, release, start, spent, collections
        uint64_t number, released, misses, skipped, signals_refused
        char *failure
        char *scheduling
        cat_histogram *figures
    int64_t task_deadline(const task_block *b)
    int task_wait(task_block *b, const cat_clock *clock)
    int task_finish(task_block *b, const cat_clock *clock)
    int task_signal(task_block *b, int64_t now)

NEW, STARTED, ENDED, FAILED = TASK_NEW, TASK_STARTED, TASK_ENDED, TASK_FAILED
BLOCK_SIZE = sizeof(task_block)
FIGURE_NAMES = (
    "period", "jitter", "response", "execution", "page_faults", "switches", "collections"
)                                        # in the order of task_block.h
assert len(FIGURE_NAMES) == FIGURES


cdef str read_text(const char *text):
    return text[:strlen(text)].decode(errors="replace")


cdef void write_text(char *text, str value, size_t size):
    cdef bytes data = value.encode(errors="replace")[:size - 1]
    memcpy(text, <const char *>data, len(data))
    text[len(data)] = 0


cdef class Block:
    """Memory of one task.

    The task's thread writes the job and the figures. Other threads request a stop, change the
    period and set signals.
    """
    cdef Memory memory
    cdef task_block *c

    def __init__(self, memory, size_t offset=0):
        self.memory = Memory(memory)
        self.c = <task_block *>self.memory.at(offset, sizeof(task_block))

    def prepare(self, int64_t period_ns, int64_t deadline_ns, bint sporadic, bint skip):
        memset(self.c, 0, sizeof(task_block))
        self.c.period = period_ns
        self.c.deadline = deadline_ns
        self.c.sporadic = sporadic
        self.c.skip = skip

    def restart(self):
        self.c.state = TASK_NEW
        self.c.busy = 0
        self.c.failure[0] = 0
        self.c.process = 0

    def start_at(self, int64_t origin_ns):
        self.c.origin = origin_ns
        cat_store_release32(&self.c.origin_set, 1)
        cat_futex_wake_shared(&self.c.origin_set)

    def wait_for_start(self, int64_t deadline_ns):
        cdef int error
        while not cat_load_acquire32(&self.c.origin_set) and not cat_load_acquire32(&self.c.stop):
            with nogil:
                error = cat_futex_wait_shared(&self.c.origin_set, 0, deadline_ns)
            PyErr_CheckSignals()
            if error == -110:            # ETIMEDOUT
                return False
        return True

    def skip_to(self, int64_t now_ns):
        """Skip all releases that have passed, after a restart."""
        cdef int64_t passed
        if self.c.sporadic or now_ns <= self.c.origin:
            return
        passed = (now_ns - self.c.origin + self.c.period - 1) // self.c.period
        if self.c.released:
            passed = max((now_ns - self.c.release + self.c.period - 1) // self.c.period, 1)
            self.c.release += (passed - 1) * self.c.period
            self.c.skipped += passed - 1
        else:
            self.c.origin += passed * self.c.period

    @property
    def state(self):
        return cat_load_acquire32(&self.c.state)

    @state.setter
    def state(self, uint32_t state):
        cat_store_release32(&self.c.state, state)
        cat_futex_wake_shared(&self.c.state)

    def wait_while(self, uint32_t state, int64_t deadline_ns):
        with nogil:
            if cat_load_acquire32(&self.c.state) == state:
                cat_futex_wait_shared(&self.c.state, state, deadline_ns)
        PyErr_CheckSignals()

    @property
    def process(self):
        return self.c.process

    @process.setter
    def process(self, int32_t process):
        self.c.process = process

    def stop(self):
        cat_store_release32(&self.c.stop, 1)
        cat_futex_wake_shared(&self.c.origin_set)

    @property
    def stopped(self):
        return bool(cat_load_acquire32(&self.c.stop))

    @property
    def period_ns(self):
        return self.c.period

    @period_ns.setter
    def period_ns(self, int64_t period_ns):
        cat_store_release64(<uint64_t *>&self.c.period, <uint64_t>period_ns)

    @property
    def deadline_ns(self):
        return task_deadline(self.c)

    @property
    def origin_ns(self):
        return self.c.origin

    @property
    def sporadic(self):
        return bool(self.c.sporadic)

    def signal(self, int64_t now_ns):
        return bool(task_signal(self.c, now_ns))

    @property
    def busy(self):
        return bool(self.c.busy)

    @property
    def number(self):
        return self.c.number

    @property
    def release_ns(self):
        return self.c.release

    @property
    def counts(self):
        return self.c.released, self.c.misses, self.c.skipped, self.c.signals_refused

    @property
    def failure(self):
        return read_text(self.c.failure)

    @failure.setter
    def failure(self, str text):
        write_text(self.c.failure, text, TASK_FAILURE_SIZE)

    @property
    def scheduling(self):
        return read_text(self.c.scheduling)

    @scheduling.setter
    def scheduling(self, str text):
        write_text(self.c.scheduling, text, TASK_SCHEDULING_SIZE)

    def figure(self, int number):
        cdef const cat_histogram *h = self.histogram(number)
        if h.count == 0:
            return (0, 0.0, 0, 0, 0.0, 0.0, 0.0, 0.0)
        return (
            h.count,
            cat_histogram_mean(h),
            h.low,
            h.high,
            cat_histogram_deviation(h),
            cat_histogram_percentile(h, 0.5),
            cat_histogram_percentile(h, 0.99),
            cat_histogram_percentile(h, 0.999),
        )

    def buckets(self, int number):
        cdef const cat_histogram *h = self.histogram(number)
        cdef uint32_t k
        return [
            (cat_histogram_edge(k), cat_histogram_edge(k + 1), h.buckets[k])
            for k in range(CAT_BUCKETS)
            if h.buckets[k]
        ]

    cdef const cat_histogram *histogram(self, int number) except NULL:
        if not 0 <= number < FIGURES:
            raise ValueError(f"figure {number} is not within 0..{FIGURES - 1}")
        return &self.c.figures[number]


cdef class Releases:
    """Releases of one task. Only the thread of the task uses this object."""
    cdef Block block
    cdef Timer timer

    def __init__(self, Block block not None, Timer timer not None):
        self.block = block
        self.timer = timer

    def wait(self):
        cdef int result
        while True:
            with nogil:
                result = task_wait(self.block.c, &self.timer.table)
            if result >= 0:
                return bool(result)
            PyErr_CheckSignals()

    def finish(self):
        return bool(task_finish(self.block.c, &self.timer.table))

    def spend(self, int64_t duration_ns):
        if duration_ns < 0:
            raise ValueError(f"a duration of {duration_ns} ns is negative")
        self.timer.spend_some(duration_ns)
        self.block.c.spent += duration_ns

    def count_collection(self, str phase, dict info):
        """Count a run of the garbage collector; for gc.callbacks."""
        self.block.c.collections += phase == "stop"

    @property
    def number(self):
        return self.block.c.number

    @property
    def release_ns(self):
        return self.block.c.release

    @property
    def start_ns(self):
        return self.block.c.start
