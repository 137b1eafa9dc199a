/* Write protection, and the reset by three frames (Beckhoff, EtherCAT Slave Controller, section I
 * §17.3 and §17.4). 0x0021 protects the registers, and 0x0031 protects all memory. Writing the
 * adjacent enable register permits writes by the rest of the same frame. Writing 0x52, 0x45 and 0x53
 * to 0x0040 resets the device. */
#ifndef CATENARY_VIRTUAL_WRITE_PROTECTION_H
#define CATENARY_VIRTUAL_WRITE_PROTECTION_H

#include "controller/controller.h"

static inline int enabled_in_this_frame(const controller *c, uint64_t enabled) {
    return enabled == c->segment->counters.frames;
}

/* Return 1 if write protection permits a write of this byte. The enable registers are always
 * writable. */
static inline int byte_unprotected(const controller *c, uint32_t address) {
    if (!c->is_protected || address == REG_WRITE_ENABLE || address == REG_ESC_WRITE_ENABLE)
        return 1;
    if ((c->memory[REG_ESC_WRITE_PROTECTION] & 1) && !enabled_in_this_frame(c, c->esc_enabled))
        return 0;
    return address >= REG_USER_RAM || !(c->memory[REG_WRITE_PROTECTION] & 1)
        || enabled_in_this_frame(c, c->registers_enabled);
}

/* Return 1 if write protection permits writes to process RAM. */
static inline int ram_unprotected(const controller *c) {
    return !c->is_protected || byte_unprotected(c, REG_USER_RAM);
}

static void protection_written(controller *c) {
    uint8_t *m = c->memory;
    if (m[REG_WRITE_ENABLE] & 1)
        c->registers_enabled = c->segment->counters.frames;
    if (m[REG_ESC_WRITE_ENABLE] & 1)
        c->esc_enabled = c->segment->counters.frames;
    m[REG_WRITE_ENABLE] = m[REG_ESC_WRITE_ENABLE] = 0;
    c->is_protected = (m[REG_WRITE_PROTECTION] | m[REG_ESC_WRITE_PROTECTION]) & 1;
}

/* Advance the reset sequence, and show its progress in the register. The last value of the sequence
 * raises EVENT_RESET. */
static void reset_written(controller *c) {
    static const uint8_t sequence[3] = {0x52, 0x45, 0x53};
    uint8_t value = c->memory[REG_RESET];
    c->reset_step = value == sequence[c->reset_step] ? c->reset_step + 1 : value == sequence[0];
    if (c->reset_step == 3) {
        c->reset_step = 0;
        raise_event(c, EVENT_RESET);
    }
    c->memory[REG_RESET] = c->reset_step;
}

#endif
