/* Releases, deadlines and statistics of a periodic or sporadic task, in shared memory. The task's
 * own thread writes the job and the figures; other threads write `stop`, `period` and signals.
 * Time budget per job: two readings of three clocks and of getrusage, about 2 us.
 */
#ifndef CATENARY_TASK_BLOCK_H
#define CATENARY_TASK_BLOCK_H

#include <stdint.h>
#include <sys/resource.h>

#include "atomics.h"
#include "clock.h"
#include "histogram.h"
#include "machine_time.h"

#define TASK_SIGNALS 64               /* maximum of pending signals */
#define TASK_FAILURE_SIZE 4096
#define TASK_SCHEDULING_SIZE 256

enum { TASK_NEW, TASK_STARTED, TASK_ENDED, TASK_FAILED };

/* quantities of a job; each has a histogram */
enum {
    FIGURE_PERIOD,                    /* from start to start [ns] */
    FIGURE_JITTER,                    /* from the release to the start [ns] */
    FIGURE_RESPONSE,                  /* from the release to the end [ns] */
    FIGURE_EXECUTION,                 /* processor time of the thread [ns]; on a virtual clock, the time spent */
    FIGURE_PAGE_FAULTS,
    FIGURE_SWITCHES,                  /* involuntary context switches */
    FIGURE_COLLECTIONS,               /* of Python's garbage collector, in its process */
    FIGURES
};

typedef struct task_usage {
    int64_t execution;
    int64_t page_faults;
    int64_t switches;
    int64_t collections;
} task_usage;

typedef struct task_block {
    machine_time timer;
    uint32_t state;
    uint32_t stop;
    uint32_t sporadic;
    uint32_t skip;                    /* after a miss, skip the releases that have passed */
    int64_t origin;                   /* time of the first release; 0 until it is set */
    uint32_t origin_set;              /* futex word */
    int32_t process;
    int64_t period;
    int64_t deadline;                 /* 0 if it equals the period */

    uint64_t signalled;               /* sporadic tasks: number of signals; their times follow */
    uint64_t signals_refused;
    uint64_t taken;
    int64_t signal_times[TASK_SIGNALS];

    uint64_t number;                  /* of the running or last job */
    uint32_t busy;                    /* 1 between the start and the end of a job */
    uint32_t missed;                  /* the last job ended after its deadline */
    int64_t release;
    int64_t start;
    int64_t spent;
    task_usage before;
    int64_t collections;

    uint64_t released;
    uint64_t misses;
    uint64_t skipped;
    char failure[TASK_FAILURE_SIZE];          /* texts end with a zero */
    char scheduling[TASK_SCHEDULING_SIZE];
    cat_histogram figures[FIGURES];
} task_block;

static task_usage task_usage_now(const task_block *b, int is_virtual) {
    struct rusage usage;
    getrusage(RUSAGE_THREAD, &usage);
    return (task_usage){
        .execution = is_virtual ? b->spent : machine_read(CLOCK_THREAD_CPUTIME_ID),
        .page_faults = usage.ru_minflt + usage.ru_majflt,
        .switches = usage.ru_nivcsw,
        .collections = b->collections,
    };
}

static int64_t task_load(const int64_t *p) { return (int64_t)cat_load_relaxed64((const uint64_t *)p); }

static int64_t task_deadline(const task_block *b) {
    int64_t deadline = task_load(&b->deadline);
    return deadline ? deadline : task_load(&b->period);
}

/* Return the release time of the next signal: at least one period after the last release. Return
 * CAT_CLOCK_FOREVER if no signal is pending. */
static int64_t task_next_signal(const task_block *b) {
    if (cat_load_acquire64(&b->signalled) == b->taken) return CAT_CLOCK_FOREVER;
    int64_t signalled = task_load(&b->signal_times[b->taken % TASK_SIGNALS]);
    int64_t allowed = b->released ? b->release + task_load(&b->period) : b->origin;
    return signalled > allowed ? signalled : allowed;
}

static int64_t task_next_release(task_block *b, int64_t now) {
    if (b->sporadic) return task_next_signal(b);
    if (b->released == 0) return b->origin;
    int64_t period = task_load(&b->period);
    int64_t next = b->release + period;
    if (!(b->skip && b->missed) || next >= now) return next;
    int64_t passed = (now - next + period - 1) / period;
    b->skipped += (uint64_t)passed;
    b->release += passed * period;
    b->missed = 0;
    return next + passed * period;
}

static void task_begin(task_block *b, const cat_clock *clock, int64_t release) {
    int64_t now = clock->now(clock->self);
    if (b->released) {
        cat_histogram_add(&b->figures[FIGURE_PERIOD], now - b->start);
        b->number++;
    }
    b->taken += b->sporadic;
    b->released++;
    b->release = release;
    b->start = now;
    b->missed = 0;
    b->before = task_usage_now(b, clock->flags & CAT_CLOCK_VIRTUAL);
    cat_histogram_add(&b->figures[FIGURE_JITTER], now - release);
    cat_store_release32(&b->busy, 1);
}

/* Wait for the next release. Return 1 if a job begins, 0 after a stop request, -EINTR if a signal
 * interrupted the wait. */
static int task_wait(task_block *b, const cat_clock *clock) {
    for (;;) {
        if (cat_load_acquire32(&b->stop)) return 0;
        int64_t now = clock->now(clock->self);
        int64_t release = task_next_release(b, now);
        if (release <= now) {
            task_begin(b, clock, release);
            return 1;
        }
        int error = clock->wait_until(clock->self, release);
        if (error < 0) return error;
    }
}

/* End the current job, if any. Return 1 if it missed its deadline. */
static int task_finish(task_block *b, const cat_clock *clock) {
    if (!b->busy) return 0;
    int64_t response = clock->now(clock->self) - b->release;
    task_usage now = task_usage_now(b, clock->flags & CAT_CLOCK_VIRTUAL);
    cat_histogram_add(&b->figures[FIGURE_RESPONSE], response);
    cat_histogram_add(&b->figures[FIGURE_EXECUTION], now.execution - b->before.execution);
    cat_histogram_add(&b->figures[FIGURE_PAGE_FAULTS], now.page_faults - b->before.page_faults);
    cat_histogram_add(&b->figures[FIGURE_SWITCHES], now.switches - b->before.switches);
    cat_histogram_add(&b->figures[FIGURE_COLLECTIONS], now.collections - b->before.collections);
    b->missed = response > task_deadline(b);
    b->misses += b->missed;
    cat_store_release32(&b->busy, 0);
    return (int)b->missed;
}

/* Release a sporadic task once. Return 0 if too many signals are pending; the new one is
 * then dropped and counted. */
static int task_signal(task_block *b, int64_t now) {
    uint64_t waiting = cat_load_acquire64(&b->signalled) - cat_load_relaxed64(&b->taken);
    if (waiting >= TASK_SIGNALS) {
        __atomic_fetch_add(&b->signals_refused, 1, __ATOMIC_RELAXED);
        return 0;
    }
    uint64_t number = __atomic_load_n(&b->signalled, __ATOMIC_RELAXED);
    do {
        __atomic_store_n(&b->signal_times[number % TASK_SIGNALS], now, __ATOMIC_RELAXED);
    } while (!__atomic_compare_exchange_n(&b->signalled, &number, number + 1, 0, __ATOMIC_ACQ_REL,
                                          __ATOMIC_RELAXED));
    return 1;
}

#endif
