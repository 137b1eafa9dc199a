/* Making and ending a segment: the only place that allocates. */
#ifndef CATENARY_VIRTUAL_SEGMENT_MEMORY_H
#define CATENARY_VIRTUAL_SEGMENT_MEMORY_H

#include "line.h"

/* DL status, 0x0110: a line; port 0 towards the MainDevice, port 1 to the next device. */
static void show_links(cat_segment *s) {
    for (int n = 0; n < s->count; n++) {
        controller *c = &s->controllers[n];
        int up = n > 0 || s->connected, down = n + 1 < s->reachable;
        c->linked = n < s->reachable;
        uint8_t *status = c->memory + REG_DL_STATUS;
        uint8_t links = (uint8_t)((up ? 0x10 : 0) | (down ? 0x20 : 0));
        uint8_t loops = (uint8_t)((up ? 0x02 : 0x01) | (down ? 0x08 : 0x04) | 0x50);
        if (((status[0] ^ links) & 0x30) || status[1] != loops)
            store16(c->memory + REG_ECAT_EVENT, load16(c->memory + REG_ECAT_EVENT) | ECAT_EVENT_DL_STATUS);
        status[0] = (uint8_t)((status[0] & 0x03) | 0x01 | links);
        status[1] = loops;
    }
}

static int controller_make(controller *c, uint32_t ram, uint32_t sii_words, int slots, int axes) {
    c->memory_size = REG_END + ram;
    c->memory = calloc(1, c->memory_size);
    c->sii.image = calloc(sii_words + 1, 2);
    c->slots = calloc((size_t)slots + 1, sizeof *c->slots);
    c->axes = calloc((size_t)axes + 1, sizeof *c->axes);
    c->sii.words = sii_words;
    c->slot_count = slots;
    c->axis_count = axes;
    return c->memory && c->sii.image && c->slots && c->axes;
}

/* Everything as after power-on. */
static void controller_power_on(controller *c, int fmmus, int sms, int clock_bits, int no_lrw) {
    uint8_t *m = c->memory;
    c->no_lrw = (uint8_t)no_lrw;
    c->fmmu_count = fmmus;
    c->sm_count = sms;
    m[REG_TYPE] = 0x11;
    m[REG_BUILD] = 0x02;
    m[REG_FMMU_COUNT] = (uint8_t)fmmus;
    m[REG_SM_COUNT] = (uint8_t)sms;
    m[REG_RAM_SIZE] = (uint8_t)((c->memory_size - REG_END) / 1024);
    m[REG_PORTS] = 0x0F;                      /* ports 0 and 1 MII, 2 and 3 not there */
    store16(m + REG_FEATURES, (uint16_t)((clock_bits ? FEATURE_DC : 0)
                                         | (clock_bits == 64 ? FEATURE_DC_64 : 0)
                                         | (no_lrw ? FEATURE_NO_LRW : 0)));
    m[REG_DL_CONTROL] = 0x01;
    m[REG_DL_CONTROL + 2] = 0x07;
    store16(m + REG_AL_CONTROL, AL_INIT);
    store16(m + REG_AL_STATUS, AL_INIT);
    store16(m + REG_WATCHDOG_DIVIDER, 2498);
    store16(m + REG_WATCHDOG_PDI, 1000);
    store16(m + REG_WATCHDOG_PROCESS_DATA, 1000);
    m[REG_SII_CONTROL] = SII_ADDRESS_2;
    dc_power_on(c, clock_bits);
    sync_stop(c);
    c->due = NEVER;
    c->outputs.sm = c->inputs.sm = -1;
    c->step_period = c->step_due = c->watchdog_due = c->pdi_watchdog_due = c->sii.due = NEVER;
    c->sii.read_time = 200000;
    c->sii.write_time = 3000000;
    c->clock.hop = 2 * FORWARDING_NS;
    c->logical_first = UINT64_MAX;
    for (int n = 0; n < sms; n++)
        sm_configured(c, n);
}

static void segment_free(cat_segment *s) {
    if (s == NULL)
        return;
    for (int n = 0; s->controllers && n < s->count; n++) {
        controller *c = &s->controllers[n];
        free(c->memory);
        free(c->sii.image);
        free(c->slots);
        free(c->axes);
    }
    free(s->controllers);
    free(s->stations);
    free(s->queue);
    pthread_mutex_destroy(&s->mutex);
    free(s);
}

static cat_segment *segment_make(int count, int is_virtual) {
    cat_segment *s = calloc(1, sizeof *s);
    if (s == NULL)
        return NULL;
    pthread_mutexattr_t attributes;
    pthread_mutexattr_init(&attributes);
    pthread_mutexattr_setprotocol(&attributes, PTHREAD_PRIO_INHERIT);
    pthread_mutex_init(&s->mutex, &attributes);
    pthread_mutexattr_destroy(&attributes);
    s->controllers = calloc((size_t)count + 1, sizeof *s->controllers);
    s->stations = calloc((size_t)count + 1, sizeof *s->stations);
    s->queue = calloc(QUEUE_SIZE, sizeof *s->queue);
    if (!s->controllers || !s->stations || !s->queue) {
        segment_free(s);
        return NULL;
    }
    s->count = s->reachable = count;
    s->is_virtual = is_virtual;
    s->now = s->power_on = is_virtual ? 0 : monotonic_now();
    s->next_due = s->service_due = s->sii_due = NEVER;
    s->event_fd = -1;
    s->connected = 1;
    make_write_mask(s->write_mask);
    for (int n = 0; n < count; n++) {
        s->controllers[n].segment = s;
        s->controllers[n].position = n;
    }
    return s;
}

static void segment_connect(cat_segment *s, int connected, int reachable) {
    s->connected = connected;
    s->reachable = reachable < 0 ? 0 : reachable > s->count ? s->count : reachable;
    show_links(s);
}

static int64_t register_number(const controller *c, uint32_t address, int size) {
    int64_t value = 0;
    for (int k = 0; k < size && address + (uint32_t)k < c->memory_size; k++)
        value |= (int64_t)c->memory[address + (uint32_t)k] << (8 * k);
    return value;
}

#endif
