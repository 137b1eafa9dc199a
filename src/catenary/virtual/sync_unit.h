/* SYNC0 and SYNC1: pulses at instants of the local copy of the system time, which move with it as
 * the time control loop steers. Beckhoff, EtherCAT Slave Controller, section I §9.2.3, section II
 * §3.49.4; the bits an ET1100 lacks (0x0981.3 to 7) are not there.
 *
 * The unit compares for "reached": a start time that is past when the unit is activated, or that an
 * offset written meanwhile jumps over, is reached when the clock has gone round: after at most 4.3 s
 * with 32 bits, in no one's lifetime with 64. With a pulse length of 0 the device acknowledges at
 * once, so that 0x098E and 0x098F read 0. */
#ifndef CATENARY_VIRTUAL_SYNC_UNIT_H
#define CATENARY_VIRTUAL_SYNC_UNIT_H

#include "distributed_clock.h"

enum {
    SYNC_ACTIVE = 0x01,              /* of 0x0981 */
    SYNC_PULSE_0 = 0x02,
    SYNC_PULSE_1 = 0x04,
    SYNC_BY_PDI = 0x01,              /* of 0x0980 */
    SYNC_PENDING_0 = 0x01,           /* of 0x0984 */
    SYNC_PENDING_1 = 0x02
};

#define SYNC_HOLD_MIN 10000           /* no device follows interrupts faster than this [ns] */
#define SYNC_HORIZON 1000000000000ll  /* a pulse further away is looked for again then [ns] */

/* May a frame write this byte of 0x0900 to 0x09FF now? */
static inline int clock_register_open(const controller *c, uint32_t address) {
    int upper = (address & 7) >= 4;
    int wide = address < REG_DC_DELAY || (address >= REG_SYNC_START && address < REG_SYNC0_CYCLE);
    if (c->has_dc == 32 && wide && upper && address >= REG_DC_SYSTEM_TIME)
        return 0;
    if (address < REG_SYNC_ACTIVATION || address >= REG_LATCH_CONTROL)
        return 1;
    if (c->memory[REG_SYNC_CONTROL] & SYNC_BY_PDI)
        return 0;
    return address < REG_SYNC_START || address >= REG_SYNC0_CYCLE
        || !(c->memory[REG_SYNC_ACTIVATION] & SYNC_ACTIVE);
}

/* When a counter that stands at `now` reads `time`. */
static inline int64_t sync_reached(const controller *c, int64_t time, int64_t now) {
    if (c->has_dc == 64)
        return time >= now ? time : NEVER;
    return now + (int64_t)((uint32_t)time - (uint32_t)now);
}

/* The instant of the segment's clock for the earlier pulse, at the present rate. */
static void sync_schedule(controller *c) {
    sync_unit *u = &c->sync;
    int64_t next = u->next0 < u->next1 ? u->next0 : u->next1;
    u->due = NEVER;
    if (next == NEVER)
        return;
    const dc_clock *k = &c->clock;
    int64_t left = next - (int64_t)((uint64_t)k->local + (uint64_t)dc_offset(c));
    if (left > SYNC_HORIZON)
        left = SYNC_HORIZON;
    double rate = crystal_rate(&k->crystal, k->anchor) * (1.0 + k->correction);
    u->due = k->anchor + (int64_t)ceil(((double)left - k->fraction) / rate);
    due_at(c, u->due);
}

static void sync_stop(controller *c) {
    c->sync.next0 = c->sync.next1 = c->sync.due = NEVER;
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
    u->next0 = sync_reached(c, (int64_t)load64(c->memory + REG_SYNC_START), dc_system_time(c, when));
    u->next1 = NEVER;
    c->memory[REG_SYNC_ACTIVATION_STATUS] = (uint8_t)((activation & SYNC_PULSE_0 ? SYNC_PENDING_0 : 0)
                                                      | (activation & SYNC_PULSE_1 ? SYNC_PENDING_1 : 0));
    sync_schedule(c);
}

/* The local copy of the system time jumped: pulses it jumped over come when it has gone round. */
static void sync_time_jumped(controller *c, int64_t when) {
    sync_unit *u = &c->sync;
    int64_t now = dc_system_time(c, when);
    if (u->next0 != NEVER)
        u->next0 = sync_reached(c, u->next0, now);
    if (u->next1 != NEVER)
        u->next1 = sync_reached(c, u->next1, now);
    sync_schedule(c);
}

/* SYNC1 comes its cycle time after a SYNC0, and after the first SYNC0 again that follows it. */
static int sync_pulse1(controller *c) {
    int shown = c->memory[REG_SYNC_ACTIVATION] & SYNC_PULSE_1;
    c->memory[REG_SYNC_ACTIVATION_STATUS] &= (uint8_t)~SYNC_PENDING_1;
    c->sync.next1 = NEVER;
    c->sync.pulses1 += shown != 0;
    return shown;
}

/* How long a signal is up. One whose next pulse comes before it is down stays up (section I
 * §9.2.3.1): no further pulse. */
static inline int64_t sync_hold(const controller *c) {
    int64_t length = 10 * (int64_t)load16(c->memory + REG_SYNC_PULSE_LENGTH);
    return length > SYNC_HOLD_MIN ? length : SYNC_HOLD_MIN;
}

static int sync_pulse0(controller *c) {
    sync_unit *u = &c->sync;
    uint32_t cycle = load32(c->memory + REG_SYNC0_CYCLE);
    int64_t now = u->next0;
    c->memory[REG_SYNC_ACTIVATION_STATUS] &= (uint8_t)~SYNC_PENDING_0;
    u->next0 = cycle > sync_hold(c) ? now + cycle : NEVER;   /* 0: a single shot */
    if (u->next1 == NEVER)
        u->next1 = now + load32(c->memory + REG_SYNC1_CYCLE);
    if (u->next0 != NEVER)
        dc_store(c, REG_SYNC_START, u->next0);
    dc_store(c, REG_SYNC_NEXT1, u->next1);
    int shown = c->memory[REG_SYNC_ACTIVATION] & SYNC_PULSE_0;
    u->pulses0 += shown != 0;
    return u->next1 == now ? shown | sync_pulse1(c) : shown;
}

/* What is due at the segment's present. Returns the pulses that the device gets: SYNC_PULSE_0, _1.
 * The rate swings and a product of it is rounded, so that a pulse may still be a hair away at the
 * instant computed for it: counted from here on, it is at least 1 ns ahead and comes nearer. */
static int sync_advance(controller *c) {
    sync_unit *u = &c->sync;
    dc_anchor(c, c->segment->now);
    int64_t now = dc_system_time(c, c->segment->now);
    int pulses = 0;
    if (u->next1 < u->next0 && u->next1 <= now)
        pulses = sync_pulse1(c);
    if (u->next0 <= now)
        pulses |= sync_pulse0(c);
    if (u->next1 <= now)             /* a SYNC0 at the same time does not start the next SYNC1 */
        pulses |= sync_pulse1(c);
    sync_schedule(c);
    return pulses;
}

/* What a write of [first, end) in the clocks' registers sets going, latched times apart. */
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
