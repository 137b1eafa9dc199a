/* Watchdogs, ETG.1000.4 §6.3: divider 0x0400, PDI 0x0410, process data 0x0420.
 * The first trigger arms a watchdog. A time of 0 disables it. */
#ifndef CATENARY_VIRTUAL_WATCHDOG_H
#define CATENARY_VIRTUAL_WATCHDOG_H

#include "controller/controller.h"

static inline int64_t watchdog_time(const controller *c, uint32_t reg) {
    return (int64_t)(load16(c->memory + REG_WATCHDOG_DIVIDER) + 2) * 40 * load16(c->memory + reg);
}

/* Handle a complete write to a SyncManager that triggers the watchdog. */
static inline void watchdog_trigger(controller *c) {
    int64_t time = watchdog_time(c, REG_WATCHDOG_PROCESS_DATA);
    c->memory[REG_WATCHDOG_STATUS] |= 1;
    c->watchdog_armed = time > 0;
    c->watchdog_expired = 0;
    c->watchdog_due = time > 0 ? c->segment->now + time : NEVER;
    due_at(c, c->watchdog_due);
    if (c->emulation)
        c->outputs_valid = (c->memory[REG_AL_STATUS] & AL_STATE) == CAT_AL_OP;
}

/* Handle a complete write to a SyncManager that does not trigger the watchdog. A terminal without a
 * microcontroller drives its outputs if the watchdog is disabled or has not expired (0x0440.0). */
static inline void watchdog_bypass(controller *c) {
    if (c->emulation && watchdog_time(c, REG_WATCHDOG_PROCESS_DATA) == 0)
        c->outputs_valid = (c->memory[REG_AL_STATUS] & AL_STATE) == 8;
}

static inline void watchdog_trigger_pdi(controller *c) {
    int64_t time = watchdog_time(c, REG_WATCHDOG_PDI);
    c->memory[REG_DL_STATUS] |= 0x02;
    c->pdi_watchdog_due = time > 0 ? c->segment->now + time : NEVER;
}

/* Apply a new time or divider. */
static inline void watchdog_reconfigured(controller *c) {
    int64_t time = watchdog_time(c, REG_WATCHDOG_PROCESS_DATA);
    if (time == 0) {
        c->memory[REG_WATCHDOG_STATUS] |= 1;
        c->watchdog_armed = c->watchdog_expired = 0;
        c->watchdog_due = NEVER;
    } else if (c->watchdog_armed) {
        c->watchdog_due = c->segment->now + time;
        due_at(c, c->watchdog_due);
    }
}

static inline void count_up(uint8_t *counter) {
    if (*counter < 255)
        (*counter)++;
}

static inline void watchdog_check(controller *c) {
    if (c->watchdog_armed && c->watchdog_due <= c->segment->now) {
        c->watchdog_armed = 0;
        c->watchdog_expired = 1;
        c->watchdog_due = NEVER;
        c->memory[REG_WATCHDOG_STATUS] &= (uint8_t)~1u;
        count_up(c->memory + REG_WATCHDOG_COUNTER_PROCESS_DATA);
        c->outputs_valid = 0;
        if (!c->emulation)
            raise_event(c, EVENT_WATCHDOG);
    }
    if (c->pdi_watchdog_due <= c->segment->now) {
        c->pdi_watchdog_due = NEVER;
        c->memory[REG_DL_STATUS] &= (uint8_t)~0x02u;
        count_up(c->memory + REG_WATCHDOG_COUNTER_PDI);
    }
}

#endif
