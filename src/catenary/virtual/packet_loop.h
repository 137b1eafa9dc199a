/* Packet loop that serves a segment on one NIC, or on two for a ring. It is independent of `link`, so
 * that each tests the other. The loop blocks in poll, and steps the models after it has sent the
 * answer. If a device synchronises to SYNC pulses, the loop also steps them before each frame. Time
 * budget from the arrival of a frame to its answer: 10 us on an idle core.
 *
 * A cable does not store frames. Therefore the loop drops a frame that was in the socket for longer
 * than `max_age`. The age of a frame is the difference between CLOCK_REALTIME and the receive time
 * from the kernel (SO_TIMESTAMPNS, socket(7)). If this clock is set, frames in the socket can be
 * dropped or appear to be new. */
#ifndef CATENARY_VIRTUAL_PACKET_LOOP_H
#define CATENARY_VIRTUAL_PACKET_LOOP_H

#ifndef _GNU_SOURCE
#define _GNU_SOURCE                   /* ppoll */
#endif
#include <errno.h>
#include <poll.h>
#include <sys/socket.h>
#include <linux/if_packet.h>

#include "line.h"

/* Complete EEPROM accesses before the frame that reads their result. All other models can run later. */
static void finish_sii(cat_segment *s) {
    s->sii_due = NEVER;
    for (int n = 0; n < s->count; n++) {
        controller *c = &s->controllers[n];
        sii_check(c);
        if (c->sii.due < s->sii_due)
            s->sii_due = c->sii.due;
    }
}

/* Send a frame on its interface; return 0 or -errno. If the queue of the interface is full, the frame is
 * lost. */
static int packet_send(const int *fds, int end, const uint8_t *frame, uint32_t length) {
    if (fds[end] < 0 || send(fds[end], frame, length, 0) >= 0)
        return 0;
    return errno == ENOBUFS || errno == EAGAIN ? 0 : -errno;
}

/* Queue a frame that a fault delays, for its interface. If the queue is full, drop the frame. */
static void packet_delay(cat_segment *s, int end, const uint8_t *frame, uint32_t length, int64_t delay) {
    segment_end *e = &s->ends[end];
    if (queue_full(e))
        return;
    queued_frame *q = queue_place(e);
    memcpy(q->bytes, frame, length);
    q->length = length;
    q->arrival = s->now + delay;
    queue_put(e);
}

/* Process a frame and send it, or queue it if a fault delays it. Return 0 or -errno. */
static int packet_through(cat_segment *s, const int *fds, int from, uint8_t *frame, uint32_t length) {
    lock(s);
    s->passage = monotonic_now();
    if (s->synchronous)               /* latch SYNC0 data from before this frame */
        segment_advance(s, s->passage);
    if (s->passage > s->now)
        s->now = s->passage;
    if (s->link_due <= s->now)
        links_check(s);
    if (s->sii_due <= s->now)
        finish_sii(s);
    routes_refresh(s);
    const route *r = &s->routes[from];
    fate fate = s->fault_count ? fate_of(s, r) : NO_FATE;
    int end = frame_through(s, r, &fate, frame, length);
    if (end < 0)
        frame_lost(s, -end, from, s->passage);
    else if (fate.garble)
        frame_garble(s, frame, length, fate.offset);
    if (end >= 0 && fate.delay)
        packet_delay(s, end, frame, length, fate.delay);
    unlock(s);
    if (end < 0 || fate.delay)
        return 0;
    int result = packet_send(fds, end, frame, length);
    return result == 0 && fate.duplicate ? packet_send(fds, end, frame, length) : result;
}

/* Return the time that a received frame spent in the socket [ns]; 0 if it has no time stamp. */
static int64_t packet_age(struct msghdr *message) {
    for (struct cmsghdr *c = CMSG_FIRSTHDR(message); c; c = CMSG_NXTHDR(message, c)) {
        if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SCM_TIMESTAMPNS)
            continue;
        struct timespec now, then;
        memcpy(&then, CMSG_DATA(c), sizeof then);
        clock_gettime(CLOCK_REALTIME, &now);
        return (int64_t)(now.tv_sec - then.tv_sec) * 1000000000 + now.tv_nsec - then.tv_nsec;
    }
    return 0;
}

static void packet_expired(cat_segment *s, int from, int64_t age) {
    lock(s);
    s->counters.expired++;
    frame_lost(s, LOSS_EXPIRED, from, monotonic_now() - age);
    unlock(s);
}

/* Answer one frame. Return 1 if it was answered or ignored, 0 if there is no frame, or -errno. */
static int packet_answer(cat_segment *s, const int *fds, int from, int64_t max_age) {
    static __thread uint8_t frame[65536 + 64];
    union { struct cmsghdr align; uint8_t bytes[CMSG_SPACE(sizeof(struct timespec))]; } control;
    struct sockaddr_ll sender = {0};
    struct iovec part = {.iov_base = frame, .iov_len = sizeof frame};
    struct msghdr message = {.msg_name = &sender, .msg_namelen = sizeof sender, .msg_iov = &part,
                             .msg_iovlen = 1, .msg_control = &control, .msg_controllen = sizeof control};
    if (fds[from] < 0)
        return 0;
    ssize_t length = recvmsg(fds[from], &message, MSG_DONTWAIT);
    if (length < 0)
        return errno == EAGAIN || errno == EINTR ? 0 : -errno;
    if (sender.sll_pkttype == PACKET_OUTGOING)
        return 1;
    int64_t age = packet_age(&message);
    if (length > (ssize_t)CAT_FRAME_MAX)
        s->counters.malformed++;
    else if (!frame_is_ours(frame, (uint32_t)length))
        s->counters.foreign++;
    else if (age > max_age)
        packet_expired(s, from, age);
    else {
        int result = packet_through(s, fds, from, frame, (uint32_t)length);
        return result < 0 ? result : 1;
    }
    return 1;
}

/* Send frames whose delay has passed; return 0 or -errno. *next receives the time of the next one. */
static int packets_due(cat_segment *s, const int *fds, int64_t *next) {
    *next = NEVER;
    for (int n = 0; n <= s->ring; n++) {
        segment_end *e = &s->ends[n];
        for (; line_ready(e, monotonic_now()); e->head++) {
            const queued_frame *q = queue_first(e);
            int result = packet_send(fds, n, q->bytes, q->length);
            if (result < 0)
                return result;
        }
        *next = queue_first(e) ? earlier(*next, queue_first(e)->arrival) : *next;
    }
    return 0;
}

/* Answer up to 64 frames from each interface in turn; return 0 or -errno. The limit lets the models run
 * under load. */
static int packets_answer(cat_segment *s, const int *fds, int64_t max_age) {
    int answered = 1;
    for (int burst = 0; burst < 64 && answered; burst++) {
        answered = 0;
        for (int n = 0; n < 2; n++) {
            int result = packet_answer(s, fds, n, max_age);
            if (result < 0)
                return result;
            answered |= result;
        }
    }
    return 0;
}

static int packet_loop(cat_segment *s, int fd, int second_fd, int stop_fd, int64_t max_age) {
    const int fds[2] = {fd, second_fd};
    struct pollfd wait[3] = {{.fd = fd, .events = POLLIN}, {.fd = stop_fd, .events = POLLIN},
                             {.fd = second_fd, .events = POLLIN}};
    for (;;) {
        int64_t next, now = monotonic_now();
        int result = packets_due(s, fds, &next);
        if (result < 0)
            return result;
        int64_t left = next > now ? next - now : 0;
        struct timespec timeout = {.tv_sec = left / 1000000000, .tv_nsec = left % 1000000000};
        if (ppoll(wait, 3, next == NEVER ? NULL : &timeout, NULL) < 0 && errno != EINTR)
            return -errno;
        if (wait[1].revents)
            return 0;
        result = packets_answer(s, fds, max_age);
        if (result < 0)
            return result;
        lock(s);
        segment_advance(s, monotonic_now());
        unlock(s);
    }
}

#endif
