/* A clock to wait on: that of the machine, or a virtual and shared one.
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

    /* Waits until `deadline` [ns, absolute]. 0: it has passed; 1: woken before; or -errno
     * (-EINTR: a signal came first; call again with the same deadline to continue). */
    int (*wait_until)(void *self, int64_t deadline);

    /* Spends execution time [ns]. Virtual: lets it pass, preempted by participants of higher
     * priority on the same processor. Machine: computes for this long. 0 or -errno, as above. */
    int (*spend)(void *self, int64_t duration);

    /* Ends the running or the next `wait_until`. */
    void (*wake)(void *self);
} cat_clock;

#endif
