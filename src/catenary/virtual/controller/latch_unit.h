/* Latch unit: the system time of edges at the inputs LATCH0 and LATCH1, 0x09A8 to 0x09CF. Source: Beckhoff,
 * EtherCAT Slave Controller, section I §9.2.4 and section II, registers 0x09A8 to 0x09C8.
 *
 * In continuous mode, each edge replaces the time of the last one, and the status shows no event. In
 * single-event mode, the first edge is kept, and its status bit is set, until the time is read. Frames
 * configure and acknowledge an input only while its bit in 0x0980 gives it to EtherCAT. */
#ifndef CATENARY_VIRTUAL_LATCH_UNIT_H
#define CATENARY_VIRTUAL_LATCH_UNIT_H

#include "controller/distributed_clock.h"

enum {
    LATCH_INPUTS = 2,
    LATCH0_BY_PDI = 0x10,             /* in 0x0980; << 1: LATCH1 */
    LATCH_PIN = 0x04,                 /* in 0x09AE and 0x09AF; 0x01, 0x02: event of the positive, negative edge */
    LATCH_EVENTS = 0x03,
    LATCH_TIME_SIZE = 8
};

static inline uint32_t latch_time_register(int input, int falling) {
    return REG_LATCH_TIMES + (uint32_t)(2 * input + falling) * LATCH_TIME_SIZE;
}

static inline int latch_by_pdi(const controller *c, int input) {
    return (c->memory[REG_SYNC_CONTROL] & LATCH0_BY_PDI << input) != 0;
}

/* Show in the ECAT event register if an input of EtherCAT has an event. */
static void latch_events_show(controller *c) {
    int pending = 0;
    for (int input = 0; input < LATCH_INPUTS; input++)
        pending |= !latch_by_pdi(c, input) && (c->memory[REG_LATCH_STATUS + input] & LATCH_EVENTS);
    uint16_t events = load16(c->memory + REG_ECAT_EVENT) & (uint16_t)~ECAT_EVENT_LATCH;
    store16(c->memory + REG_ECAT_EVENT, pending ? events | ECAT_EVENT_LATCH : events);
}

/* Set the level of an input at a time of the segment. */
static void latch_input(controller *c, int input, int level, int64_t when) {
    uint8_t *status = c->memory + REG_LATCH_STATUS + input;
    int falling = !level;
    uint8_t event = (uint8_t)(1 << falling);
    if (!c->has_dc || !(*status & LATCH_PIN) == !level)
        return;
    *status ^= LATCH_PIN;
    if (*status & event)
        return;
    dc_store(c, latch_time_register(input, falling), dc_system_time(c, when));
    if (c->memory[REG_LATCH_CONTROL + input] & event)
        *status |= event;
    latch_events_show(c);
}

/* Acknowledge events after a frame has read their times. */
static void latch_times_read(controller *c, uint32_t first, uint32_t end) {
    for (int value = 0; value < 2 * LATCH_INPUTS; value++) {
        uint32_t at = latch_time_register(value / 2, value % 2);
        if (first <= at && at < end && !latch_by_pdi(c, value / 2))
            c->memory[REG_LATCH_STATUS + value / 2] &= (uint8_t)~(1 << value % 2);
    }
    latch_events_show(c);
}

#endif
