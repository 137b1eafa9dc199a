/* The clock of a loop over libethercat, as a link that carries no frames. */
#ifndef CATENARY_IGH_KERNEL_TIME_H
#define CATENARY_IGH_KERNEL_TIME_H

#include <errno.h>
#include <stdint.h>
#include <string.h>
#include <time.h>

#include "link.h"

/* The clock of the loop: CLOCK_MONOTONIC or virtual time, plus `offset`. While it follows the
 * reference clock, `rate_limit` of the exchange limits the change of `offset` per period. */
typedef struct igh_time {
    cat_link link;
    int is_virtual;
    int64_t virtual_now;
    int64_t offset;
} igh_time;

static int64_t igh_monotonic(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static int64_t igh_now(void *self)
{
    const igh_time *t = self;
    return (t->is_virtual ? t->virtual_now : igh_monotonic()) + t->offset;
}

static int igh_wait_until(void *self, int64_t deadline, int wake_on_frame)
{
    igh_time *t = self;
    struct timespec at;
    (void)wake_on_frame;
    deadline -= t->offset;
    if (t->is_virtual) {
        if (deadline > t->virtual_now)
            t->virtual_now = deadline;
        return 0;
    }
    if (deadline <= 0)
        return 0;
    at.tv_sec = deadline / 1000000000;
    at.tv_nsec = deadline % 1000000000;
    return -clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL);
}

static int igh_send_frame(void *self, const uint8_t *frame, uint32_t length)
{
    (void)self, (void)frame, (void)length;
    return -EOPNOTSUPP;
}

static int igh_receive_frame(void *self, const uint8_t **frame)
{
    (void)self, (void)frame;
    return 0;
}

static void igh_time_open(igh_time *t, int is_virtual)
{
    memset(t, 0, sizeof *t);
    t->is_virtual = is_virtual;
    t->virtual_now = 1000000000;
    t->link.version = CAT_LINK_VERSION;
    t->link.flags = is_virtual ? CAT_LINK_VIRTUAL_TIME : 0;
    t->link.self = t;
    t->link.send = igh_send_frame;
    t->link.receive = igh_receive_frame;
    t->link.now = igh_now;
    t->link.wait_until = igh_wait_until;
}

#endif
