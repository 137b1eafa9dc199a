/* The line: frames in transit, due work, and virtual or real time.
 *
 * All controllers process a frame when it is sent. The frame returns after its transmission time and
 * the delay of its route, unless a cable on the route goes dark before. In virtual time, only
 * `wait_until` advances `now`. With a shared clock, `send`, `receive` and `spend` also
 * advance it. */
#ifndef CATENARY_VIRTUAL_LINE_H
#define CATENARY_VIRTUAL_LINE_H

#include "due_work.h"
#include "plant_time.h"

enum {
    BYTE_NS = 80,                     /* 100 Mbit/s */
    FRAME_OVERHEAD = 8 + 4 + 12       /* preamble, check sequence, gap */
};

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
        int failed = segment_serve(s);
        if (failed)
            return failed;
        if (wake_on_frame && line_ready(e, s->now))
            return 1;
        if (deadline <= s->now)
            return 0;
        int64_t until = earlier(line_wake_time(e, deadline, wake_on_frame), s->service_due);
        if (s->clock && until > s->now) {
            int result = s->clock->wait_until(s->clock->self, until);
            if (result < 0)
                return result;
            /* During the wait, another segment of the plant may have run the service. */
            until = earlier(earlier(until, s->service_due), s->clock->now(s->clock->self));
        }
        failed = virtual_advance(s, until);
        if (failed)
            return failed;
    }
}

/* Let execution time of the thread that uses the link pass, and then do the due work. */
static int line_spend(void *self, int64_t duration) {
    segment_end *e = self;
    cat_segment *s = e->segment;
    int result = s->clock->spend(s->clock->self, duration);
    if (result < 0)
        return result;
    int64_t present = s->clock->now(s->clock->self);
    return present > s->now ? wait_in_virtual_time(e, present, 0) : 0;
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
