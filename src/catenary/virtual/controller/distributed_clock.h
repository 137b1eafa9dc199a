/* Distributed clocks: local time, latched receive times, and the time control loop.
 *
 * Sources: Beckhoff, EtherCAT Slave Controller, section I §9.1 (functions) and section II §3.49
 * (registers); ETG.1000.4 §6.10. The code implements specified behaviour exactly:
 * - Local copy of the system time = local time + offset. A frame reads it minus the delay.
 * - The low 32 bits of a received time are compared:
 *   difference = (local + offset - delay) - received.
 * - 0x092C is the mean of 2^(0x0934) differences in sign-magnitude format. Positive: the local copy
 *   is ahead.
 * - With the start S and the difference D of the speed counter, |D| <= S - 0x7F, the relative
 *   deviation of the local clock is D / (5 (S + D + 2) (S - D + 2)). It gains 1 ns every S - D + 2
 *   ticks of 10 ns and loses 1 ns every S + D + 2 ticks, so a tick adds 9, 10 or 11 ns.
 *
 * The documents do not specify how D follows from the differences. Here D = V - mean, where V is the
 * mean of 2^(0x0935) values of D. When the difference has settled, D is the deviation between the
 * periods of the clocks, as the documents require. A larger S gives a smaller bandwidth. With the
 * reset values, a clock with an error of 100 ppm initially lags by 3 us (SOEM#547: "will lock after a
 * while", "many seconds"). This agrees with the mean of 2^12 values: the documents recommend 15 000
 * initial frames, which is about four times this number. A larger weight of the mean in D would
 * lock a clock sooner, but would also pass on more scatter of time stamps.
 *
 * Times have a resolution of 1 ns. Real controllers have a resolution of 10 ns. */
#ifndef CATENARY_VIRTUAL_DISTRIBUTED_CLOCK_H
#define CATENARY_VIRTUAL_DISTRIBUTED_CLOCK_H

#include <math.h>

#include "controller/controller.h"

enum {
    SPEED_START_MIN = 0x0080,
    SPEED_START_MAX = 0x3FFF,
    SPEED_ROOM = 0x007F,             /* minimum distance of the difference from the start value */
    WAKE_UP_NS = 1234567             /* interval between the power-up of successive devices */
};

/* Return the time since the anchor at `when`, including the stored fraction [ns]. */
static inline double dc_elapsed(const dc_clock *k, int64_t when) {
    return k->fraction + crystal_count(&k->crystal, k->anchor, when) * (1.0 + k->correction);
}

static inline int64_t dc_local(const controller *c, int64_t when) {
    return c->clock.local + (int64_t)floor(dc_elapsed(&c->clock, when));
}

/* Move the anchor of the clock to `when`, so that the rate can change there. */
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

/* Return the local copy of the system time. */
static inline int64_t dc_system_time(const controller *c, int64_t when) {
    return (int64_t)((uint64_t)dc_local(c, when) + (uint64_t)dc_offset(c));
}

static inline void dc_store(const controller *c, uint32_t address, int64_t time) {
    if (c->has_dc == 64)
        store64(c->memory + address, (uint64_t)time);
    else
        store32(c->memory + address, (uint32_t)time);
}

/* Latch the receive times of a frame that was sent at `start`. It arrives at each port after
 * times[port] (NEVER: it does not arrive), and at the processing unit at `unit`. */
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

/* Return the relative amount by which the speed counter speeds up the local clock. */
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

/* Reset the loop, after a write to the start value of the speed counter. */
static void dc_reset_filters(controller *c, int64_t when) {
    c->clock.mean = c->clock.speed = 0;
    dc_show_difference(c);
    dc_steer(c, 0, when);
}

/* Return the system time minus the delay from the reference clock, with scatter, as a frame reads it. */
static inline uint64_t dc_received_time(controller *c, int64_t when) {
    uint64_t scatter = (uint64_t)crystal_scatter(&c->clock.crystal);
    return (uint64_t)dc_system_time(c, when) + scatter - load32(c->memory + REG_DC_DELAY);
}

/* Steer the clock towards a system time that was received by FRMW, ARMW or a plain write. */
static void dc_receive_time(controller *c, uint32_t received, int64_t when) {
    dc_clock *k = &c->clock;
    int32_t difference = (int32_t)((uint32_t)dc_received_time(c, when) - received);
    k->mean += (difference - k->mean) / (1 << (c->memory[REG_DC_FILTER_DIFFERENCE] & 15));
    dc_show_difference(c);
    dc_steer(c, k->speed - k->mean, when);
}

/* Update the system time register before a frame reads it. */
static inline void dc_refresh(controller *c, int64_t when) {
    dc_store(c, REG_DC_SYSTEM_TIME, (int64_t)dc_received_time(c, when));
}

/* Change the crystal without changing the present time. */
static void dc_tune(controller *c, double error, double swing, double turn, double scatter, int64_t when) {
    dc_anchor(c, when);
    crystal *x = &c->clock.crystal;
    x->error = error;
    x->swing = swing;
    x->turn = turn;
    x->scatter = scatter;
}

/* Reset the clock to its state after power-on, except the errors of the crystal. `bits`: 0 (no clock),
 * 32 or 64. */
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
