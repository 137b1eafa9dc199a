/* Creation and destruction of a segment. Only these functions and `CompiledPlant` allocate memory. */
#ifndef CATENARY_VIRTUAL_SEGMENT_MEMORY_H
#define CATENARY_VIRTUAL_SEGMENT_MEMORY_H

#include "line.h"

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

/* Clear all that is lost without power. Properties of the device, its EEPROM, crystal and shafts, and
 * the loads and STO inputs of its axes remain. */
static void controller_forget(controller *c) {
    memset(c->memory, 0, c->memory_size);
    memset(c->slots, 0, (size_t)c->slot_count * sizeof *c->slots);
    memset(c->sm, 0, sizeof c->sm);
    memset(c->fmmus, 0, sizeof c->fmmus);
    c->fmmu_active = c->sm_top = 0;
    c->logical_first = UINT64_MAX;
    c->logical_end = 0;
    c->events = 0;
    c->al_unread = c->outputs_valid = c->outputs_seen = c->outputs_taken = c->inputs_stale = 0;
    c->outputs_ns = NEVER;
    c->watchdog_armed = c->watchdog_expired = 0;
    c->is_protected = c->reset_step = 0;
    c->sii.pending = 0;
    c->sii.loaded = 0;
    c->outputs.count = c->inputs.count = 0;
    c->outputs.sm = c->inputs.sm = -1;
    c->step_period = c->step_due = c->watchdog_due = c->pdi_watchdog_due = c->sii.due = NEVER;
    c->emergency = 0;
    synchronous_end(c);
    memset(&c->synchronous, 0, sizeof c->synchronous);
    sync_stop(c);
    c->sync.active = 0;
    c->segment->dues[c->position] = NEVER;
    for (int k = 0; k < c->axis_count; k++) {
        servo_axis *a = &c->axes[k], before = *a;
        memset(a, 0, sizeof *a);
        a->position = before.position;
        a->load = before.load;
        a->joint = before.joint;
        a->sto = before.sto;
    }
    ports_reset(c);
}

static void controller_power_off(controller *c) {
    c->powered = 0;
    controller_forget(c);
}

/* Set the state after power-on. */
static void controller_power_on(controller *c) {
    uint8_t *m = c->memory;
    int fmmus = c->fmmu_count, sms = c->sm_count, clock_bits = c->has_dc, no_lrw = c->no_lrw;
    controller_forget(c);
    m[REG_TYPE] = 0x11;
    m[REG_BUILD] = 0x02;
    m[REG_FMMU_COUNT] = (uint8_t)fmmus;
    m[REG_SM_COUNT] = (uint8_t)sms;
    m[REG_RAM_SIZE] = (uint8_t)((c->memory_size - REG_END) / 1024);
    for (int p = 0; p < PORTS; p++)
        m[REG_PORTS] |= (uint8_t)(c->ports[p].exists ? 3 << (2 * p) : 0);       /* MII */
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
    for (int n = 0; n < sms; n++)
        sm_configured(c, n);
    sii_load(c);
    c->powered = 1;
    loops_set(c, 0);
}

static void controller_free(controller *c) {
    free(c->memory);
    free(c->sii.image);
    free(c->slots);
    free(c->axes);
}

/* Initialise an empty position, at which no work is due. */
static void controller_blank(controller *c) {
    c->sync.due = c->segment->dues[c->position] = NEVER;
    c->outputs.sm = c->inputs.sm = -1;
    c->step_period = c->step_due = c->watchdog_due = c->pdi_watchdog_due = c->sii.due = NEVER;
    c->sii.read_time = 200000;
    c->sii.write_time = 3000000;
    ports_reset(c);
}

/* Remove a device and disconnect its motors from the plant. Its position and its cables remain. */
static void controller_remove(controller *c) {
    controller empty = {.segment = c->segment, .position = c->position};
    memcpy(empty.ports, c->ports, sizeof empty.ports);
    plant_forget(c->segment->plant, c);
    controller_free(c);
    *c = empty;
    controller_blank(c);
}

/* Exchange two devices with their complete state. */
static void controllers_exchange(controller *a, controller *b) {
    controller was = *a;
    *a = *b;
    *b = was;
    int position = a->position;
    a->position = b->position;
    b->position = position;
    a->segment->dues[a->position] = b->segment->dues[b->position] = a->segment->now;   /* check both */
    due_at(a, a->segment->now);
    for (int p = 0; p < PORTS; p++) {
        int32_t hung = a->ports[p].cable;
        a->ports[p].cable = b->ports[p].cable;
        b->ports[p].cable = hung;
    }
}

static void segment_free(cat_segment *s) {
    if (s == NULL)
        return;
    for (int n = 0; s->controllers && n < s->count; n++)
        controller_free(&s->controllers[n]);
    for (int n = 0; n < 2; n++) {
        free(s->routes[n].stops);
        free(s->routes[n].arrivals);
        free(s->routes[n].times);
        free(s->ends[n].queue);
    }
    free(s->cables);
    free(s->dues);
    free(s->controllers);
    pthread_mutex_destroy(&s->mutex);
    free(s);
}

/* Create an interface of the MainDevice and its route. Return 0 if out of memory. */
static int end_make(cat_segment *s, int number) {
    segment_end *e = &s->ends[number];
    route *r = &s->routes[number];
    e->segment = s;
    e->number = number;
    e->up = number == 0;
    e->queue = calloc(QUEUE_SIZE, sizeof *e->queue);
    r->stops = calloc(route_room(s), sizeof *r->stops);
    r->arrivals = calloc(4 * (size_t)route_room(s), sizeof *r->arrivals);
    r->times = calloc((size_t)s->count * PORTS + 1, sizeof *r->times);
    for (uint32_t k = 0; k < QUEUE_SIZE; k++)
        e->order[k] = (uint16_t)k;
    return e->queue && r->stops && r->arrivals && r->times;
}

static cat_segment *segment_make(int count, int is_virtual, int ring, int64_t detection) {
    cat_segment *s = calloc(1, sizeof *s);
    if (s == NULL)
        return NULL;
    pthread_mutexattr_t attributes;
    pthread_mutexattr_init(&attributes);
    pthread_mutexattr_setprotocol(&attributes, PTHREAD_PRIO_INHERIT);
    pthread_mutex_init(&s->mutex, &attributes);
    pthread_mutexattr_destroy(&attributes);
    s->count = count;
    s->ring = ring;
    s->cable_count = count + ring;
    s->controllers = calloc((size_t)count + 1, sizeof *s->controllers);
    s->cables = calloc((size_t)s->cable_count + 1, sizeof *s->cables);
    s->dues = calloc((size_t)count + 1, sizeof *s->dues);
    if (!s->controllers || !s->dues || !s->cables || !end_make(s, 0) || (ring && !end_make(s, 1))) {
        segment_free(s);
        return NULL;
    }
    s->is_virtual = is_virtual;
    s->now = is_virtual ? 0 : monotonic_now();
    s->epoch = is_virtual ? 0 : -1;
    s->next_due = s->service_due = s->sii_due = s->link_due = NEVER;
    s->detection = detection;
    s->routes_stale = 1;
    s->event_fd = -1;
    make_write_mask(s->write_mask);
    for (int n = 0; n < count; n++) {
        controller *c = &s->controllers[n];
        c->segment = s;
        c->position = n;
        for (int p = 0; p < PORTS; p++)
            c->ports[p].cable = -1;
        controller_blank(c);
    }
    return s;
}

static void cable_lay(cat_segment *s, int n, cable_end up, cable_end down) {
    s->cables[n] = (cable){.up = up, .down = down, .delay = CABLE_NS, .plugged = 1};
    if (up.device >= 0)
        s->controllers[up.device].ports[up.port].cable = n;
    if (down.device >= 0)
        s->controllers[down.device].ports[down.port].cable = n;
}

static int64_t register_number(const controller *c, uint32_t address, int size) {
    int64_t value = 0;
    for (int k = 0; k < size && address + (uint32_t)k < c->memory_size; k++)
        value |= (int64_t)c->memory[address + (uint32_t)k] << (8 * k);
    return value;
}

#endif
