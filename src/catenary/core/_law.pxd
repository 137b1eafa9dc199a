from libc.stdint cimport int64_t, uint32_t, uint64_t

from catenary.core._axes cimport axes_t
from catenary.core._handover cimport actual_t, target_t
from catenary.core._memory cimport cat_memory
from catenary.core._native cimport cat_law_monitor, cat_law_numbers, cat_law_step, cat_triple

cdef enum:  # state of a law
    WAITING = 0                # the cycle has not started the law yet
    RUNNING = 1
    FINISHED = 2
    STOPPED_BY_APPLICATION = 3
    RAISED = 4
    NEVER_RETURNED = 5
    NOT_FINITE = 6
    OVERRUN = 7

cdef struct exchange_t:        # numbers that are replaced together
    uint32_t count
    cat_triple triple
    double *slots[3]

cdef struct law_t:
    cat_law_step step
    cat_law_numbers numbers    # memory of the law
    exchange_t memory_in
    exchange_t memory_out
    exchange_t parameters_in
    int64_t budget             # [ns] per step; 0: none
    int64_t limit              # [ns] of processor time in one call, after which it counts as stuck
    uint32_t overrun_limit     # number of steps in a row over the budget that end the law
    uint32_t overruns_in_row
    uint64_t overruns
    uint64_t steps
    int64_t longest            # longest step [ns]
    int64_t begun              # first cycle start
    uint64_t ended_at          # number of the cycle
    uint32_t status            # futex word
    uint32_t axis              # NOT_FINITE: number of the axis
    bint threaded              # the cycle runs in another thread: memory is copied on request
    uint32_t wanted            # number of requests for the memory
    uint32_t given             # last request that was answered; futex word

cdef class Law:
    """Compiled function (native/law.h) with its memory and parameters.

    A step that computes for 20 ms (twice the budget, if that is more) is aborted by a monitor
    thread. The laws of an engine share this thread; the first one sets its priority. The caller
    keeps the owner of `address` alive.

    Args:
        address: Address of the function.
        memory: Initial memory of the law, at most 4096 numbers.
        parameters: Parameters set by the application, at most 4096 numbers.
        budget_ns: Budget of one step [ns]; 0: none.
        overrun_limit: Number of steps in a row over the budget that stop the drives.
        priority: SCHED_FIFO priority of the monitor; 0: that of the caller.

    Raises:
        ValueError: A number is out of range.
    """
    cdef law_t c
    cdef cat_law_monitor rehearsal
    cdef int priority              # priority of the monitor
    cdef cat_memory memory_block   # all its numbers
    cdef allocate(self, exchange_t *numbers, double **place)
    cdef fill(self, exchange_t *numbers, values)
    cdef int request_memory(self) except -1
    cdef bint ended_before(self, uint64_t number) noexcept
    cdef bint failed(self) noexcept
    cdef void supersede(self) noexcept

cdef int law_monitor_start(cat_law_monitor *monitor, int priority) except -1
cdef void law_monitor_stop(cat_law_monitor *monitor) noexcept
cdef void law_monitor_park(cat_law_monitor *monitor) noexcept nogil
cdef bint law_begin(law_t *law, cat_law_monitor *monitor, int64_t instant) noexcept nogil
cdef void law_end(law_t *law, uint32_t status, uint64_t number) noexcept nogil
cdef bint law_run(law_t *law, cat_law_monitor *monitor, const axes_t *axes,
                  const actual_t *actual, target_t *target, int64_t instant,
                  uint64_t number) noexcept nogil
cdef void law_report(law_t *law) noexcept nogil
cdef bint law_took(law_t *law, int64_t duration, uint64_t number) noexcept nogil
