/* Distributed clocks, ETG.1000.4 §6.10: local time, latched receive times, offset, and the control
 * loop that a written system time drives.
 *
 * The control loop is a filtered proportional-integral one of the real one's shape (mean of
 * 2^depth differences, bounded correction of the rate), not its exact arithmetic. */
#ifndef CATENARY_VIRTUAL_DISTRIBUTED_CLOCK_H
#define CATENARY_VIRTUAL_DISTRIBUTED_CLOCK_H

#include <math.h>

#include "controller.h"

#define DC_CORRECTION_MAX 100e-6      /* the rate is corrected by at most this share */

static inline int64_t dc_local(const controller *c, int64_t when) {
    const dc_clock *k = &c->clock;
    return k->local + (int64_t)llround((double)(when - k->anchor) * (k->rate + k->correction));
}

static inline void dc_anchor(controller *c, int64_t when) {
    c->clock.local = dc_local(c, when);
    c->clock.anchor = when;
}

static inline int64_t dc_system_time(const controller *c, int64_t when) {
    return dc_local(c, when) + (int64_t)load64(c->memory + REG_DC_OFFSET);
}

/* Port 0's time is when the frame comes in; port 1's when it comes back from the devices behind. */
static void dc_latch(controller *c, int64_t in, int64_t back, int behind) {
    if (!c->has_dc)
        return;
    store32(c->memory + REG_DC_RECEIVE, (uint32_t)dc_local(c, in));
    if (behind)
        store32(c->memory + REG_DC_RECEIVE + 4, (uint32_t)dc_local(c, back));
    store64(c->memory + REG_DC_RECEIVE_UNIT, (uint64_t)dc_local(c, in));
}

static void dc_reset_filter(controller *c) {
    c->clock.mean = 0;
    dc_anchor(c, c->segment->now);
    c->clock.correction = 0;
    store32(c->memory + REG_DC_DIFFERENCE, 0);
    store16(c->memory + REG_DC_SPEED_DIFFERENCE, 0);
}

/* A system time arrived by FRMW, ARMW or a plain write: steer towards it. */
static void dc_receive_time(controller *c, uint64_t received, int wide, int64_t when) {
    if (!c->has_dc)
        return;
    int64_t own = dc_system_time(c, when) - (int64_t)load32(c->memory + REG_DC_DELAY);
    int64_t difference = wide ? own - (int64_t)received : (int32_t)((uint32_t)own - (uint32_t)received);
    double bounded = difference > 1000000000 ? 1e9 : difference < -1000000000 ? -1e9 : (double)difference;
    int depth = c->memory[REG_DC_FILTER_DIFFERENCE] & 15;
    c->clock.mean += (bounded - c->clock.mean) / (double)(1 << depth);
    double magnitude = fabs(c->clock.mean);
    uint32_t shown = magnitude > 0x7FFFFFFF ? 0x7FFFFFFFu : (uint32_t)llround(magnitude);
    store32(c->memory + REG_DC_DIFFERENCE, shown | (c->clock.mean < 0 ? 0x80000000u : 0));
    dc_anchor(c, when);
    double correction = c->clock.correction - c->clock.mean * 2e-9;
    correction = fmin(DC_CORRECTION_MAX, fmax(-DC_CORRECTION_MAX, correction));
    c->clock.correction = 0.9 * c->clock.correction + 0.1 * correction;
    /* proportional part: a tenth of the mean at once */
    double step = fmin(100.0, fmax(-100.0, c->clock.mean * 0.1));
    c->clock.local -= (int64_t)step;
    store16(c->memory + REG_DC_SPEED_DIFFERENCE, (uint16_t)(int16_t)llround(c->clock.correction * 1e7));
}

/* Registers that show a running clock are made when they are read. */
static inline void dc_refresh(controller *c, int64_t when) {
    store64(c->memory + REG_DC_SYSTEM_TIME, (uint64_t)dc_system_time(c, when));
}

#endif
