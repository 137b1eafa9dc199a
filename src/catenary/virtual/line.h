/* The line: frames in transit, due work, and virtual or real time.
 *
 * All controllers process a frame when it is sent. The frame returns after its transmission time and
 * the delay of its route, unless a cable on the route goes dark before. In virtual time, only
 * `wait_until` advances `now`. With a shared clock, `send`, `receive` and `spend` also
 * advance it. */
#ifndef CATENARY_VIRTUAL_LINE_H
#define CATENARY_VIRTUAL_LINE_H

#include <errno.h>
#include <time.h>
#include <unistd.h>

#include "controller/controller.h"
#include "controller/datagram.h"
#include "device_cycle.h"
#include "plant.h"

enum {
    BYTE_NS = 80,                     /* 100 Mbit/s */
    FRAME_OVERHEAD = 8 + 4 + 12,      /* preamble, check sequence, gap */
    INSTANTS_MAX = 10000              /* maximum number of due times before the next frame in real time */
};

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

/* Drop the frames that are on a cable when it goes dark. Later controllers have already processed
 * them, but these are only the frames of a few microseconds. */
static void lose_in_flight(cat_segment *s, segment_end *e) {
    uint32_t kept = e->head;
    for (uint32_t k = e->head; k != e->tail; k++) {
        uint16_t place = e->order[k & (QUEUE_SIZE - 1)];
        const queued_frame *q = &e->queue[place];
        const route *r = &s->routes[q->from];
        int64_t duration = (int64_t)(q->length + FRAME_OVERHEAD) * BYTE_NS;
        int hit = 0;
        for (uint32_t a = 0; a < r->arrival_count && q->arrival > s->now; a++)
            hit |= !s->cables[r->arrivals[a].cable].light && q->sent + r->arrivals[a].offset + duration > s->now;
        if (hit)
            frame_lost(s, LOSS_IN_FLIGHT, q->from, q->sent);
        else {
            e->order[k & (QUEUE_SIZE - 1)] = e->order[kept & (QUEUE_SIZE - 1)];
            e->order[kept++ & (QUEUE_SIZE - 1)] = place;
        }
    }
    e->tail = kept;
}

/* Handle a change of cables or power. `at_once`: skip the detection time of the controllers. */
static void segment_light(cat_segment *s, int at_once) {
    int64_t detection = s->detection;
    routes_refresh(s);
    if (at_once)
        s->detection = 0;
    if (light_update(s) && s->is_virtual)
        for (int n = 0; n <= s->ring; n++)
            lose_in_flight(s, &s->ends[n]);
    s->detection = detection;
    if (at_once)
        links_check(s);
}

/* Do the compiled work up to `until`, in the order of due times. In virtual time, stop when an event
 * needs the application. With a plant, process every due time separately, so that motors and joints
 * stay synchronous even after a delay. Joints come first, because encoders show the earlier state.
 * In real time, INSTANTS_MAX limits the work, because frames can request any number of SYNC0 pulses
 * and these must not delay later frames. */
static void segment_work(cat_segment *s, int64_t until, int steps_plant) {
    int64_t bound = plant_bound(s, until, steps_plant);
    for (uint32_t left = INSTANTS_MAX; s->next_due <= bound && (s->is_virtual || left > 0); left--) {
        if (s->next_due > s->now)
            s->now = s->next_due;
        int64_t instant = s->plant ? s->next_due : s->now;
        if (s->plant && s->plant->due <= instant)
            plant_step(s);
        int64_t next = s->plant ? s->plant->due : NEVER;
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

/* Do the compiled work up to `until`. In real time, a separate thread steps the plant, and other
 * threads stop before its next step. */
static inline void segment_advance(cat_segment *s, int64_t until) { segment_work(s, until, s->is_virtual); }

/* Return the next free place in the queue of frames towards an interface. */
static inline queued_frame *queue_place(segment_end *e) {
    return &e->queue[e->order[e->tail & (QUEUE_SIZE - 1)]];
}

/* Insert the frame in the next free place into the queue, ahead of frames that arrive later. */
static void queue_put(segment_end *e) {
    uint32_t k = e->tail++;
    uint16_t place = e->order[k & (QUEUE_SIZE - 1)];
    int64_t arrival = e->queue[place].arrival;
    for (; k != e->head; k--) {
        uint16_t before = e->order[(k - 1) & (QUEUE_SIZE - 1)];
        if (e->queue[before].arrival <= arrival)
            break;
        e->order[k & (QUEUE_SIZE - 1)] = before;
    }
    e->order[k & (QUEUE_SIZE - 1)] = place;
}

static inline int queue_full(const segment_end *e) { return e->tail - e->head >= QUEUE_SIZE; }

/* Insert a copy of the frame, directly after the first. */
static void queue_twice(segment_end *e, const queued_frame *first) {
    if (queue_full(e))
        return;
    queued_frame *second = queue_place(e);
    *second = *first;
    second->arrival += (int64_t)(first->length + FRAME_OVERHEAD) * BYTE_NS;
    queue_put(e);
}

/* Process the frame in `q`, which starts at q->sent. Queue it for its return, or drop it. */
static void line_take(cat_segment *s, queued_frame *q, const route *r) {
    fate fate = s->fault_count ? fate_of(s, r) : NO_FATE;
    s->passage = q->sent;
    int exit = frame_through(s, r, &fate, q->bytes, q->length);
    if (exit < 0) {
        frame_lost(s, -exit, q->from, q->sent);
        return;
    }
    if (fate.garble)
        frame_garble(s, q->bytes, q->length, fate.offset);
    q->arrival = q->sent + (int64_t)(q->length + FRAME_OVERHEAD) * BYTE_NS + r->delay + fate.delay;
    queue_put(&s->ends[exit]);
    if (fate.duplicate)
        queue_twice(&s->ends[exit], q);
}

static int wait_in_virtual_time(segment_end *e, int64_t deadline, int wake_on_frame);

/* Process the time that has passed on a shared clock, during a wait on the link of another segment. */
static inline void catch_up(segment_end *e) {
    cat_segment *s = e->segment;
    if (s->clock) {
        int64_t present = s->clock->now(s->clock->self);
        if (present > s->now)
            wait_in_virtual_time(e, present, 0);
    }
}

static int line_send(void *self, const uint8_t *frame, uint32_t length) {
    segment_end *e = self;
    cat_segment *s = e->segment;
    if (length < ETHERNET_HEADER || length > CAT_FRAME_MAX)
        return -EMSGSIZE;
    catch_up(e);
    lock(s);
    if (!s->is_virtual)
        segment_advance(s, monotonic_now());
    routes_refresh(s);
    const route *r = &s->routes[e->number];
    segment_end *back = &s->ends[r->exit < 0 ? e->number : r->exit];
    if (queue_full(back)) {
        unlock(s);
        return -ENOBUFS;
    }
    queued_frame *q = queue_place(back);
    memcpy(q->bytes, frame, length);
    if (length < CAT_FRAME_MIN)
        memset(q->bytes + length, 0, CAT_FRAME_MIN - length);
    q->length = length < CAT_FRAME_MIN ? CAT_FRAME_MIN : length;
    q->from = e->number;
    q->sent = e->busy_until > s->now ? e->busy_until : s->now;
    e->busy_until = s->frame_end = q->sent + (int64_t)(q->length + FRAME_OVERHEAD) * BYTE_NS;
    if (frame_is_ours(q->bytes, q->length))
        line_take(s, q, r);
    else
        s->counters.foreign++;
    unlock(s);
    return 0;
}

static int64_t line_now(void *self) {
    const cat_segment *s = ((segment_end *)self)->segment;
    if (s->clock)
        return s->clock->now(s->clock->self);
    return s->is_virtual ? s->now : monotonic_now();
}

static inline const queued_frame *queue_first(const segment_end *e) {
    return e->head == e->tail ? NULL : &e->queue[e->order[e->head & (QUEUE_SIZE - 1)]];
}

static inline int line_ready(const segment_end *e, int64_t now) {
    const queued_frame *q = queue_first(e);
    return q && q->arrival <= now;
}

static int line_receive(void *self, const uint8_t **frame) {
    segment_end *e = self;
    catch_up(e);
    lock(e->segment);
    int length = 0;
    if (line_ready(e, e->segment->is_virtual ? e->segment->now : monotonic_now())) {
        const queued_frame *q = queue_first(e);
        memcpy(e->taken, q->bytes, q->length);
        length = (int)q->length;
        e->head++;
        *frame = e->taken;
    }
    unlock(e->segment);
    return length;
}

static inline int64_t earlier(int64_t a, int64_t b) { return a < b ? a : b; }

/* Return the arrival time of the next frame; NEVER if no frame is queued. */
static int64_t line_due(void *self) {
    const queued_frame *q = queue_first(self);
    return q ? q->arrival : NEVER;
}

static int64_t line_wake_time(const segment_end *e, int64_t deadline, int wake_on_frame) {
    const queued_frame *q = wake_on_frame ? queue_first(e) : NULL;
    return q ? earlier(deadline, q->arrival) : deadline;
}

static int wait_in_virtual_time(segment_end *e, int64_t deadline, int wake_on_frame) {
    cat_segment *s = e->segment;
    for (;;) {
        if (s->pending || s->service_due <= s->now) {
            int failed = s->service(s->owner);
            if (failed)
                return failed;
        }
        if (wake_on_frame && line_ready(e, s->now))
            return 1;
        if (deadline <= s->now)
            return 0;
        int64_t until = earlier(line_wake_time(e, deadline, wake_on_frame), s->service_due);
        if (s->clock && until > s->now) {
            int result = s->clock->wait_until(s->clock->self, until);
            if (result < 0)
                return result;
            until = earlier(until, s->clock->now(s->clock->self));
        }
        lock(s);
        segment_advance(s, until);
        unlock(s);
    }
}

/* Let execution time of the thread that uses the link pass, and then do the due work. */
static int line_spend(void *self, int64_t duration) {
    segment_end *e = self;
    cat_segment *s = e->segment;
    int result = s->clock->spend(s->clock->self, duration);
    int64_t present = s->clock->now(s->clock->self);
    int passed = present > s->now ? wait_in_virtual_time(e, present, 0) : 0;
    return result < 0 ? result : passed;
}

static int wait_in_real_time(segment_end *e, int64_t deadline, int wake_on_frame) {
    cat_segment *s = e->segment;
    for (;;) {
        int64_t now = monotonic_now();
        lock(s);
        segment_advance(s, now);
        int ready = wake_on_frame && line_ready(e, now);
        int64_t until = line_wake_time(e, deadline, wake_on_frame);
        unlock(s);
        if (ready)
            return 1;
        if (deadline <= now)
            return 0;
        struct timespec t = {.tv_sec = until / 1000000000, .tv_nsec = until % 1000000000};
        if (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) == EINTR)
            return -EINTR;
    }
}

static int line_wait_until(void *self, int64_t deadline, int wake_on_frame) {
    segment_end *e = self;
    return e->segment->is_virtual ? wait_in_virtual_time(e, deadline, wake_on_frame)
                                  : wait_in_real_time(e, deadline, wake_on_frame);
}

#endif
