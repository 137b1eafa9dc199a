/* Distributed clocks: local time, latched receive times, and the time control loop.
 *
 * Beckhoff, EtherCAT Slave Controller, section I §9.1 (functions) and section II §3.49 (registers);
 * ETG.1000.4 §6.10. Behaviour that the documents specify is implemented exactly:
 * - local copy of the system time = local time + offset; a frame reads it minus the delay;
 * - a received time is compared in its low 32 bits: difference = (local + offset - delay) - received;
 * - 0x092C is a mean of 2^(0x0934) differences, sign-magnitude, positive: the local copy is ahead;
 * - with the speed counter's start S and difference D, |D| <= S - 0x7F, the local clock deviates by
 *   D / (5 (S + D + 2) (S - D + 2)). That is 1 ns more every S - D + 2 ticks of 10 ns and 1 ns less
 *   every S + D + 2 ticks: the 9, 10 or 11 ns that a tick adds.
 * They do not specify how D follows from the differences. Here D = V - mean, where V is the mean of
 * 2^(0x0935) values of D. So D is the deviation between the clocks' periods once the difference has
 * settled, as the documents say; a larger S gives a smaller bandwidth. With the reset values a
 * clock that is 100 ppm off initially lags by 3 us ("will lock after a while", "many seconds":
 * SOEM#547). This matches the mean of 2^12: the 15 000 frames that the documents recommend at the
 * start are four times that. A larger share of the mean in D locks a clock sooner, but passes more
 * time stamp scatter on to it.
 *
 * Times are exact to a nanosecond; real controllers step by 10. */
#ifndef CATENARY_VIRTUAL_DISTRIBUTED_CLOCK_H
#define CATENARY_VIRTUAL_DISTRIBUTED_CLOCK_H

#include <math.h>

#include "controller/controller.h"

enum {
    SPEED_START_MIN = 0x0080,
    SPEED_START_MAX = 0x3FFF,
    SPEED_ROOM = 0x007F,             /* minimum distance of the difference from the start value */
    WAKE_UP_NS = 1234567             /* devices are powered up one after the other */
};

/* Local time at `when`; the fraction is stored separately. */
static inline double dc_elapsed(const dc_clock *k, int64_t when) {
    return k->fraction + crystal_count(&k->crystal, k->anchor, when) * (1.0 + k->correction);
}

static inline int64_t dc_local(const controller *c, int64_t when) {
    return c->clock.local + (int64_t)floor(dc_elapsed(&c->clock, when));
}

/* Anchor the clock: another rate may apply from here on. */
static inline void dc_anchor(controller *c, int64_t when) {
    dc_clock *k = &c->clock;
    double elapsed = dc_elapsed(k, when);
    double whole = floor(elapsed);
    k->local += (int64_t)whole;
    k->fraction = elapsed - whole;
    k->anchor = when;
}

static inline int64_t dc_offset(const controller *c) {
    const uint8_t *r = c->memory + REG_DC_OFFSET;
    return c->has_dc == 64 ? (int64_t)load64(r) : (int64_t)load32(r);
}

/* The local copy of the system time. */
static inline int64_t dc_system_time(const controller *c, int64_t when) {
    return (int64_t)((uint64_t)dc_local(c, when) + (uint64_t)dc_offset(c));
}

static inline void dc_store(const controller *c, uint32_t address, int64_t time) {
    if (c->has_dc == 64)
        store64(c->memory + address, (uint64_t)time);
    else
        store32(c->memory + address, (uint32_t)time);
}

/* Latch the receive times of a frame that started at `start`. It arrives at each port after
 * times[port] (NEVER: not there) and at the processing unit at `unit`. */
static void dc_latch(controller *c, int64_t start, const int64_t *times, int64_t unit) {
    if (!c->has_dc)
        return;
    int64_t processed = dc_local(c, unit) + crystal_scatter(&c->clock.crystal);
    for (int p = 0; p < PORTS; p++) {
        if (times[p] == NEVER)
            continue;
        int64_t at = p == 0 ? processed : dc_local(c, start + times[p]) + crystal_scatter(&c->clock.crystal);
        store32(c->memory + REG_DC_RECEIVE + 4 * p, (uint32_t)at);
    }
    dc_store(c, REG_DC_RECEIVE_UNIT, processed);
}

/* Relative amount by which speed counters run the local clock faster than its crystal. */
static inline double dc_correction(int start, int difference) {
    return 0.1 / (start - difference + 2) - 0.1 / (start + difference + 2);
}

static inline int dc_speed_start(const controller *c) {
    int start = load16(c->memory + REG_DC_SPEED_START) & 0x7FFF;
    return start < SPEED_START_MIN ? SPEED_START_MIN : start > SPEED_START_MAX ? SPEED_START_MAX : start;
}

static inline void dc_show_difference(controller *c) {
    double mean = c->clock.mean;
    uint32_t shown = fabs(mean) > 0x7FFFFFFF ? 0x7FFFFFFFu : (uint32_t)llround(fabs(mean));
    store32(c->memory + REG_DC_DIFFERENCE, shown | (mean < 0 && shown ? 0x80000000u : 0));
}

static void dc_steer(controller *c, double wanted, int64_t when) {
    int start = dc_speed_start(c), limit = start - SPEED_ROOM;
    double bounded = wanted > limit ? limit : wanted < -limit ? -limit : wanted;
    int difference = (int)lrint(bounded);
    c->clock.speed += (bounded - c->clock.speed) / (1 << (c->memory[REG_DC_FILTER_SPEED] & 15));
    dc_anchor(c, when);
    c->clock.correction = dc_correction(start, difference);
    store16(c->memory + REG_DC_SPEED_DIFFERENCE, (uint16_t)(int16_t)difference);
}

/* A write to the speed counter's start resets the loop. */
static void dc_reset_filters(controller *c, int64_t when) {
    c->clock.mean = c->clock.speed = 0;
    dc_show_difference(c);
    dc_steer(c, 0, when);
}

/* The system time minus the delay from the reference clock, as in frames. */
static inline uint64_t dc_received_time(controller *c, int64_t when) {
    uint64_t scatter = (uint64_t)crystal_scatter(&c->clock.crystal);
    return (uint64_t)dc_system_time(c, when) + scatter - load32(c->memory + REG_DC_DELAY);
}

/* Handle a system time received by FRMW, ARMW or a plain write: steer towards it. */
static void dc_receive_time(controller *c, uint32_t received, int64_t when) {
    dc_clock *k = &c->clock;
    int32_t difference = (int32_t)((uint32_t)dc_received_time(c, when) - received);
    k->mean += (difference - k->mean) / (1 << (c->memory[REG_DC_FILTER_DIFFERENCE] & 15));
    dc_show_difference(c);
    dc_steer(c, k->speed - k->mean, when);
}

/* Refresh the system time that a frame reads: that of passing the reference clock. */
static inline void dc_refresh(controller *c, int64_t when) {
    dc_store(c, REG_DC_SYSTEM_TIME, (int64_t)dc_received_time(c, when));
}

/* Change the crystal; the time counted so far stays. */
static void dc_tune(controller *c, double error, double swing, double turn, double scatter, int64_t when) {
    dc_anchor(c, when);
    crystal *x = &c->clock.crystal;
    x->error = error;
    x->swing = swing;
    x->turn = turn;
    x->scatter = scatter;
}

/* Reset to the state after power-on, except the crystal. `bits`: 0 no clock, 32 or 64. */
static void dc_power_on(controller *c, int bits) {
    dc_clock *k = &c->clock;
    c->has_dc = (uint8_t)bits;
    k->anchor = c->segment->now;
    k->local = (int64_t)(c->position + 1) * WAKE_UP_NS;
    k->fraction = k->correction = k->mean = k->speed = 0;
    k->crystal.random = 0x9E3779B97F4A7C15ull * (uint64_t)(c->position + 1);
    store16(c->memory + REG_DC_SPEED_START, 0x1000);
    c->memory[REG_DC_FILTER_DIFFERENCE] = 4;
    c->memory[REG_DC_FILTER_SPEED] = 12;
}

#endif
