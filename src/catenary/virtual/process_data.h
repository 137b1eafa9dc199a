/* Process data of a device: copies between its SyncManager buffers and its slots. A slot is a 64-bit
 * number for an object of the model. The application creates the mapping tables on entry to SAFE-OP and
 * checks them against the buffers. Devices without an application create them at power-on. The
 * functions here check every range again. */
#ifndef CATENARY_VIRTUAL_PROCESS_DATA_H
#define CATENARY_VIRTUAL_PROCESS_DATA_H

#include "controller/controller.h"
#include "servo.h"
#include "controller/sync_manager.h"

#define PROCESS_DATA_MAX 2048u

static inline uint64_t bits_load(const uint8_t *p, uint32_t bit, uint32_t count) {
    uint64_t value = 0;
    if ((bit & 7) == 0 && (count & 7) == 0) {
        p += bit / 8;
        switch (count) {                                     /* nearly all objects have these sizes */
        case 8: return p[0];
        case 16: return load16(p);
        case 32: return load32(p);
        }
        for (uint32_t k = 0; k < count / 8; k++)
            value |= (uint64_t)p[k] << (8 * k);
        return value;
    }
    for (uint32_t k = 0; k < count; k++)
        value |= (uint64_t)(p[(bit + k) >> 3] >> ((bit + k) & 7) & 1) << k;
    return value;
}

static inline void bits_store(uint8_t *p, uint32_t bit, uint32_t count, uint64_t value) {
    if ((bit & 7) == 0 && (count & 7) == 0) {
        p += bit / 8;
        switch (count) {
        case 8: p[0] = (uint8_t)value; return;
        case 16: store16(p, (uint16_t)value); return;
        case 32: store32(p, (uint32_t)value); return;
        }
        for (uint32_t k = 0; k < count / 8; k++)
            p[k] = (uint8_t)(value >> (8 * k));
        return;
    }
    for (uint32_t k = 0; k < count; k++) {
        uint8_t mask = (uint8_t)(1u << ((bit + k) & 7));
        uint8_t *byte = p + ((bit + k) >> 3);
        *byte = (uint8_t)(value >> k & 1 ? *byte | mask : *byte & ~mask);
    }
}

static inline int64_t extend(uint64_t value, uint32_t bits, int is_signed) {
    if (!is_signed || bits >= 64)
        return (int64_t)value;
    uint64_t top = 1ull << (bits - 1);
    return (int64_t)((value ^ top) - top);
}

static void outputs_take(controller *c) {
    const mapping *m = &c->outputs;
    if (m->sm < 0 || m->sm >= c->sm_count)
        return;
    const sync_manager *sm = &c->sm[m->sm];
    if (!sm->enabled || sm->blocked || !sm->written || sm->mailbox)
        return;
    const uint8_t *buffer = sm_buffer(c, sm, sm->latest);
    for (int k = 0; k < m->count; k++) {
        const mapped *e = &m->entries[k];
        if (e->bit + e->bits <= 8u * sm->length && e->slot < c->slot_count)
            c->slots[e->slot] = extend(bits_load(buffer, e->bit, e->bits), e->bits, e->is_signed);
    }
}

static void inputs_put(controller *c) {
    const mapping *m = &c->inputs;
    if (m->sm < 0 || m->sm >= c->sm_count)
        return;
    const sync_manager *sm = &c->sm[m->sm];
    uint8_t which;
    if (sm->mailbox || sm->length > PROCESS_DATA_MAX)
        return;
    uint8_t *buffer = sm_pdi_buffer(c, m->sm, &which);
    if (buffer == NULL)
        return;
    slots_refresh(c);
    memset(buffer, 0, sm->length);
    for (int k = 0; k < m->count; k++) {
        const mapped *e = &m->entries[k];
        if (e->bit + e->bits <= 8u * sm->length && e->slot < c->slot_count)
            bits_store(buffer, e->bit, e->bits, (uint64_t)c->slots[e->slot]);
    }
    sm_pdi_written(c, m->sm, which);
}

/* Write the new inputs of the models into the buffers for the next frame. Even if a model takes
 * several steps between two frames, its inputs are written only once. */
static inline void inputs_flush(cat_segment *s) {
    if (!s->inputs_stale)
        return;
    s->inputs_stale = 0;
    for (int n = 0; n < s->count; n++)
        if (s->controllers[n].inputs_stale) {
            s->controllers[n].inputs_stale = 0;
            inputs_put(&s->controllers[n]);
        }
}

#endif
