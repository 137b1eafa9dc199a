/* SyncManagers, ETG.1000.4 §6.8: mailbox mode (one buffer with handshake) and three-buffer mode.
 *
 * Access to the first byte opens a buffer, and access to the last byte closes it. Access to other
 * bytes is refused while the buffer is not open. The three buffers are consecutive in memory. Both
 * sides always address the first one, and the controller redirects the access. */
#ifndef CATENARY_VIRTUAL_SYNC_MANAGER_H
#define CATENARY_VIRTUAL_SYNC_MANAGER_H

#include "controller/controller.h"
#include "watchdog.h"

static inline uint8_t *sm_registers(controller *c, int n) {
    return c->memory + REG_SM + n * SM_SIZE;
}

/* Return 1 for a SyncManager on the digital output data of the controller, as in Beckhoff's digital
 * terminals (ESC data sheet, 0x0F00 to 0x0F03). These registers are a single buffer. */
static inline int sm_is_digital_output(const sync_manager *sm) {
    return !sm->mailbox && sm->ecat_writes && sm->start >= REG_DIGITAL_OUTPUT
        && (uint32_t)sm->start + sm->length <= REG_DIGITAL_OUTPUT_END;
}

static inline int sm_has_one_buffer(const sync_manager *sm) {
    return sm->mailbox || sm_is_digital_output(sm);
}

static inline uint32_t sm_span(const sync_manager *sm) {
    return sm_has_one_buffer(sm) ? sm->length : 3u * sm->length;
}

static inline void sm_show_status(controller *c, int n) {
    sync_manager *sm = &c->sm[n];
    uint8_t *status = sm_registers(c, n) + 5;
    uint8_t value = *status & (SM_STATUS_WRITTEN | SM_STATUS_READ);
    if (sm->mailbox)
        value |= sm->full ? SM_STATUS_FULL : 0;
    else
        value |= (uint8_t)((sm->written ? sm->latest : 3) << 4);
    *status = value;
    uint16_t event = (uint16_t)(ECAT_EVENT_SM0 << n);
    uint16_t events = load16(c->memory + REG_ECAT_EVENT);
    int raised = sm->ecat_writes ? (value & SM_STATUS_READ) : (value & SM_STATUS_WRITTEN);
    store16(c->memory + REG_ECAT_EVENT, raised ? events | event : events & (uint16_t)~event);
}

/* Apply a change of the registers of SyncManager n, by either side. Empty its buffers if it was
 * enabled, disabled, blocked or released. */
static void sm_configured(controller *c, int n) {
    sync_manager *sm = &c->sm[n];
    const uint8_t *r = sm_registers(c, n);
    int was_enabled = sm->enabled, was_blocked = sm->blocked;
    sm->start = load16(r);
    sm->length = load16(r + 2);
    sm->mailbox = (r[4] & SM_CONTROL_MODE) == SM_CONTROL_MAILBOX;
    sm->ecat_writes = (r[4] & SM_CONTROL_ECAT_WRITES) != 0;
    sm->watchdog = (r[4] & SM_CONTROL_WATCHDOG) != 0;
    sm->enabled = (r[6] & SM_ACTIVATE_ENABLE) && sm->length > 0
        && (uint32_t)sm->start + sm_span(sm) <= c->memory_size
        && (sm->start >= REG_END || sm_is_digital_output(sm));
    sm->blocked = (r[7] & SM_PDI_DEACTIVATE) != 0;
    if (sm->enabled != was_enabled || sm->blocked != was_blocked) {
        sm->full = sm->open = sm->written = 0;
        sm->latest = 0;
        sm->using = 1;
        sm->writes = 0;
        sm_registers(c, n)[5] = 0;
    }
    sm_show_status(c, n);
    c->sm_top = 0;
    for (int k = 0; k < c->sm_count; k++)
        if (c->sm[k].enabled)
            c->sm_top = k + 1;
}

static inline uint8_t *sm_buffer(controller *c, const sync_manager *sm, uint8_t which) {
    return c->memory + sm->start + (sm_has_one_buffer(sm) ? 0u : (uint32_t)which * sm->length);
}

/* Return the number of a buffer that is neither `a` nor `b`: the last complete one, and one in
 * use. */
static inline uint8_t sm_free_buffer(uint8_t a, uint8_t b) {
    uint8_t k = 0;
    while (k == a || k == b)
        k++;
    return k;
}

static inline void sm_write_completed(controller *c, int n) {
    sync_manager *sm = &c->sm[n];
    uint8_t *status = sm_registers(c, n) + 5;
    sm->open = 0;
    sm->written = 1;
    sm->writes++;
    *status = (uint8_t)((*status | SM_STATUS_WRITTEN) & ~SM_STATUS_READ);
    if (sm->mailbox) {
        sm->full = 1;
        if (n == 0)
            raise_event(c, EVENT_MAILBOX_WRITTEN);
    } else {
        const cat_segment *s = c->segment;
        sm->latest = sm->using;
        sm->completed = s->frame_end > s->now ? s->frame_end + c->passage - s->passage : s->now;
        if (c->emulation && !c->sync.active)
            c->outputs_ns = sm->completed;
        if (!c->outputs_seen) {
            c->outputs_seen = 1;
            if (!c->emulation)
                raise_event(c, EVENT_OUTPUTS);
        }
    }
    if (sm->watchdog)
        watchdog_trigger(c);
    else if (!sm->mailbox)
        watchdog_bypass(c);
    sm_show_status(c, n);
}

/* Write `size` bytes at `offset` of the buffer from the EtherCAT side. Return 1 if done, 0 if refused. */
static inline int sm_ecat_write(controller *c, int n, uint32_t offset, uint32_t size, const uint8_t *data) {
    sync_manager *sm = &c->sm[n];
    if (sm->blocked || !sm->ecat_writes || offset + size > sm->length || (sm->mailbox && sm->full))
        return 0;
    if (offset == 0) {
        sm->open = 1;
        sm->using = sm_free_buffer(sm->latest, sm->latest);
    }
    if (!sm->open)
        return 0;
    memcpy(sm_buffer(c, sm, sm->using) + offset, data, size);
    if (offset + size == sm->length)
        sm_write_completed(c, n);
    return 1;
}

static inline int sm_ecat_read(controller *c, int n, uint32_t offset, uint32_t size, uint8_t *data) {
    sync_manager *sm = &c->sm[n];
    if (sm->blocked || sm->ecat_writes || offset + size > sm->length || (sm->mailbox && !sm->full))
        return 0;
    if (offset == 0) {
        sm->open = 1;
        sm->using = sm->latest;
    }
    if (!sm->open)
        return 0;
    memcpy(data, sm_buffer(c, sm, sm->using) + offset, size);
    if (offset + size < sm->length)
        return 1;
    uint8_t *status = sm_registers(c, n) + 5;
    sm->open = 0;
    *status = (uint8_t)((*status | SM_STATUS_READ) & ~SM_STATUS_WRITTEN);
    if (sm->mailbox) {
        sm->full = 0;
        if (n == 1)
            raise_event(c, EVENT_MAILBOX_READ);
    }
    sm_show_status(c, n);
    return 1;
}

/* Copy the last complete buffer from the PDI side and mark it as read. This empties a mailbox. Return
 * the number of bytes, or -1 if there is no data or `room` is too small. */
static inline int sm_pdi_read(controller *c, int n, uint8_t *data, uint32_t room) {
    sync_manager *sm = &c->sm[n];
    if (!sm->enabled || !sm->ecat_writes || sm->length > room || (sm->mailbox && !sm->full) || !sm->written)
        return -1;
    memcpy(data, sm_buffer(c, sm, sm->latest), sm->length);
    uint8_t *status = sm_registers(c, n) + 5;
    *status = (uint8_t)((*status | SM_STATUS_READ) & ~SM_STATUS_WRITTEN);
    if (sm->mailbox) {
        sm->full = 0;
        sm->written = 0;
    }
    sm_show_status(c, n);
    return sm->length;
}

/* Return the buffer that the application may write now, or NULL. *which receives its number.
 * `sm_pdi_written` publishes it. */
static inline uint8_t *sm_pdi_buffer(controller *c, int n, uint8_t *which) {
    sync_manager *sm = &c->sm[n];
    if (!sm->enabled || sm->blocked || sm->ecat_writes || (sm->mailbox && sm->full))
        return NULL;
    *which = sm_free_buffer(sm->latest, sm->open ? sm->using : sm->latest);
    return sm_buffer(c, sm, *which);
}

static inline void sm_pdi_written(controller *c, int n, uint8_t which) {
    sync_manager *sm = &c->sm[n];
    uint8_t *status = sm_registers(c, n) + 5;
    sm->latest = which;
    sm->written = 1;
    sm->writes++;
    sm->full = sm->mailbox;
    *status = (uint8_t)((*status | SM_STATUS_WRITTEN) & ~SM_STATUS_READ);
    sm_show_status(c, n);
}

static inline int sm_pdi_write(controller *c, int n, const uint8_t *data, uint32_t size) {
    uint8_t which;
    uint8_t *buffer = size <= c->sm[n].length ? sm_pdi_buffer(c, n, &which) : NULL;
    if (buffer == NULL)
        return -1;
    memcpy(buffer, data, size);
    memset(buffer + size, 0, c->sm[n].length - size);
    sm_pdi_written(c, n, which);
    return (int)size;
}

/* Return the SyncManager that covers `address`, or -1. *run receives the number of bytes for which
 * the result is valid. */
static inline int sm_at(const controller *c, uint32_t address, uint32_t *run) {
    uint32_t nearest = c->memory_size;
    for (int n = 0; n < c->sm_top; n++) {
        const sync_manager *sm = &c->sm[n];
        if (!sm->enabled)
            continue;
        uint32_t end = sm->start + sm_span(sm);
        if (address >= sm->start && address < end) {
            *run = end - address;
            return n;
        }
        if (sm->start > address && sm->start < nearest)
            nearest = sm->start;
    }
    *run = nearest - address;
    return -1;
}

/* Access process RAM from the EtherCAT side. The caller has checked the range. Return 1 if any byte
 * was accessed. */
static int ram_access(controller *c, uint32_t address, uint32_t size, uint8_t *data, int write) {
    int done = 0;
    while (size > 0) {
        uint32_t run = 0;
        int n = sm_at(c, address, &run);
        run = min32(run, size);
        if (n < 0) {
            if (write)
                memcpy(c->memory + address, data, run);
            else
                memcpy(data, c->memory + address, run);
            done = 1;
        } else {
            uint32_t offset = address - c->sm[n].start;
            uint32_t length = c->sm[n].length;
            if (offset < length) {       /* buffers two and three are not accessible */
                run = min32(run, length - offset);
                done |= write ? sm_ecat_write(c, n, offset, run, data) : sm_ecat_read(c, n, offset, run, data);
            }
        }
        address += run;
        data += run;
        size -= run;
    }
    return done;
}

/* Return a byte of process RAM for a bit-wise write, without side effects. In a SyncManager, it is a
 * byte of the last complete buffer. */
static inline uint8_t ram_peek(controller *c, uint32_t address) {
    uint32_t run;
    int n = sm_at(c, address, &run);
    if (n < 0)
        return c->memory[address];
    sync_manager *sm = &c->sm[n];
    uint32_t offset = address - sm->start;
    return offset < sm->length ? sm_buffer(c, sm, sm->latest)[offset] : 0;
}

#endif
