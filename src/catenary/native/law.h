/* A control law: a function that runs natively between collect and emit, and the guard that gets the
 * thread out of one that does not come back.
 *
 * `actual` and `target` point to blocks of the core whose layout the engine tells (`law_fields`).
 * Targets start as what was commanded last; the core's limits apply to what the law leaves in them.
 */
#ifndef CATENARY_LAW_H
#define CATENARY_LAW_H

#include <errno.h>
#include <pthread.h>
#include <setjmp.h>
#include <signal.h>
#include <stdint.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>
#include "atomics.h"

#define CAT_LAW_GOES_ON 0
#define CAT_LAW_FINISHED 1
#define CAT_LAW_RAISED (-1)   /* an exception, an index out of bounds among them */
#define CAT_LAW_ABORTED (-2)  /* by the guard */

/* Numbers of the law: `memory` is its own, `parameters` the application's. */
typedef struct cat_law_numbers {
    double *memory;
    int64_t memory_count;
    double *parameters;
    int64_t parameter_count;
} cat_law_numbers;

/* `time` [s] since its first step. Must not block; CAT_LAW_GOES_ON, _FINISHED or _RAISED. */
typedef int (*cat_law_step)(const void *actual, void *target, double *memory, int64_t memory_count,
                            const double *parameters, int64_t parameter_count, double time);

/* Words that two threads or the signal handler share are atomic: `under_way`, `condemned`, `task` and
 * `stop`. Lock-free atomics are safe in a signal handler (C11 §7.14.1.1). */
typedef struct cat_law_guard {
    sigjmp_buf jump;
    uint64_t calls;               /* the runner's */
    uint64_t under_way;           /* number of the call; 0: none */
    uint64_t condemned;           /* the call that is to be given up */
    uint32_t task;                /* thread ID of the runner, for the kernel */
    uint32_t stop;                /* 1: the monitor ends */
    pthread_t runner;             /* the thread that calls */
    pthread_t monitor;
    uint32_t known;               /* the runner is ready to be interrupted */
    uint32_t watched;             /* the monitor runs */
    int64_t limit;                /* [ns] of the runner's processor time; set before the monitor runs */
} cat_law_guard;

#define CAT_LAW_SIGNAL (SIGRTMIN + 7)
#define CAT_LAW_LOOKS_NS 5000000

static void cat_law_give_up(int number, siginfo_t *info, void *context) {
    cat_law_guard *guard = (cat_law_guard *)info->si_value.sival_ptr;
    (void)number, (void)context;
    if (info->si_code != SI_QUEUE || !guard) return;
    if (cat_load_relaxed32(&guard->task) != (uint32_t)syscall(SYS_gettid)) return;
    uint64_t call = cat_load_relaxed64(&guard->under_way);
    if (call && call == cat_load_relaxed64(&guard->condemned)) siglongjmp(guard->jump, 1);
}

/* The processor time of a thread of this process [ns]; -1 if it has ended. The clock is named by the
 * thread ID (linux/posix-timers.h): unlike a pthread_t it may be used after the thread has ended. */
static inline int64_t cat_law_time_used(uint32_t task) {
    struct timespec used;
    clockid_t clock = (clockid_t)((~(unsigned)task << 3) | 6u);
    if (clock_gettime(clock, &used)) return -1;
    return used.tv_sec * 1000000000LL + used.tv_nsec;
}

/* Sends the signal that ends a call. Nothing happens if the thread has ended. */
static inline void cat_law_interrupt(cat_law_guard *guard, uint32_t task) {
    siginfo_t info = {0};
    info.si_signo = CAT_LAW_SIGNAL;
    info.si_code = SI_QUEUE;
    info.si_pid = getpid();
    info.si_uid = getuid();
    info.si_value.sival_ptr = guard;
    syscall(SYS_rt_tgsigqueueinfo, getpid(), task, CAT_LAW_SIGNAL, &info);
}

/* Checks every 5 ms whether the same call is still under way, and how long it has computed. */
static void *cat_law_watch(void *argument) {
    cat_law_guard *guard = (cat_law_guard *)argument;
    const struct timespec pause = {0, CAT_LAW_LOOKS_NS};
    uint64_t seen = 0;
    int64_t since = 0;
    while (!cat_load_acquire32(&guard->stop)) {
        uint64_t call = cat_load_acquire64(&guard->under_way);
        uint32_t task = cat_load_relaxed32(&guard->task);
        int64_t present = call ? cat_law_time_used(task) : -1;
        if (present >= 0 && call != seen) {
            since = present;
        } else if (present >= 0 && present - since >= guard->limit) {
            cat_store_release64(&guard->condemned, call);
            cat_law_interrupt(guard, task);
        }
        seen = call;
        clock_nanosleep(CLOCK_MONOTONIC, 0, &pause, NULL);
    }
    return NULL;
}

/* Starts watching, above the caller's wishes for priority. 0 or -errno. */
static inline int cat_law_guard_start(cat_law_guard *guard, int64_t limit, int priority) {
    struct sigaction action = {.sa_sigaction = cat_law_give_up, .sa_flags = SA_SIGINFO | SA_NODEFER};
    struct sched_param parameters = {.sched_priority = priority};
    sigset_t all, before;
    int rc;
    if (guard->watched) return 0;
    sigemptyset(&action.sa_mask);
    if (sigaction(CAT_LAW_SIGNAL, &action, NULL)) return -errno;
    guard->limit = limit;
    cat_store_release32(&guard->stop, 0);
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    rc = pthread_create(&guard->monitor, NULL, cat_law_watch, guard);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (rc) return -rc;
    guard->watched = 1;
    if (priority > 0) /* refused to ordinary users: then the law's thread has none either */
        pthread_setschedparam(guard->monitor, SCHED_FIFO, &parameters);
    return 0;
}

static inline void cat_law_guard_stop(cat_law_guard *guard) {
    if (!guard->watched) return;
    cat_store_release32(&guard->stop, 1);
    pthread_join(guard->monitor, NULL);
    guard->watched = 0;
}

/* Lets the signal through in this thread, and this one only. */
static __attribute__((noinline)) void cat_law_meet_runner(cat_law_guard *guard) {
    sigset_t ours;
    sigemptyset(&ours);
    sigaddset(&ours, CAT_LAW_SIGNAL);
    pthread_sigmask(SIG_UNBLOCK, &ours, NULL);
    guard->runner = pthread_self();
    cat_store_release32(&guard->task, (uint32_t)syscall(SYS_gettid));
    guard->known = 1;
}

static inline int cat_law_call(cat_law_guard *guard, cat_law_step step, const void *actual,
                               void *target, const cat_law_numbers *n, double time) {
    int rc;
    if (!guard->known || !pthread_equal(guard->runner, pthread_self())) cat_law_meet_runner(guard);
    if (sigsetjmp(guard->jump, 0) == 0) {
        cat_store_release64(&guard->under_way, ++guard->calls);
        rc = step(actual, target, n->memory, n->memory_count, n->parameters, n->parameter_count,
                  time);
    } else {
        rc = CAT_LAW_ABORTED;
    }
    cat_store_release64(&guard->under_way, 0);
    return rc;
}

#endif
