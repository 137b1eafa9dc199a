/* The segment on a NIC: its own small packet loop, apart from `link`, so that the two judge each
 * other. Blocks in poll; the models are stepped after the answer has left.
 * Budget from frame in to frame out: 10 us on an idle core. */
#ifndef CATENARY_VIRTUAL_PACKET_LOOP_H
#define CATENARY_VIRTUAL_PACKET_LOOP_H

#include <errno.h>
#include <poll.h>
#include <sys/socket.h>
#include <linux/if_packet.h>

#include "line.h"

/* EEPROM accesses end before the frame that asks; all other models may be stepped after it. */
static void finish_sii(cat_segment *s) {
    s->sii_due = NEVER;
    for (int n = 0; n < s->count; n++) {
        controller *c = &s->controllers[n];
        sii_check(c);
        if (c->sii.due < s->sii_due)
            s->sii_due = c->sii.due;
    }
}

/* 1: answered or passed over, 0: nothing there, or -errno. */
static int packet_answer(cat_segment *s, int fd) {
    static __thread uint8_t frame[65536 + 64];
    struct sockaddr_ll from;
    socklen_t size = sizeof from;
    ssize_t length = recvfrom(fd, frame, sizeof frame, MSG_DONTWAIT, (struct sockaddr *)&from, &size);
    if (length < 0)
        return errno == EAGAIN || errno == EINTR ? 0 : -errno;
    if (from.sll_pkttype == PACKET_OUTGOING)
        return 1;
    if (length > (ssize_t)CAT_FRAME_MAX) {
        s->counters.malformed++;
        return 1;
    }
    lock(s);
    s->passage = monotonic_now();
    if (s->synchronous)               /* what SYNC0 latches was latched before this frame came */
        segment_advance(s, s->passage);
    if (s->passage > s->now)
        s->now = s->passage;
    if (s->sii_due <= s->now)
        finish_sii(s);
    int back = frame_through(s, frame, (uint32_t)length) && s->connected && s->reachable > 0;
    unlock(s);
    if (back && send(fd, frame, (size_t)length, 0) < 0 && errno != ENOBUFS && errno != EAGAIN)
        return -errno;
    return 1;
}

static int packet_loop(cat_segment *s, int fd, int stop_fd) {
    struct pollfd wait[2] = {{.fd = fd, .events = POLLIN}, {.fd = stop_fd, .events = POLLIN}};
    for (;;) {
        if (poll(wait, 2, -1) < 0 && errno != EINTR)
            return -errno;
        if (wait[1].revents)
            return 0;
        int answered = 1;
        for (int burst = 0; burst < 64 && answered > 0; burst++)
            answered = packet_answer(s, fd);
        if (answered < 0)
            return answered;
        lock(s);
        segment_advance(s, monotonic_now());
        unlock(s);
    }
}

#endif
