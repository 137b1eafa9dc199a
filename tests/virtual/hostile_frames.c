/* Random frames into a segment of all kinds of controllers, in virtual time, without Python: for
 * test_hostile_frames.py and tools/sanitize. A finding is what a sanitizer reports, a clock that does
 * not move on, or a frame that does not come back in time (the caller's deadline).
 *
 *     hostile_frames FRAMES SEED */
#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include <stdio.h>

#include "segment_memory.h"

enum { DEVICES = 5, STATION = 0x1001, RAM = 0x2000, SII_WORDS = 64 };

static uint64_t state;
static int calm;                     /* frames as of a MainDevice in operation, more or less */

static uint64_t any(void) {
    state ^= state >> 12;
    state ^= state << 25;
    state ^= state >> 27;
    return state * 0x2545F4914F6CDD1Dull;
}

static uint32_t below(uint32_t bound) { return (uint32_t)(any() >> 32) % bound; }
static int one_in(uint32_t count) { return below(count) == 0; }

/* -- the segment ---------------------------------------------------------------------------------- */

typedef struct { int clock_bits, emulation, axes; } kind;

static const kind KINDS[DEVICES] = {{64, 1, 0}, {64, 0, 1}, {32, 0, 1}, {0, 0, 0}, {32, 1, 0}};

/* Words 0 to 7 of an SII, with a checksum that fits. */
static void fill_sii(uint8_t *image, int emulation) {
    for (int k = 0; k < 2 * SII_WORDS; k++)
        image[k] = (uint8_t)any();
    image[1] = (uint8_t)emulation;
    image[SII_WORD_CHECKSUM * 2] = sii_checksum(image);
    image[SII_WORD_CHECKSUM * 2 + 1] = 0;
}

static void map_axis(controller *c) {
    static const mapped outputs[] = {{0, SLOT_CONTROLWORD, 16, 0}, {16, SLOT_MODE, 8, 1},
                                     {24, SLOT_TARGET_POSITION, 32, 1}, {56, SLOT_TARGET_TORQUE, 16, 1}};
    static const mapped inputs[] = {{0, SLOT_STATUSWORD, 16, 0}, {16, SLOT_POSITION, 32, 1}};
    c->outputs.sm = 2;
    c->inputs.sm = 3;
    c->outputs.count = sizeof outputs / sizeof *outputs;
    c->inputs.count = sizeof inputs / sizeof *inputs;
    memcpy(c->outputs.entries, outputs, sizeof outputs);
    memcpy(c->inputs.entries, inputs, sizeof inputs);
    servo_axis *a = c->axes;
    a->inertia = 5e-4;
    a->rated_torque = 2;
    a->velocity_limit = 350;
    a->counts_per_radian = a->velocity_per_radian = 166886;
    a->radian_per_count = a->radian_per_velocity = 1.0 / 166886;
    a->per_inertia = 1 / a->inertia;
    a->per_torque = 1 / a->rated_torque;
    a->position_gain = a->velocity_gain = a->integral_gain = 0.1;
    c->slots[SLOT_MAX_TORQUE] = 3000;
    c->slots[SLOT_FOLLOWING_WINDOW] = 1000;
    c->slots[SLOT_INTERPOLATION_PERIOD] = 1;
    c->slots[SLOT_INTERPOLATION_EXPONENT] = -3;
    model_period(c, 250000);
}

static void make_device(cat_segment *s, int n) {
    controller *c = &s->controllers[n];
    const kind *k = &KINDS[n];
    controller_make(c, RAM, SII_WORDS, k->axes ? AXIS_SLOTS : 4, k->axes);
    c->ports[0].exists = c->ports[1].exists = 1;
    c->fmmu_count = c->sm_count = 8;
    c->has_dc = (uint8_t)k->clock_bits;
    c->clock.crystal.error = 1e-4 * (n - 2);
    c->clock.crystal.scatter = 20 * n;
    fill_sii(c->sii.image, k->emulation);
    controller_power_on(c);
    c->synchronous.minimum = 62500;
    c->synchronous.copy_time = 20000;
    c->synchronous.limit = 3;
    store16(c->memory + REG_STATION, (uint16_t)(STATION + n));
    if (k->axes)
        map_axis(c);
}

/* What an application does, at random: it takes requests, and goes through states. */
static void application(controller *c) {
    static const uint16_t states[] = {AL_INIT, AL_PRE_OP, AL_SAFE_OP, AL_OP, AL_SAFE_OP | AL_ERROR};
    c->events = 0;
    c->al_unread = 0;
    if (one_in(4))
        al_show(c, states[below(5)], (uint16_t)below(0x40));
    if (calm || one_in(4))
        c->outputs_valid = !one_in(calm ? 16 : 2);
    if (one_in(8))
        c->outputs_seen = 0;
    if (!calm && one_in(4)) {
        int n = (int)below(4);
        sm_registers(c, n)[7] = (uint8_t)below(2);
        sm_configured(c, n);
    }
    if (!c->axis_count)
        return;
    if (one_in(calm ? 32 : 8)) {
        synchronous_end(c);
        model_period(c, 250000);
    } else if (calm ? !c->synchronous.active && c->sync.active : one_in(8)) {
        int64_t cycle = 62500 + (int64_t)below(10000000), steps = (cycle + 249999) / 250000;
        synchronous_begin(c, cycle, (int)steps, one_in(4) ? SYNC_PULSE_1 : SYNC_PULSE_0);
        model_period(c, cycle / steps);
    }
    uint8_t box[64] = {0};
    sm_pdi_read(c, 0, box, sizeof box);
    sm_pdi_write(c, 1, box, below(sizeof box));
}

static int serve(void *owner) {
    cat_segment *s = owner;
    lock(s);
    s->pending = 0;
    for (int n = 0; n < s->count; n++)
        if (s->controllers[n].events)
            application(&s->controllers[n]);
    s->service_due = NEVER;
    unlock(s);
    return 0;
}

static cat_segment *make_ring(void) {
    cat_segment *s = segment_make(DEVICES, 1, 1, 15000);
    s->service = serve;
    s->owner = s;
    for (int n = 0; n < DEVICES; n++)
        cable_lay(s, n, n ? (cable_end){n - 1, 1} : (cable_end){END_FIRST, 0}, (cable_end){n, 0});
    cable_lay(s, DEVICES, (cable_end){DEVICES - 1, 1}, (cable_end){END_SECOND, 0});
    for (int n = 0; n < DEVICES; n++)
        make_device(s, n);
    segment_light(s, 1);
    return s;
}

/* -- the frames ----------------------------------------------------------------------------------- */

static const uint16_t REGISTERS[] = {
    REG_STATION, REG_WRITE_ENABLE, REG_WRITE_PROTECTION, REG_ESC_WRITE_ENABLE, REG_ESC_WRITE_PROTECTION,
    REG_RESET, REG_DL_CONTROL, REG_AL_CONTROL, REG_ECAT_EVENT_MASK, REG_RX_ERRORS, REG_LOST_LINKS,
    REG_WATCHDOG_DIVIDER, REG_WATCHDOG_PDI, REG_WATCHDOG_PROCESS_DATA, REG_WATCHDOG_COUNTER_PROCESS_DATA,
    REG_SII_OWNER, REG_SII_CONTROL, REG_SII_ADDRESS, REG_SII_DATA, REG_FMMU, REG_FMMU + 16, REG_FMMU + 112,
    REG_SM, REG_SM + 8, REG_SM + 16, REG_SM + 24, REG_SM + 56, REG_DC_RECEIVE, REG_DC_SYSTEM_TIME,
    REG_DC_OFFSET, REG_DC_DELAY, REG_DC_DIFFERENCE, REG_DC_SPEED_START, REG_DC_FILTER_DIFFERENCE,
    REG_SYNC_CONTROL, REG_SYNC_ACTIVATION, REG_SYNC_PULSE_LENGTH, REG_SYNC_START, REG_SYNC_NEXT1,
    REG_SYNC0_CYCLE, REG_SYNC1_CYCLE, REG_LATCH_CONTROL, REG_USER_RAM, REG_END, REG_END + 0x100,
    REG_END + 0x200, REG_END + 0x200, REG_SYNC_ACTIVATION, REG_SYNC_ACTIVATION, REG_END + RAM - 8};

/* Numbers at the edges, in the direction of what is interesting somewhere. */
static uint64_t extreme(const cat_segment *s) {
    static const uint64_t edges[] = {0, 1, 2, 3, 0x7F, 0x80, 0xFF, 1000, 0x7FFF, 0x8000, 0xFFFF, 100000,
                                     0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 1ull << 62, 3ull << 61,
                                     INT64_MAX, 1ull << 63, UINT64_MAX, 0ull - (1ull << 62)};
    uint64_t edge = edges[below(sizeof edges / sizeof *edges)];
    switch (below(4)) {
    case 0: return edge;
    case 1: return edge + below(2000) - 1000;
    case 2: return (uint64_t)s->now + edge;
    default: return any();
    }
}

static uint32_t payload(const cat_segment *s, uint32_t ado, uint8_t *data, uint32_t size) {
    if (size == 0)
        return 0;
    for (uint32_t k = 0; k < size; k++)
        data[k] = one_in(3) ? (uint8_t)any() : 0;
    for (uint32_t k = 0; k + 8 <= size && !one_in(3); k += 8)
        store64(data + k, extreme(s));
    if (ado == REG_SM + 6 || ado == REG_DL_CONTROL)
        data[0] = (uint8_t)below(8);
    if (ado == REG_SYNC0_CYCLE && size >= 4)
        store32(data, one_in(2) ? below(2000000) : (uint32_t)extreme(s));
    return size;
}

/* 0x0981 to 0x09A7 in one piece: pulses that come soon, or at an edge. */
static uint32_t sync_unit_of(const cat_segment *s, uint8_t *data) {
    const controller *c = &s->controllers[below(DEVICES)];
    uint64_t soon = (uint64_t)dc_system_time(c, s->now) + below(3000000);
    data[0] = (uint8_t)below(8);
    store64(data + REG_SYNC_START - REG_SYNC_ACTIVATION, one_in(8) ? extreme(s) : soon);
    store32(data + REG_SYNC0_CYCLE - REG_SYNC_ACTIVATION, one_in(4) ? (uint32_t)extreme(s) : 62500 + below(2000000));
    store32(data + REG_SYNC1_CYCLE - REG_SYNC_ACTIVATION, one_in(2) ? 0 : below(4000000));
    return REG_LATCH_CONTROL - REG_SYNC_ACTIVATION;
}

/* The outputs of the servos: controlword, mode, position, torque. */
static uint32_t outputs_of_servo(uint8_t *data) {
    static const uint8_t words[] = {0x00, 0x02, 0x06, 0x07, 0x0F, 0x0F, 0x1F, 0x80}, modes[] = {HM, CSP, CSV, CST, 0};
    store16(data, words[below(sizeof words)]);
    data[2] = one_in(4) ? (uint8_t)any() : modes[below(sizeof modes)];
    store32(data + 3, (uint32_t)any());
    store16(data + 7, (uint16_t)any());
    return 9;
}

/* What fits the device, so that something happens beyond the registers, too. 0: nothing for `ado`. */
static uint32_t sensible(const cat_segment *s, uint32_t ado, uint8_t *data) {
    memset(data, 0, 40);
    if (ado == REG_SYNC_ACTIVATION)
        return sync_unit_of(s, data);
    if (ado == REG_END + 0x200)
        return outputs_of_servo(data);
    if (ado >= REG_SM && ado < REG_SM + 32) {
        static const uint8_t control[4] = {0x26, 0x22, 0x64, 0x20};
        uint32_t n = (ado - REG_SM) / 8;
        store16(data, (uint16_t)(REG_END + 0x100 * n));
        store16(data + 2, (uint16_t)(n < 2 ? 64 : 9));
        data[4] = control[n];
        data[6] = (uint8_t)below(2);
        return 8;
    }
    if (ado != REG_FMMU && ado != REG_FMMU + 16)
        return 0;
    store32(data, below(64));
    store16(data + 4, (uint16_t)(1 + below(64)));
    data[7] = (uint8_t)below(8);
    store16(data + 8, (uint16_t)(REG_END + 0x100 * below(5)));
    data[11] = (uint8_t)(1 + below(3));
    data[12] = 1;
    return 16;
}

static uint32_t any_address(void) {
    static const uint16_t operation[] = {
        REG_END + 0x200, REG_END + 0x200, REG_END + 0x200, REG_END + 0x200, REG_SM + 16, REG_SM + 24, REG_FMMU,
        REG_SYNC_ACTIVATION, REG_DC_SYSTEM_TIME, REG_AL_CONTROL, REG_DC_SPEED_START};
    if (calm && !one_in(64))
        return operation[below(sizeof operation / sizeof *operation)];
    return one_in(8) ? below(0x10000) : REGISTERS[below(sizeof REGISTERS / sizeof *REGISTERS)];
}

static uint32_t put_datagram(const cat_segment *s, uint8_t *at, uint32_t room, int more) {
    uint32_t ado = any_address();
    uint32_t size = one_in(16) ? below(1400) : 1 + below(16);
    if (one_in(16))
        ado -= below(8);
    if (size > room)
        size = room;
    uint8_t *data = at + DATAGRAM_HEADER;
    uint32_t fitting = room >= 40 && !one_in(4) ? sensible(s, ado, data) : 0;
    size = fitting ? fitting : payload(s, ado, data, size);
    memset(at, 0, DATAGRAM_HEADER);
    at[0] = (uint8_t)(calm ? BWR : one_in(4) ? below(256) : 1 + below(14));
    if (at[0] >= LRD && at[0] <= LRW)
        store32(at + 2, one_in(4) ? (uint32_t)extreme(s) : below(64));
    else {
        int position = (int)below(DEVICES + 1);
        store16(at + 2, (uint16_t)(at[0] == FPRD || at[0] == FPWR || at[0] == FPRW || at[0] == FRMW
                                       ? STATION + position : -position));
        store16(at + 4, (uint16_t)ado);
    }
    store16(at + 6, (uint16_t)(size | (more ? 0x8000 : 0)));
    store16(data + size, 0);
    return DATAGRAM_HEADER + size + 2;
}

static uint32_t make_frame(const cat_segment *s, uint8_t *frame) {
    uint32_t at = ETHERNET_HEADER + ETHERCAT_HEADER, left = 1 + below(4);
    memset(frame, 0xFF, 12);
    frame[12] = 0x88;
    frame[13] = 0xA4;
    while (left-- && at + 64 < CAT_FRAME_MAX)
        at += put_datagram(s, frame + at, CAT_FRAME_MAX - at - 12, left > 0);
    uint32_t length = at - ETHERNET_HEADER - ETHERCAT_HEADER;
    store16(frame + ETHERNET_HEADER, (uint16_t)(0x1000 | (one_in(64) ? below(0x800) : length)));
    return at;
}

/* Power comes and goes, so that what one sequence locked (write protection) does not end the test. */
static void restart(cat_segment *s) {
    int n = (int)below(DEVICES);
    calm = one_in(2);
    lock(s);
    controller_power_off(&s->controllers[n]);
    segment_light(s, 1);
    fill_sii(s->controllers[n].sii.image, KINDS[n].emulation);
    controller_power_on(&s->controllers[n]);
    segment_light(s, 1);
    store16(s->controllers[n].memory + REG_STATION, (uint16_t)(STATION + n));
    if (KINDS[n].axes)
        map_axis(&s->controllers[n]);
    unlock(s);
}

/* The second interface comes and goes: a ring, or a line. */
static void switch_end(cat_segment *s) {
    lock(s);
    s->ends[1].up = (int)below(2);
    segment_light(s, 0);
    unlock(s);
}

static int wait_for(cat_segment *s, int64_t duration) {
    int64_t deadline = s->now + duration;
    if (line_wait_until(&s->ends[0], deadline, 0) != 0 || s->now < deadline) {
        fprintf(stderr, "the clock stands at %lld, before %lld\n", (long long)s->now, (long long)deadline);
        return 0;
    }
    return 1;
}

int main(int count, char **words) {
    static const int64_t pauses[] = {0, 1000, 50000, 300000, 1500000};
    uint8_t frame[CAT_FRAME_MAX + 2];
    const uint8_t *back;
    uint64_t answered = 0, frames = count > 1 ? strtoull(words[1], NULL, 0) : 100000;
    state = 0x9E3779B97F4A7C15ull * (1 + (count > 2 ? strtoull(words[2], NULL, 0) : 0));
    cat_segment *s = make_ring();
    for (uint64_t k = 0; k < frames; k++) {
        if (one_in(128))
            restart(s);
        if (one_in(64))
            switch_end(s);
        line_send(&s->ends[one_in(4)], frame, make_frame(s, frame));
        if (!wait_for(s, pauses[below(5)] + (one_in(5000) ? 100000000 : 0)))
            return 1;
        for (int n = 0; n < 2; n++)
            while (line_receive(&s->ends[n], &back) > 0)
                answered++;
    }
    printf("%llu of %llu frames came back, %llu datagrams, %lld ns\n", (unsigned long long)answered,
           (unsigned long long)frames, (unsigned long long)s->counters.datagrams, (long long)s->now);
    segment_free(s);
    return 0;
}
