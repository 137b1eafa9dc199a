/* The line: frames on their way, due work, and the two clocks.
 *
 * A frame is worked through all controllers when it is sent and comes back after its own length
 * on the wire and the delay of the line. In virtual time `now` advances in `wait_until` only. */
#ifndef CATENARY_VIRTUAL_LINE_H
#define CATENARY_VIRTUAL_LINE_H

#include <errno.h>
#include <time.h>
#include <unistd.h>

#include "controller.h"
#include "datagram.h"
#include "device_cycle.h"

enum {
    BYTE_NS = 80,                     /* 100 Mbit/s */
    FRAME_OVERHEAD = 8 + 4 + 12       /* preamble, check sequence, gap */
};

static int64_t monotonic_now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static void wake_service(cat_segment *s) {
    if (s->event_fd >= 0) {
        uint64_t one = 1;
        ssize_t written = write(s->event_fd, &one, sizeof one);   /* full: it is awake already */
        (void)written;
    }
}

static inline void lock(cat_segment *s) { pthread_mutex_lock(&s->mutex); }
static inline void unlock(cat_segment *s) { pthread_mutex_unlock(&s->mutex); }

/* All compiled work of one controller that is due at `now`; when the next is. */
static int64_t controller_advance(controller *c) {
    int64_t now = c->segment->now;
    if (c->due > now)
        return c->due;
    c->due = NEVER;
    device_advance(c);
    watchdog_check(c);
    sii_check(c);
    int64_t next = c->step_due < c->sync.due ? c->step_due : c->sync.due;
    next = c->watchdog_due < next ? c->watchdog_due : next;
    next = c->pdi_watchdog_due < next ? c->pdi_watchdog_due : next;
    next = c->sii.due < next ? c->sii.due : next;
    c->due = next;
    return next;
}

/* Runs compiled work up to `until`, in the order of its times; in virtual time it stops where an
 * event wants the application. */
static void segment_advance(cat_segment *s, int64_t until) {
    while (s->next_due <= until) {
        if (s->next_due > s->now)
            s->now = s->next_due;
        int64_t next = NEVER;
        s->next_due = NEVER;
        for (int n = 0; n < s->count; n++) {
            int64_t due = controller_advance(&s->controllers[n]);
            next = due < next ? due : next;
        }
        s->next_due = next < s->next_due ? next : s->next_due;
        if (s->is_virtual && s->pending)
            return;
    }
    if (until > s->now)
        s->now = until;
}

/* How long the line holds a frame, there and back [ns]. */
static int64_t line_delay(const cat_segment *s) {
    int64_t delay = 0;
    for (int n = 0; n < s->reachable; n++)
        delay += s->controllers[n].clock.hop;
    return 2 * delay;
}

static int line_send(void *self, const uint8_t *frame, uint32_t length) {
    cat_segment *s = self;
    if (length < ETHERNET_HEADER || length > CAT_FRAME_MAX)
        return -EMSGSIZE;
    lock(s);
    if (!s->is_virtual)
        segment_advance(s, monotonic_now());
    if (s->tail - s->head >= QUEUE_SIZE) {
        unlock(s);
        return -ENOBUFS;
    }
    int64_t start = s->busy_until > s->now ? s->busy_until : s->now;
    uint32_t on_wire = length < CAT_FRAME_MIN ? CAT_FRAME_MIN : length;
    int64_t duration = (int64_t)(on_wire + FRAME_OVERHEAD) * BYTE_NS;
    queued_frame *q = &s->queue[s->tail & (QUEUE_SIZE - 1)];
    memcpy(q->bytes, frame, length);
    if (length < CAT_FRAME_MIN)
        memset(q->bytes + length, 0, CAT_FRAME_MIN - length);
    q->length = on_wire;
    s->passage = start;
    s->busy_until = s->frame_end = start + duration;
    int keeps = frame_through(s, q->bytes, on_wire) && s->connected && s->reachable > 0;
    if (keeps) {
        q->arrival = start + duration + line_delay(s);
        s->tail++;
    } else
        s->counters.lost++;
    unlock(s);
    return 0;
}

static int64_t line_now(void *self) {
    cat_segment *s = self;
    return s->is_virtual ? s->now : monotonic_now();
}

static inline int line_ready(const cat_segment *s, int64_t now) {
    return s->head != s->tail && s->queue[s->head & (QUEUE_SIZE - 1)].arrival <= now;
}

static int line_receive(void *self, const uint8_t **frame) {
    cat_segment *s = self;
    lock(s);
    int length = 0;
    if (line_ready(s, line_now(s))) {
        const queued_frame *q = &s->queue[s->head & (QUEUE_SIZE - 1)];
        memcpy(s->taken, q->bytes, q->length);
        length = (int)q->length;
        s->head++;
        *frame = s->taken;
    }
    unlock(s);
    return length;
}

static inline int64_t earlier(int64_t a, int64_t b) { return a < b ? a : b; }

static int64_t line_wake_time(const cat_segment *s, int64_t deadline, int wake_on_frame) {
    if (wake_on_frame && s->head != s->tail)
        return earlier(deadline, s->queue[s->head & (QUEUE_SIZE - 1)].arrival);
    return deadline;
}

static int wait_in_virtual_time(cat_segment *s, int64_t deadline, int wake_on_frame) {
    for (;;) {
        if (s->pending || s->service_due <= s->now) {
            int failed = s->service(s->owner);
            if (failed)
                return failed;
        }
        if (wake_on_frame && line_ready(s, s->now))
            return 1;
        if (deadline <= s->now)
            return 0;
        int64_t until = earlier(line_wake_time(s, deadline, wake_on_frame), s->service_due);
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

/* Execution time of the thread that uses the link; then what has come due meanwhile. */
static int line_spend(void *self, int64_t duration) {
    cat_segment *s = self;
    int result = s->clock->spend(s->clock->self, duration);
    int64_t present = s->clock->now(s->clock->self);
    int passed = present > s->now ? wait_in_virtual_time(s, present, 0) : 0;
    return result < 0 ? result : passed;
}

static int wait_in_real_time(cat_segment *s, int64_t deadline, int wake_on_frame) {
    for (;;) {
        int64_t now = monotonic_now();
        lock(s);
        segment_advance(s, now);
        int ready = wake_on_frame && line_ready(s, now);
        int64_t until = line_wake_time(s, deadline, wake_on_frame);
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
    cat_segment *s = self;
    return s->is_virtual ? wait_in_virtual_time(s, deadline, wake_on_frame)
                         : wait_in_real_time(s, deadline, wake_on_frame);
}

#endif
