/* The machine's clock, CLOCK_MONOTONIC, for one waiting thread that other threads can wake. */
#ifndef CATENARY_MACHINE_TIME_H
#define CATENARY_MACHINE_TIME_H

#include <errno.h>
#include <stdint.h>
#include <time.h>

#include "atomics.h"
#include "clock.h"
#include "futex.h"

typedef struct machine_time {
    uint32_t wakes;                   /* futex word */
    uint32_t seen;                    /* wake-ups that the waiting thread has consumed */
} machine_time;

static inline int64_t machine_read(clockid_t clock) {
    struct timespec t;
    clock_gettime(clock, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static int64_t machine_now(void *self) { (void)self; return machine_read(CLOCK_MONOTONIC); }

static int machine_wait_until(void *self, int64_t deadline) {
    machine_time *m = self;
    for (;;) {
        uint32_t wakes = cat_load_acquire32(&m->wakes);
        if (machine_now(self) >= deadline) return 0;
        if (wakes != m->seen) {
            m->seen = wakes;
            return 1;
        }
        int error = cat_futex_wait_shared(&m->wakes, wakes, deadline);
        if (error == -EINTR) return error;
    }
}

static void machine_wake(void *self) {
    machine_time *m = self;
    cat_add32(&m->wakes, 1);
    cat_futex_wake_shared(&m->wakes);
}

/* Compute until this thread has used `duration` of processor time. */
static int machine_spend(void *self, int64_t duration) {
    (void)self;
    int64_t end = machine_read(CLOCK_THREAD_CPUTIME_ID) + duration;
    while (machine_read(CLOCK_THREAD_CPUTIME_ID) < end) {}
    return 0;
}

#endif
