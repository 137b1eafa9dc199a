/* Virtual time: a discrete-event simulation of fixed priorities, for threads and processes alike.
 *
 * The table is in shared memory. At most one participant has the turn, and virtual time stands
 * still while it runs. A participant blocks by waiting for a time or by spending execution time.
 * The participant that blocks last selects the next one:
 *  - a participant that has just spent its time runs before any release at the same time: a job
 *    is not preempted by another that begins when it ends, as in response-time analysis;
 *  - participants whose waiting time is over are released;
 *  - each processor serves its ready participant of highest priority until that participant waits
 *    or one of higher priority is released; equal priorities are served in the order of their
 *    release (SCHED_FIFO, sched(7));
 *  - among the served participants with no time left to spend, the one of highest priority runs;
 *  - if there is none, time advances to the next release or to the next end of execution.
 * A robust mutex guards the table: a participant that is killed while it holds the mutex leaves the
 * table usable. The supervisor that notices the death frees the slot (VT_FREE).
 */
#ifndef CATENARY_VIRTUAL_TIME_H
#define CATENARY_VIRTUAL_TIME_H

#include <errno.h>
#include <pthread.h>
#include <stdint.h>
#include <string.h>
#include <time.h>

#include "atomics.h"
#include "clock.h"
#include "futex.h"

#define VT_PARTICIPANTS 64
#define VT_OWN_PROCESSOR (-1)
#define VT_SIGNALS_NS 500000000       /* machine time between two checks for signals */

enum {
    VT_FREE,                          /* the slot is unused */
    VT_EXPECTED,                      /* will start: time stands still until it waits */
    VT_WAITING,                       /* until `due` or a wake-up */
    VT_READY,                         /* needs its processor to spend `remaining`, then runs */
    VT_RUNNING,                       /* its code runs; time stands still */
    VT_ASIDE,                         /* suspended: time advances without it */
};

typedef struct vt_participant {
    uint32_t turn;                    /* futex word: number of turns given */
    uint32_t seen;                    /* number of turns taken */
    uint32_t state;
    uint32_t woken;
    uint32_t spent;                   /* has just spent its time: runs before any release */
    int32_t priority;
    int32_t cpu;                      /* VT_OWN_PROCESSOR: does not compete */
    int64_t due;
    int64_t remaining;
    uint64_t order;                   /* order of becoming ready, among equal priorities */
} vt_participant;

typedef struct virtual_time {
    pthread_mutex_t lock;
    int64_t now;
    uint64_t order;
    vt_participant who[VT_PARTICIPANTS];
} virtual_time;

static int vt_init(virtual_time *v) {
    pthread_mutexattr_t attributes;
    int error = pthread_mutexattr_init(&attributes);
    if (error) return error;
    pthread_mutexattr_setpshared(&attributes, PTHREAD_PROCESS_SHARED);
    pthread_mutexattr_setrobust(&attributes, PTHREAD_MUTEX_ROBUST);
    error = pthread_mutex_init(&v->lock, &attributes);
    pthread_mutexattr_destroy(&attributes);
    return error;
}

static void vt_lock(virtual_time *v) {
    if (pthread_mutex_lock(&v->lock) == EOWNERDEAD) pthread_mutex_consistent(&v->lock);
}

static void vt_unlock(virtual_time *v) { pthread_mutex_unlock(&v->lock); }

static void vt_make_ready(virtual_time *v, vt_participant *p, int64_t remaining) {
    p->state = VT_READY;
    p->remaining = remaining;
    p->order = ++v->order;
}

static int vt_precedes(const vt_participant *a, const vt_participant *b) {
    if (a->spent != b->spent) return a->spent;
    if (a->priority != b->priority) return a->priority > b->priority;
    return a->order < b->order;
}

/* Return 1 if its processor serves this participant. */
static int vt_served(const virtual_time *v, const vt_participant *p) {
    if (p->state != VT_READY) return 0;
    if (p->cpu == VT_OWN_PROCESSOR) return 1;
    for (int k = 0; k < VT_PARTICIPANTS; k++) {
        const vt_participant *other = &v->who[k];
        if (other->state == VT_READY && other->cpu == p->cpu && vt_precedes(other, p)) return 0;
    }
    return 1;
}

static int vt_time_stands(const virtual_time *v) {
    for (int k = 0; k < VT_PARTICIPANTS; k++)
        if (v->who[k].state == VT_RUNNING || v->who[k].state == VT_EXPECTED) return 1;
    return 0;
}

static void vt_release_due(virtual_time *v) {
    for (int k = 0; k < VT_PARTICIPANTS; k++) {
        vt_participant *p = &v->who[k];
        if (p->state == VT_WAITING && p->due <= v->now) vt_make_ready(v, p, 0);
    }
}

static vt_participant *vt_next(virtual_time *v) {
    vt_participant *next = NULL;
    for (int k = 0; k < VT_PARTICIPANTS; k++) {
        vt_participant *p = &v->who[k];
        if (!vt_served(v, p) || p->remaining > 0) continue;
        if (next == NULL || vt_precedes(p, next)) next = p;
    }
    return next;
}

/* Advance to the next event. Return 0 if there is no event before a participant is woken. */
static int vt_advance(virtual_time *v) {
    int64_t step = INT64_MAX;
    int served[VT_PARTICIPANTS];
    for (int k = 0; k < VT_PARTICIPANTS; k++) {
        vt_participant *p = &v->who[k];
        served[k] = vt_served(v, p);
        if (served[k] && p->remaining < step) step = p->remaining;
        if (p->state == VT_WAITING && p->due != CAT_CLOCK_FOREVER && p->due - v->now < step)
            step = p->due - v->now;
    }
    if (step == INT64_MAX) return 0;
    for (int k = 0; k < VT_PARTICIPANTS; k++) {
        if (!served[k]) continue;
        v->who[k].remaining -= step;
        v->who[k].spent = v->who[k].remaining == 0;
    }
    v->now += step;
    return 1;
}

/* Give the turn to the next participant, unless one is running. Each round releases a participant
 * or ends its execution, so there are at most two rounds for each participant. */
static void vt_schedule(virtual_time *v) {
    if (vt_time_stands(v)) return;
    do {
        vt_release_due(v);
        vt_participant *next = vt_next(v);
        if (next == NULL) continue;
        next->state = VT_RUNNING;
        next->spent = 0;
        cat_store_release32(&next->turn, next->turn + 1);
        cat_futex_wake_shared(&next->turn);
        return;
    } while (vt_advance(v));
}

/* Sleep until it is this participant's turn. Return -EINTR after a signal; the participant stays
 * blocked. The sleep has a timeout, because a signal just before it, or to another thread, does
 * not interrupt it. */
static int vt_sleep(vt_participant *p) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    int64_t until = (int64_t)t.tv_sec * 1000000000 + t.tv_nsec + VT_SIGNALS_NS;
    while (cat_load_acquire32(&p->turn) == p->seen) {
        int error = cat_futex_wait_shared(&p->turn, p->seen, until);
        if (error == -EINTR || error == -ETIMEDOUT) return -EINTR;
    }
    p->seen = p->turn;
    return 0;
}

/* Return a slot for a participant that will start; time stands still until it first waits. Return
 * -ENOSPC if all slots are taken. */
static int vt_join(virtual_time *v, int32_t priority, int32_t cpu) {
    int found = -ENOSPC;
    vt_lock(v);
    for (int k = 0; k < VT_PARTICIPANTS && found < 0; k++) {
        if (v->who[k].state != VT_FREE) continue;
        uint32_t turn = v->who[k].turn;
        v->who[k] = (vt_participant){
            .turn = turn, .seen = turn, .state = VT_EXPECTED, .priority = priority, .cpu = cpu};
        found = k;
    }
    vt_unlock(v);
    return found;
}

/* Reset the slot of a participant whose process died and is restarted. */
static void vt_expect(virtual_time *v, int slot) {
    vt_lock(v);
    v->who[slot].state = VT_EXPECTED;
    v->who[slot].seen = v->who[slot].turn;
    vt_unlock(v);
}

static void vt_change(virtual_time *v, int slot, uint32_t state) {
    vt_lock(v);
    v->who[slot].state = state;
    vt_schedule(v);
    vt_unlock(v);
}

/* Begin to wait for `deadline`. Return 0 if no wait is necessary, 1 if the caller must sleep. */
static int vt_begin_waiting(virtual_time *v, vt_participant *p, int64_t deadline) {
    int goes_on = p->state == VT_WAITING || p->state == VT_READY;     /* continues after a signal */
    int has_turn = p->state == VT_RUNNING && p->turn != p->seen;      /* turn given, not yet taken */
    if (goes_on || has_turn) return 1;
    if (p->state == VT_RUNNING && (p->woken || deadline <= v->now)) return 0;
    p->due = p->woken ? v->now : deadline;
    p->state = VT_WAITING;
    vt_schedule(v);
    return 1;
}

/* Return 0 if the deadline has passed, 1 if woken earlier, -EINTR after a signal (call again). */
static int vt_wait_until(virtual_time *v, int slot, int64_t deadline) {
    vt_participant *p = &v->who[slot];
    vt_lock(v);
    int blocked = vt_begin_waiting(v, p, deadline);
    vt_unlock(v);
    if (blocked && vt_sleep(p) < 0) return -EINTR;
    vt_lock(v);
    int woken = p->woken && v->now < deadline;
    p->woken = 0;
    vt_unlock(v);
    return woken;
}

/* Return 0 if the time is spent, -EINTR after a signal. Call it again to continue: it then waits for
 * the rest of the time, whatever `duration` is. */
static int vt_spend(virtual_time *v, int slot, int64_t duration) {
    vt_participant *p = &v->who[slot];
    if (duration <= 0) return 0;
    vt_lock(v);
    int goes_on = p->state == VT_READY || p->turn != p->seen;
    if (!goes_on) {
        vt_make_ready(v, p, duration);
        p->order = 0;                 /* already served: before participants of equal priority */
        vt_schedule(v);
    }
    vt_unlock(v);
    return vt_sleep(p);
}

static void vt_wake(virtual_time *v, int slot) {
    vt_participant *p = &v->who[slot];
    vt_lock(v);
    p->woken = 1;
    if (p->state == VT_WAITING && p->due > v->now) p->due = v->now;
    vt_schedule(v);
    vt_unlock(v);
}

#endif
