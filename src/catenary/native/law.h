/* Control laws and their monitor. A law is a function that runs in the cycle thread. The monitor
 * aborts a law that never returns.
 *
 * `actual` and `target` point to blocks of the core with the layout of `law_fields`. The targets
 * keep the values of the previous step. Before the first step, and for axes that are not followed,
 * they are the last commanded values. The core's limits apply to what the law leaves in them.
 *
 * Theory of operation
 *   A guard belongs to one thread that calls laws (the runner). `under_way` is the number of the
 *   current call. A monitor is a thread that watches one guard. Every 5 ms it reads the processor
 *   time that the runner has used since the monitor first saw the call. If this reaches `limit`, the
 *   monitor stores the number of the call in `condemned` and sends a signal to the runner. The
 *   handler leaves the call by siglongjmp if the same call is still running. Signals that arrive
 *   late or in another thread have no effect.
 *
 * state of a monitor (futex word)
 *   PARKED  no law runs; the monitor sleeps without a timeout
 *   ACTIVE  the monitor checks the runner every 5 ms
 *   ENDING  the monitor thread must exit
 *
 * The runner activates and parks the monitor. Its owner ends it when the runner has stopped.
 * Parking is a single store; the monitor notices it at its next check. The cycle and a rehearsal in
 * another thread each have their own guard and monitor, so both can run a law at the same time.
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
#include "futex.h"

#define CAT_LAW_GOES_ON 0
#define CAT_LAW_FINISHED 1
#define CAT_LAW_RAISED (-1)   /* an exception, for example an index out of bounds */
#define CAT_LAW_ABORTED (-2)  /* aborted by the monitor */

/* Numbers of the law: `memory` belongs to it, `parameters` to the application. */
typedef struct cat_law_numbers {
    double *memory;
    int64_t memory_count;
    double *parameters;
    int64_t parameter_count;
} cat_law_numbers;

/* One step of a law. `time`: time since the first step [s]. The function must not block. It returns
 * CAT_LAW_GOES_ON, CAT_LAW_FINISHED or CAT_LAW_RAISED. */
typedef int (*cat_law_step)(const void *actual, void *target, double *memory, int64_t memory_count,
                            const double *parameters, int64_t parameter_count, double time);

/* Words that two threads or the signal handler share are atomic: `under_way`, `condemned`, `task` and
 * `limit`. Lock-free atomics are safe in a signal handler (C11 §7.14.1.1). */
typedef struct cat_law_guard {
    sigjmp_buf jump;
    uint64_t calls;               /* number of calls of the runner */
    uint64_t under_way;           /* number of the current call; 0: none */
    uint64_t condemned;           /* number of the call to abort */
    uint64_t limit;               /* maximum processor time of the runner in one call [ns] */
    uint32_t task;                /* thread ID of the runner in the kernel */
    uint32_t known;               /* the runner is ready to be interrupted */
    pthread_t runner;             /* the thread that calls laws */
} cat_law_guard;

enum { CAT_LAW_PARKED, CAT_LAW_ACTIVE, CAT_LAW_ENDING };

typedef struct cat_law_monitor {
    cat_law_guard guard;
    uint32_t state;               /* futex word */
    uint32_t started;             /* the thread is running; used only by the owner */
    pthread_t thread;
    pid_t owner;                  /* process that runs the thread; a forked child has no copy of it */
} cat_law_monitor;

#define CAT_LAW_SIGNAL (SIGRTMIN + 7)
#define CAT_LAW_CHECK_NS 5000000
#define CAT_LAW_FOREVER_NS INT64_MAX

static void cat_law_give_up(int number, siginfo_t *info, void *context) {
    cat_law_guard *guard = (cat_law_guard *)info->si_value.sival_ptr;
    (void)number, (void)context;
    if (info->si_code != SI_QUEUE || !guard) return;
    if (cat_load_relaxed32(&guard->task) != (uint32_t)syscall(SYS_gettid)) return;
    uint64_t call = cat_load_relaxed64(&guard->under_way);
    if (call && call == cat_load_relaxed64(&guard->condemned)) siglongjmp(guard->jump, 1);
}

/* Return the processor time of a thread of this process [ns]; -1 if the thread has ended. The clock
 * is selected by the thread ID (linux/posix-timers.h), which stays safe to use after the thread has
 * ended. A pthread_t is not safe then. */
static inline int64_t cat_law_time_used(uint32_t task) {
    struct timespec used;
    clockid_t clock = (clockid_t)((~(unsigned)task << 3) | 6u);
    if (clock_gettime(clock, &used)) return -1;
    return used.tv_sec * 1000000000LL + used.tv_nsec;
}

/* Send the signal that ends a call. No effect if the thread has ended. */
static inline void cat_law_interrupt(cat_law_guard *guard, uint32_t task) {
    siginfo_t info = {0};
    info.si_signo = CAT_LAW_SIGNAL;
    info.si_code = SI_QUEUE;
    info.si_pid = getpid();
    info.si_uid = getuid();
    info.si_value.sival_ptr = guard;
    syscall(SYS_rt_tgsigqueueinfo, getpid(), task, CAT_LAW_SIGNAL, &info);
}

typedef struct cat_law_seen {
    uint64_t call;                /* call at the last check; 0: none */
    int64_t since;                /* processor time of the runner when the call was first seen [ns] */
} cat_law_seen;

/* Abort a call that has used `limit` of processor time. */
static inline void cat_law_check(cat_law_guard *guard, cat_law_seen *seen) {
    uint64_t call = cat_load_acquire64(&guard->under_way);
    uint32_t task = cat_load_relaxed32(&guard->task);
    int64_t present = call ? cat_law_time_used(task) : -1;
    if (present >= 0 && call != seen->call) {
        seen->since = present;
    } else if (present >= 0 && present - seen->since >= (int64_t)cat_load_relaxed64(&guard->limit)) {
        cat_store_release64(&guard->condemned, call);
        cat_law_interrupt(guard, task);
    }
    seen->call = call;
}

static void *cat_law_watch(void *argument) {
    cat_law_monitor *monitor = (cat_law_monitor *)argument;
    cat_law_seen seen = {0, 0};
    for (;;) {
        uint32_t state = cat_load_acquire32(&monitor->state);
        if (state == CAT_LAW_ENDING) return NULL;
        if (state == CAT_LAW_ACTIVE) cat_law_check(&monitor->guard, &seen);
        cat_futex_wait(&monitor->state, state,
                       state == CAT_LAW_ACTIVE ? CAT_LAW_CHECK_NS : CAT_LAW_FOREVER_NS);
    }
}

/* Owner: install the signal handler and start the thread in state PARKED. No effect if the thread
 * already runs. `priority` is its SCHED_FIFO priority, which must be higher than that of the
 * runner; 0 keeps the caller's scheduling. Return 0 or -errno. */
static inline int cat_law_monitor_start(cat_law_monitor *monitor, int priority) {
    struct sigaction action = {.sa_sigaction = cat_law_give_up, .sa_flags = SA_SIGINFO | SA_NODEFER};
    struct sched_param parameters = {.sched_priority = priority};
    sigset_t all, before;
    int rc;
    if (monitor->started) return 0;
    sigemptyset(&action.sa_mask);
    if (sigaction(CAT_LAW_SIGNAL, &action, NULL)) return -errno;
    cat_store_release32(&monitor->state, CAT_LAW_PARKED);
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    rc = pthread_create(&monitor->thread, NULL, cat_law_watch, monitor);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (rc) return -rc;
    monitor->started = 1;
    monitor->owner = getpid();
    if (priority > 0) /* fails without permission, but then the runner has no real-time priority either */
        pthread_setschedparam(monitor->thread, SCHED_FIFO, &parameters);
    return 0;
}

/* Owner: stop the thread after the last call of a law, and wait for its end. A forked child has no
 * thread to stop. */
static inline void cat_law_monitor_stop(cat_law_monitor *monitor) {
    if (monitor->started && monitor->owner == getpid()) {
        cat_store_release32(&monitor->state, CAT_LAW_ENDING);
        cat_futex_wake(&monitor->state);
        pthread_join(monitor->thread, NULL);
    }
    monitor->started = 0;
}

/* Runner: start watching calls. This takes one system call; the first call of a law takes two
 * more. */
static inline void cat_law_monitor_activate(cat_law_monitor *monitor, int64_t limit) {
    monitor->guard.known = 0; /* a new thread may reuse the pthread_t of one that has ended */
    cat_store_release64(&monitor->guard.limit, (uint64_t)limit);
    cat_store_release32(&monitor->state, CAT_LAW_ACTIVE);
    cat_futex_wake(&monitor->state);
}

/* Runner: stop watching calls while no law runs. */
static inline void cat_law_monitor_park(cat_law_monitor *monitor) {
    cat_store_release32(&monitor->state, CAT_LAW_PARKED);
}

/* Register the calling thread as the runner, and unblock the signal in this thread only. */
static __attribute__((noinline)) void cat_law_meet_runner(cat_law_guard *guard) {
    sigset_t ours;
    sigemptyset(&ours);
    sigaddset(&ours, CAT_LAW_SIGNAL);
    pthread_sigmask(SIG_UNBLOCK, &ours, NULL);
    guard->runner = pthread_self();
    cat_store_release32(&guard->task, (uint32_t)syscall(SYS_gettid));
    guard->known = 1;
}

/* Run one step. Return its result, or CAT_LAW_ABORTED if the monitor aborted it. */
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
