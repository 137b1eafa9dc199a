/* Touch probes of a servo axis, CiA 402-2 / IEC 61800-7-201: 0x60B8 to 0x60BD, 0x60D0 to 0x60D8.
 *
 * A probe stores the position and the system time of an edge of its source. An edge lies between two
 * steps of the axis, and its position and time are interpolated. In single mode (bit 1 of 0x60B8 is
 * 0), the first edge is kept until the edge or the probe is disabled. In continuous mode, each edge
 * replaces the last one. The sources are two inputs and the index pulse of the encoder, once per
 * turn. An input is active while its wire is, or while the axis is within the range of its switch.
 * Included by servo.h. */
#ifndef CATENARY_VIRTUAL_SERVO_PROBE_H
#define CATENARY_VIRTUAL_SERVO_PROBE_H

enum {
    PROBE_ENABLE = 0x01, PROBE_CONTINUOUS = 0x02, PROBE_SOURCE = 0x0C, PROBE_POSITIVE = 0x10,
    PROBE_NEGATIVE = 0x20,
    PROBE_SOURCE_INPUT = 0x00, PROBE_SOURCE_INDEX = 0x04, PROBE_SOURCE_OBJECT = 0x08,  /* 0x60D0 */
    PROBE_ENABLED = 0x01, PROBE_STORED = 0x02,       /* 0x60B9; << 1: of the negative edge */
    PROBE_TOGGLE = 0x40                              /* << 1: of the negative edge */
};

enum { PROBE_INDEX = PROBES, PROBE_NO_SOURCE };      /* sources after the inputs 0 and 1 */

#define PROBE_TURN 6.283185307179586476925           /* distance of index pulses [rad] */

static inline int probe_function(const int64_t *slots, int probe) {
    return (int)(slots[SLOT_PROBE_FUNCTION] >> (8 * probe)) & 0xFF;
}

static inline void probe_show(int64_t *slots, int probe, int status) {
    int shift = 8 * probe;
    slots[SLOT_PROBE_STATUS] = (slots[SLOT_PROBE_STATUS] & ~(0xFFll << shift)) | (int64_t)status << shift;
}

static inline int probe_status(const int64_t *slots, int probe) {
    return (int)(slots[SLOT_PROBE_STATUS] >> (8 * probe)) & 0xFF;
}

/* Return the source of a probe: an input, PROBE_INDEX or PROBE_NO_SOURCE. */
static int probe_source(const int64_t *slots, int probe) {
    switch (probe_function(slots, probe) & PROBE_SOURCE) {
    case PROBE_SOURCE_INPUT:
        return probe;
    case PROBE_SOURCE_INDEX:
        return PROBE_INDEX;
    case PROBE_SOURCE_OBJECT:
        switch (slots[SLOT_PROBE_SOURCE_1 + probe]) {
        case 1: return 0;
        case 2: return 1;
        case 5: return PROBE_INDEX;
        }
    }
    return PROBE_NO_SOURCE;
}

/* Enable and disable the probes as 0x60B8 requests. Disabling a probe or an edge clears its bits. With the
 * quirk `keeps_stored`, the bits of a disabled probe are cleared only when it is enabled again. */
static void probes_command(servo_axis *a, int64_t *slots) {
    for (int n = 0; n < PROBES; n++) {
        int function = probe_function(slots, n), status = probe_status(slots, n);
        int both = PROBE_POSITIVE | PROBE_NEGATIVE;
        int refused = a->probe_quirks.one_edge && (function & both) == both;
        if (!(function & PROBE_ENABLE) || refused) {
            probe_show(slots, n, a->probe_quirks.keeps_stored ? status & ~PROBE_ENABLED : 0);
            continue;
        }
        if (!(status & PROBE_ENABLED))
            status = PROBE_ENABLED;
        if (!(function & PROBE_POSITIVE))
            status &= ~PROBE_STORED;
        if (!(function & PROBE_NEGATIVE))
            status &= ~(PROBE_STORED << 1);
        probe_show(slots, n, status);
    }
}

/* Store an edge of a source in each enabled probe that waits for it. `when`: time of the segment. */
static void probe_edge(const controller *c, servo_axis *a, int64_t *slots, int source, int falling, double position,
                       int64_t when) {
    for (int n = 0; n < PROBES; n++) {
        int function = probe_function(slots, n), status = probe_status(slots, n);
        if (!(status & PROBE_ENABLED) || probe_source(slots, n) != source
            || !(function & (PROBE_POSITIVE << falling)))
            continue;
        if (!(function & PROBE_CONTINUOUS) && (status & PROBE_STORED << falling))
            continue;
        int value = 2 * n + falling;
        slots[SLOT_PROBE_POSITIONS + value] = wrap32(llrint(position * a->counts_per_radian) - a->zero);
        slots[SLOT_PROBE_TIMES + value] = dc_system_time(c, when) & 0xFFFFFFFF;
        slots[SLOT_PROBE_COUNTERS + value] = (slots[SLOT_PROBE_COUNTERS + value] + 1) & 0xFFFF;
        status |= PROBE_STORED << falling;
        if (a->probe_quirks.toggles && (function & PROBE_CONTINUOUS))
            status ^= PROBE_TOGGLE << falling;
        probe_show(slots, n, status);
    }
}

static inline int probe_switch_closed(const servo_probe *p, double position) {
    return p->from <= position && position < p->to;
}

static inline int probe_level(const servo_axis *a, int input) {
    const servo_probe *p = &a->probes[input];
    return p->wire || probe_switch_closed(p, a->probed);
}

/* Motion of the axis since the last step. */
typedef struct probe_path {
    double before, after;             /* rad */
    int64_t began, ended;             /* time of the segment [ns] */
} probe_path;

static inline int probe_passes(const probe_path *m, double at) {
    return (m->before < at && at <= m->after) || (m->before >= at && at > m->after);
}

static inline int64_t probe_time(const probe_path *m, double at) {
    double fraction = (at - m->before) / (m->after - m->before);
    return m->began + llrint(fraction * (double)(m->ended - m->began));
}

static void probe_passed(const controller *c, servo_axis *a, int64_t *slots, const probe_path *m, int source,
                         int falling, double at) {
    if (probe_passes(m, at))
        probe_edge(c, a, slots, source, falling, at, probe_time(m, at));
}

static void probe_switch_passed(const controller *c, servo_axis *a, int64_t *slots, const probe_path *m, int input) {
    const servo_probe *p = &a->probes[input];
    int forward = m->after > m->before;
    if (p->wire || !(p->from < p->to))
        return;
    probe_passed(c, a, slots, m, input, 0, forward ? p->from : p->to);
    probe_passed(c, a, slots, m, input, 1, forward ? p->to : p->from);
}

/* Handle all edges on the way from the last step to this one. */
static void probes_step(const controller *c, servo_axis *a, int64_t *slots) {
    probe_path m = {a->probed, a->position, a->probed_at, c->segment->now};
    a->probed_at = m.ended;
    a->probed = m.after;
    if (slots[SLOT_PROBE_STATUS] == 0 || m.before == m.after)
        return;
    for (int input = 0; input < PROBES; input++)
        probe_switch_passed(c, a, slots, &m, input);
    double turn = PROBE_TURN * floor((m.after > m.before ? m.after : m.before) / PROBE_TURN);
    probe_passed(c, a, slots, &m, PROBE_INDEX, 0, turn);
}

/* Change the wire of an input now. The position is extrapolated from the last step. */
static void probe_wire(const controller *c, servo_axis *a, int64_t *slots, int input, int level) {
    int before = probe_level(a, input);
    a->probes[input].wire = (uint8_t)level;
    int after = probe_level(a, input);
    if (before == after)
        return;
    int64_t now = c->segment->now;
    double elapsed = a->joint == NULL ? (double)(now - a->probed_at) * 1e-9 : 0;
    probe_edge(c, a, slots, input, before, a->position + a->velocity * elapsed, now);
}

#endif
