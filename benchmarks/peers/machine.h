/* Time, processor affinity, priority and memory locking for the C programs of the benchmarks.
 *
 * If a request is refused, the program prints a message (except for memory) and continues. */
#ifndef CATENARY_BENCH_MACHINE_H
#define CATENARY_BENCH_MACHINE_H

#define _GNU_SOURCE
#include <errno.h>
#include <pthread.h>
#include <sched.h>
#include <stdint.h>
#include <stdio.h>
#include <sys/mman.h>
#include <time.h>

static inline int64_t now_ns(clockid_t clock) {
    struct timespec t;
    clock_gettime(clock, &t);
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}

static inline struct timespec timespec_of(int64_t instant) {
    struct timespec t = {instant / 1000000000LL, instant % 1000000000LL};
    return t;
}

static inline void wait_until(int64_t instant) {
    struct timespec t = timespec_of(instant);
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) == EINTR) {}
}

/* Pin the process to a processor; -1 for any processor. */
static inline void stay_on(int cpu) {
    if (cpu < 0) return;
    cpu_set_t only;
    CPU_ZERO(&only);
    CPU_SET(cpu, &only);
    if (sched_setaffinity(0, sizeof only, &only)) perror("CPU");
}

/* Set the priority of the calling thread. */
static inline void be_real_time(int priority) {
    struct sched_param parameter = {.sched_priority = priority};
    if (pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameter))
        fprintf(stderr, "SCHED_FIFO %d refused\n", priority);
}

/* Lock the memory. No effect without permission. */
static inline void lock_memory(void) { mlockall(MCL_CURRENT | MCL_FUTURE); }

#endif
