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
#include <time.h>

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

typedef struct cat_law_guard {
    sigjmp_buf jump;
    uint64_t calls;
    volatile uint64_t under_way;  /* number of the call; 0: none */
    volatile uint64_t condemned;  /* the call that is to be given up */
    pthread_t runner;
    pthread_t monitor;
    uint32_t known;               /* the runner is ready to be interrupted */
    uint32_t watched;             /* the monitor lives */
    volatile uint32_t stop;
    int64_t limit;                /* [ns] of the runner's processor time */
} cat_law_guard;

#define CAT_LAW_SIGNAL (SIGRTMIN + 7)
#define CAT_LAW_LOOKS_NS 5000000

static void cat_law_give_up(int number, siginfo_t *info, void *context) {
    cat_law_guard *guard = (cat_law_guard *)info->si_value.sival_ptr;
    (void)number, (void)context;
    if (info->si_code != SI_QUEUE || !guard || !pthread_equal(pthread_self(), guard->runner)) return;
    if (guard->under_way && guard->under_way == guard->condemned) siglongjmp(guard->jump, 1);
}

/* Looks every 5 ms whether the same call is still under way, and how long it has computed. */
static void *cat_law_watch(void *argument) {
    cat_law_guard *guard = (cat_law_guard *)argument;
    const struct timespec pause = {0, CAT_LAW_LOOKS_NS};
    uint64_t seen = 0;
    int64_t since = 0;
    while (!guard->stop) {
        uint64_t call = __atomic_load_n(&guard->under_way, __ATOMIC_ACQUIRE);
        clockid_t clock;
        struct timespec used;
        if (call && pthread_getcpuclockid(guard->runner, &clock) == 0
                && clock_gettime(clock, &used) == 0) {
            int64_t present = used.tv_sec * 1000000000LL + used.tv_nsec;
            if (call != seen) {
                since = present;
            } else if (present - since >= guard->limit) {
                union sigval value = {.sival_ptr = guard};
                guard->condemned = call;
                pthread_sigqueue(guard->runner, CAT_LAW_SIGNAL, value);
            }
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
    guard->stop = 0;
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
    guard->stop = 1;
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
    guard->known = 1;
}

static inline int cat_law_call(cat_law_guard *guard, cat_law_step step, const void *actual,
                               void *target, const cat_law_numbers *n, double time) {
    int rc;
    if (!guard->known || !pthread_equal(guard->runner, pthread_self())) cat_law_meet_runner(guard);
    if (sigsetjmp(guard->jump, 0) == 0) {
        __atomic_store_n(&guard->under_way, ++guard->calls, __ATOMIC_RELEASE);
        rc = step(actual, target, n->memory, n->memory_count, n->parameters, n->parameter_count,
                  time);
    } else {
        rc = CAT_LAW_ABORTED;
    }
    __atomic_store_n(&guard->under_way, 0, __ATOMIC_RELEASE);
    return rc;
}

#endif
