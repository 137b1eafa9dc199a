/* Due work of a segment: models, watchdogs, EEPROM accesses and links, in the order of their times.
 *
 * The work never passes the next step of a plant. `plant_time.h` takes this step. */
#ifndef CATENARY_VIRTUAL_DUE_WORK_H
#define CATENARY_VIRTUAL_DUE_WORK_H

#include <errno.h>
#include <time.h>
#include <unistd.h>

#include "controller/controller.h"
#include "controller/datagram.h"
#include "device_cycle.h"
#include "plant.h"

enum { INSTANTS_MAX = 10000 };        /* maximum number of due times before the next frame in real time */

static int64_t monotonic_now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static void wake_service(cat_segment *s) {
    if (s->event_fd >= 0) {
        uint64_t one = 1;
        ssize_t written = write(s->event_fd, &one, sizeof one);   /* if it fails, the thread is already awake */
        (void)written;
    }
}

static inline void lock(cat_segment *s) { pthread_mutex_lock(&s->mutex); }
static inline void unlock(cat_segment *s) { pthread_mutex_unlock(&s->mutex); }

/* Do all compiled work of one controller that is due now. Return its next due time. */
static int64_t controller_advance(controller *c) {
    int64_t *due = c->segment->dues + c->position;
    *due = NEVER;
    device_advance(c);
    watchdog_check(c);
    sii_check(c);
    int64_t next = c->step_due < c->sync.due ? c->step_due : c->sync.due;
    next = c->watchdog_due < next ? c->watchdog_due : next;
    next = c->pdi_watchdog_due < next ? c->pdi_watchdog_due : next;
    next = c->sii.due < next ? c->sii.due : next;
    *due = next < *due ? next : *due;
    return *due;
}

/* Do the compiled work up to `until`, in the order of due times, but stop before the next step of the plant.
 * In virtual time, also stop when an event needs the application. With a plant, process every due time
 * separately, so that motors and joints stay synchronous even after a delay. In real time, INSTANTS_MAX
 * limits the work, because frames can request any number of SYNC0 pulses and these must not delay later
 * frames. */
static void segment_advance(cat_segment *s, int64_t until) {
    int64_t bound = plant_bound(s, until);
    for (uint32_t left = INSTANTS_MAX; s->next_due <= bound && (s->is_virtual || left > 0); left--) {
        if (s->next_due > s->now)
            s->now = s->next_due;
        int64_t instant = s->plant ? s->next_due : s->now;
        int64_t next = NEVER;
        s->next_due = NEVER;
        if (s->link_due <= s->now)
            links_check(s);
        next = s->link_due < next ? s->link_due : next;
        for (int n = 0; n < s->count; n++) {
            int64_t due = s->dues[n];
            if (due <= instant)
                due = controller_advance(&s->controllers[n]);
            next = due < next ? due : next;
        }
        s->next_due = next < s->next_due ? next : s->next_due;
        if (s->is_virtual && s->pending)
            return;
    }
    if (until > s->now)
        s->now = until;
}

static inline int64_t earlier(int64_t a, int64_t b) { return a < b ? a : b; }

#endif
