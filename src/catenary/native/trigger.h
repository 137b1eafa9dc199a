/* Trigger: the loop of one process (sender) starts the cycles of loops in other processes
 * (receivers) through a block of shared memory.
 *
 * Theory of operation. After its frames have left, the sender stores its cycle start and its period,
 * increments `tick`, and wakes the receivers that sleep on it. It never waits and reads nothing that
 * it depends on, so receivers cannot delay it by more than the wake-up. A receiver sleeps until
 * `tick` changes, at most until a deadline. A value is one 64-bit word, so a sender that is killed
 * leaves no partly written one. Receivers check all values: any program of the same user can write
 * them.
 *
 * words (zeros at first)
 *   tick        futex word: counts the cycles of the sender
 *   waiting     a receiver sleeps, or is about to: set by receivers, cleared by the sender
 *   scheduled   cycle start of the newest cycle [ns, CLOCK_MONOTONIC]
 *   period      period of the sender [ns]
 *
 * Budget of the sender: 0.1 us without a sleeping receiver, otherwise one system call.
 */
#ifndef CATENARY_TRIGGER_H
#define CATENARY_TRIGGER_H

#include <errno.h>
#include <stdint.h>
#include <time.h>

#include "atomics.h"
#include "futex.h"

#define CAT_TRIGGER_SIZE 64u

typedef struct cat_trigger {
    uint32_t tick;
    uint32_t waiting;
    uint64_t scheduled;
    uint64_t period;
} cat_trigger;

static inline void cat_trigger_send(cat_trigger *t, int64_t scheduled, int64_t period) {
    cat_store_relaxed64(&t->scheduled, (uint64_t)scheduled);
    cat_store_relaxed64(&t->period, (uint64_t)period);
    __atomic_fetch_add(&t->tick, 1, __ATOMIC_SEQ_CST);
    if (__atomic_exchange_n(&t->waiting, 0, __ATOMIC_SEQ_CST)) cat_futex_wake_shared(&t->tick);
}

/* Wait until `tick` differs from `seen`. Busy-wait until `awake`, then sleep until `deadline` [ns,
 * CLOCK_MONOTONIC]. Return 1 for a new tick, 0 after the deadline, or -EINTR. */
static inline int cat_trigger_wait(cat_trigger *t, uint32_t seen, int64_t awake, int64_t deadline) {
    for (;;) {
        struct timespec present;
        int rc;
        if (__atomic_load_n(&t->tick, __ATOMIC_SEQ_CST) != seen) return 1;
        clock_gettime(CLOCK_MONOTONIC, &present);
        if (present.tv_sec * 1000000000LL + present.tv_nsec < awake) continue;
        __atomic_store_n(&t->waiting, 1, __ATOMIC_SEQ_CST);
        rc = cat_futex_wait_shared(&t->tick, seen, deadline);
        if (rc == -EINTR) return rc;
        if (rc == -ETIMEDOUT) return cat_load_acquire32(&t->tick) != seen;
        if (rc < 0) return 0; /* such as -EINVAL for a deadline before 0 */
    }
}

#endif
