/* SYNC0 and SYNC1: pulses at given values of the local copy of the system time, which the time
 * control loop steers. Source: Beckhoff, EtherCAT Slave Controller, section I §9.2.3 and section II
 * §3.49.4. Bits that an ET1100 does not have (0x0981.3 to 7) are not implemented.
 *
 * The unit compares for equality. If the start time is in the past at activation, or if a new offset
 * jumps over it, the pulse occurs after the clock has wrapped. This takes at most 4.3 s with 32 bits,
 * and practically never happens with 64 bits. With a pulse length of 0, the device acknowledges the
 * pulse immediately, so that 0x098E and 0x098F read 0.
 *
 * Frames can write any value into these times. They are counted modulo 2^64. The distance to a
 * pulse is their difference, limited to SYNC_HORIZON. A pending pulse is less than 2^63 ns ahead. */
#ifndef CATENARY_VIRTUAL_SYNC_UNIT_H
#define CATENARY_VIRTUAL_SYNC_UNIT_H

#include "controller/distributed_clock.h"
#include "controller/latch_unit.h"

enum {
    SYNC_ACTIVE = 0x01,              /* in 0x0981 */
    SYNC_PULSE_0 = 0x02,
    SYNC_PULSE_1 = 0x04,
    SYNC_BY_PDI = 0x01,              /* in 0x0980 */
    SYNC_PENDING_0 = 0x01,           /* in 0x0984 */
    SYNC_PENDING_1 = 0x02
};

#define SYNC_HOLD_MIN 10000           /* shortest interrupt interval that a device can handle [ns] */
#define SYNC_HORIZON 1000000000000ll  /* distance at which a farther pulse is scheduled again [ns] */

/* Return 1 if a frame may write this byte of 0x0900 to 0x09FF now. */
static inline int clock_register_open(const controller *c, uint32_t address) {
    int upper = (address & 7) >= 4;
    int wide = address < REG_DC_DELAY || (address >= REG_SYNC_START && address < REG_SYNC0_CYCLE);
    if (c->has_dc == 32 && wide && upper && address >= REG_DC_SYSTEM_TIME)
        return 0;
    if (address >= REG_LATCH_CONTROL && address < REG_LATCH_CONTROL + LATCH_INPUTS)
        return !latch_by_pdi(c, (int)(address - REG_LATCH_CONTROL));
    if (address < REG_SYNC_ACTIVATION || address >= REG_LATCH_CONTROL)
        return 1;
    if (c->memory[REG_SYNC_CONTROL] & SYNC_BY_PDI)
        return 0;
    return address < REG_SYNC_START || address >= REG_SYNC0_CYCLE
        || !(c->memory[REG_SYNC_ACTIVATION] & SYNC_ACTIVE);
}

/* Extend *time to the next time at which a clock that now reads `now` reaches it. Return 1 if that is
 * within 2^63 ns. */
static inline uint8_t sync_await(const controller *c, uint64_t *time, uint64_t now) {
    uint64_t ahead = c->has_dc == 64 ? *time - now : (uint32_t)(*time - now);
    *time = now + ahead;
    return ahead <= INT64_MAX;
}

/* Return the distance from `now` to `time`, limited to SYNC_HORIZON in both directions. A distance of 0 or
 * less means reached. */
static inline int64_t sync_ahead(uint64_t time, uint64_t now) {
    int64_t ahead = (int64_t)(time - now);
    return ahead < -SYNC_HORIZON ? -SYNC_HORIZON : ahead > SYNC_HORIZON ? SYNC_HORIZON : ahead;
}

static inline int sync_reached(int awaits, uint64_t time, uint64_t now) {
    return awaits && sync_ahead(time, now) <= 0;
}

/* Schedule the next pulse. Its segment time is computed from the present rate of the clock. */
static void sync_schedule(controller *c) {
    sync_unit *u = &c->sync;
    u->due = NEVER;
    if (!u->awaits0 && !u->awaits1)
        return;
    const dc_clock *k = &c->clock;
    uint64_t now = (uint64_t)k->local + (uint64_t)dc_offset(c);
    int64_t left0 = u->awaits0 ? sync_ahead(u->next0, now) : SYNC_HORIZON;
    int64_t left1 = u->awaits1 ? sync_ahead(u->next1, now) : SYNC_HORIZON;
    double left = (double)(left0 < left1 ? left0 : left1);
    double rate = crystal_rate(&k->crystal, k->anchor) * (1.0 + k->correction);
    u->due = k->anchor + (int64_t)ceil((left - k->fraction) / rate);
    due_at(c, u->due);
}

static void sync_stop(controller *c) {
    c->sync.due = NEVER;
    c->sync.awaits0 = c->sync.awaits1 = 0;
    c->memory[REG_SYNC_ACTIVATION_STATUS] = 0;
}

static void sync_activation_written(controller *c, int64_t when) {
    sync_unit *u = &c->sync;
    uint8_t activation = c->memory[REG_SYNC_ACTIVATION];
    int was_active = u->active;
    u->active = activation & SYNC_ACTIVE;
    if (!u->active)
        sync_stop(c);
    if (!u->active || was_active)
        return;
    u->next0 = load64(c->memory + REG_SYNC_START);
    u->awaits0 = sync_await(c, &u->next0, (uint64_t)dc_system_time(c, when));
    u->awaits1 = 0;
    c->memory[REG_SYNC_ACTIVATION_STATUS] = (uint8_t)((activation & SYNC_PULSE_0 ? SYNC_PENDING_0 : 0)
                                                      | (activation & SYNC_PULSE_1 ? SYNC_PENDING_1 : 0));
    sync_schedule(c);
}

/* Handle a jump of the local system time. Skipped pulses occur after the clock has wrapped. */
static void sync_time_jumped(controller *c, int64_t when) {
    sync_unit *u = &c->sync;
    uint64_t now = (uint64_t)dc_system_time(c, when);
    if (u->awaits0)
        u->awaits0 = sync_await(c, &u->next0, now);
    if (u->awaits1)
        u->awaits1 = sync_await(c, &u->next1, now);
    sync_schedule(c);
}

/* Emit SYNC1. Return SYNC_PULSE_1 if the device receives it, or 0. SYNC1 follows a SYNC0 after the time
 * in 0x09A4. The first SYNC0 after SYNC1 starts this time again. */
static int sync_pulse1(controller *c) {
    int shown = c->memory[REG_SYNC_ACTIVATION] & SYNC_PULSE_1;
    c->memory[REG_SYNC_ACTIVATION_STATUS] &= (uint8_t)~SYNC_PENDING_1;
    c->sync.awaits1 = 0;
    c->sync.pulses1 += shown != 0;
    return shown;
}

/* Return the duration of a pulse, at least SYNC_HOLD_MIN [ns]. If the next pulse is due before the end
 * of the pulse, the signal stays active and no further pulses occur (section I §9.2.3.1). */
static inline int64_t sync_hold(const controller *c) {
    int64_t length = 10 * (int64_t)load16(c->memory + REG_SYNC_PULSE_LENGTH);
    return length > SYNC_HOLD_MIN ? length : SYNC_HOLD_MIN;
}

static int sync_pulse0(controller *c) {
    sync_unit *u = &c->sync;
    uint32_t cycle = load32(c->memory + REG_SYNC0_CYCLE);
    uint64_t now = u->next0;
    c->memory[REG_SYNC_ACTIVATION_STATUS] &= (uint8_t)~SYNC_PENDING_0;
    u->awaits0 = cycle > sync_hold(c);                       /* 0: single shot */
    u->next0 = now + cycle;
    if (!u->awaits1)
        u->next1 = now + load32(c->memory + REG_SYNC1_CYCLE);
    u->awaits1 = 1;
    if (u->awaits0)
        dc_store(c, REG_SYNC_START, (int64_t)u->next0);
    dc_store(c, REG_SYNC_NEXT1, (int64_t)u->next1);
    int shown = c->memory[REG_SYNC_ACTIVATION] & SYNC_PULSE_0;
    u->pulses0 += shown != 0;
    return u->next1 == now ? shown | sync_pulse1(c) : shown;
}

/* Handle pulses that are due at the segment's time. Return the pulses that the device receives, as
 * SYNC_PULSE_0 and SYNC_PULSE_1. The rate varies and products are rounded, so a pulse can still be
 * slightly ahead at its computed time. It is then scheduled again, at least 1 ns later. */
static int sync_advance(controller *c) {
    sync_unit *u = &c->sync;
    dc_anchor(c, c->segment->now);
    uint64_t now = (uint64_t)dc_system_time(c, c->segment->now);
    int pulses = 0;
    if (sync_reached(u->awaits1, u->next1, now) && !(u->awaits0 && sync_ahead(u->next0, u->next1) <= 0))
        pulses = sync_pulse1(c);
    if (sync_reached(u->awaits0, u->next0, now))
        pulses |= sync_pulse0(c);
    if (sync_reached(u->awaits1, u->next1, now))    /* a SYNC0 at the same time does not start the next SYNC1 */
        pulses |= sync_pulse1(c);
    sync_schedule(c);
    return pulses;
}

/* Apply the effects of a write to clock registers [first, end), except the latching of times. */
static void clock_registers_written(controller *c, uint32_t first, uint32_t end, const uint8_t *data, int64_t when) {
    if (first <= REG_DC_SYSTEM_TIME && end >= REG_DC_SYSTEM_TIME + 4) {
        dc_receive_time(c, load32(data + (REG_DC_SYSTEM_TIME - first)), when);
        sync_schedule(c);
    }
    if (first < REG_DC_DELAY && end > REG_DC_OFFSET)
        sync_time_jumped(c, when);
    if (first < REG_DC_SPEED_DIFFERENCE && end > REG_DC_SPEED_START) {
        dc_reset_filters(c, when);
        sync_schedule(c);
    }
    if (first <= REG_SYNC_ACTIVATION && end > REG_SYNC_ACTIVATION)
        sync_activation_written(c, when);
}

#endif
