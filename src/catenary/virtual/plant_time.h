/* Steps of a plant at their times, together with the work of all its members.
 *
 * No segment passes the due time of a step (plant_bound). At this time, all members have done their
 * earlier work. Then the torques of all motors are applied, the model is stepped, and the motors of
 * all members see the new state.
 *
 * In virtual time, the member that reaches the due time first brings the others there, with their
 * applications. Only one participant of a shared clock runs at a time, so no other thread uses them.
 * In real time, one thread steps the plant. It locks all members in the order in which they joined,
 * and releases them while MuJoCo computes. Threads that answer frames or run an application lock only
 * their own segment. The methods of CompiledPlant lock all members in the same order. */
#ifndef CATENARY_VIRTUAL_PLANT_TIME_H
#define CATENARY_VIRTUAL_PLANT_TIME_H

#include "due_work.h"

enum { LONGEST_SLEEP = 20000000 };    /* maximum delay until the thread notices `ending` [ns] */

static void plant_lock(plant *p) {
    for (int k = 0; k < p->member_count; k++)
        lock(p->members[k]);
}

static void plant_unlock(plant *p) {
    for (int k = p->member_count - 1; k >= 0; k--)
        unlock(p->members[k]);
}

/* Stop the plant and wake the services, which report the reason. */
static void plant_fail(plant *p) {
    p->due = NEVER;
    for (int k = 0; k < p->member_count; k++) {
        p->members[k]->pending = 1;
        wake_service(p->members[k]);
    }
}

/* Do the step that is due. After a delay of more than CATCH_UP_STEPS, omit steps. */
static void plant_step(plant *p, int64_t now) {
    plant_lock(p);
    plant_apply(p, p->due);
    plant_unlock(p);
    plant_simulate(p);
    plant_lock(p);
    p->steps++;
    plant_show(p);
    p->due += p->period;
    if (p->due <= now - CATCH_UP_STEPS * p->period)
        p->due = now + p->period;
    if (p->wild || p->words[0])
        plant_fail(p);
    plant_unlock(p);
}

/* Let the segments of a new plant, or a plant that was stopped, continue at `now`. */
static void plant_begin(plant *p, int64_t now) {
    plant_lock(p);
    if (p->due < now + p->period)
        p->due = now + p->period;
    plant_unlock(p);
}

/* -- virtual time ----------------------------------------------------------------------------- */

/* Run the application if it has work. Return 0 or -errno; a failure during the time of another member
 * is returned here. */
static int segment_serve(cat_segment *s) {
    int failed = s->failed;
    s->failed = 0;
    if (failed)
        return failed;
    return s->pending || s->service_due <= s->now ? s->service(s->owner) : 0;
}

/* Bring a member to `until`, before the due time of the plant. Return 0 or -errno. A failure of its
 * application remains in the member, for the thread that uses its link. */
static int member_advance(cat_segment *m, int64_t until) {
    for (;;) {
        int failed = m->failed ? m->failed : segment_serve(m);
        if (failed != -EINTR)
            m->failed = failed;
        if (failed || m->now >= until)
            return failed;
        lock(m);
        segment_advance(m, earlier(until, m->service_due));
        unlock(m);
    }
}

/* Bring all other members to the due time of the plant, and do the step. */
static int plant_meet(plant *p, const cat_segment *s) {
    for (int k = 0; k < p->member_count; k++) {
        cat_segment *m = p->members[k];
        if (m->clock && m->clock->now(m->clock->self) < p->due) {
            p->apart = 1;
            plant_fail(p);
            return 0;
        }
        int failed = m == s ? 0 : member_advance(m, p->due - 1);
        if (failed)
            return failed;
    }
    plant_step(p, p->due);
    return 0;
}

/* Do the work of a segment up to `until`, or up to the next event or step of its plant. */
static int virtual_advance(cat_segment *s, int64_t until) {
    if (s->plant && s->plant->due <= until && s->now >= s->plant->due - 1)
        return plant_meet(s->plant, s);
    lock(s);
    segment_advance(s, plant_bound(s, until));
    unlock(s);
    return 0;
}

/* -- real time -------------------------------------------------------------------------------- */

static void plant_sleep(int64_t until) {
    struct timespec t = {.tv_sec = until / 1000000000, .tv_nsec = until % 1000000000};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL);
}

/* Step the plant, and do the due work of its members, until `ending` is set or a step fails. */
static void plant_run(plant *p) {
    plant_begin(p, monotonic_now() - p->period);
    while (!p->ending && p->due != NEVER) {
        int64_t now = monotonic_now();
        for (int k = 0; k < p->member_count; k++) {
            lock(p->members[k]);
            segment_advance(p->members[k], now);
            unlock(p->members[k]);
        }
        if (p->due <= now)
            plant_step(p, now);
        else
            plant_sleep(earlier(p->due, now + LONGEST_SLEEP));
    }
    p->ending = 0;
}

#endif
