/* The clock table: a clock with waits. It is the clock of the machine, or a virtual and shared one.
 *
 * One thread uses a table at a time; other threads may call only `wake`. Nothing here allocates,
 * raises or takes the GIL. Python passes the table in a capsule named CAT_CLOCK_CAPSULE. The holder
 * of the table keeps the Python object that owns it alive.
 */
#ifndef CATENARY_CLOCK_H
#define CATENARY_CLOCK_H

#include <stdint.h>

#define CAT_CLOCK_CAPSULE "catenary.clock"
#define CAT_CLOCK_VERSION 1u
#define CAT_CLOCK_FOREVER INT64_MAX

/* flags */
#define CAT_CLOCK_VIRTUAL 1u          /* time advances only while every participant waits */

typedef struct cat_clock {
    uint32_t version;                 /* CAT_CLOCK_VERSION */
    uint32_t flags;
    void *self;

    int64_t (*now)(void *self);       /* [ns] */

    /* Waits until `deadline` [ns, absolute]. Returns 0 if it has passed, 1 if woken earlier,
     * or -errno. -EINTR: a signal interrupted the wait; call again with the same deadline. */
    int (*wait_until)(void *self, int64_t deadline);

    /* Spends execution time [ns]. A virtual clock lets the time pass; participants of higher priority
     * on the same processor preempt it. The machine's clock busy-waits. Returns 0, or -errno.
     * -EINTR: a signal interrupted the wait; call again to continue. */
    int (*spend)(void *self, int64_t duration);

    /* Ends the current `wait_until`, or the next one if no thread waits. */
    void (*wake)(void *self);
} cat_clock;

#endif
