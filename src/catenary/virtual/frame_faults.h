/* Faults of frames: their selection and effect, and the log of lost frames. Without such a fault,
 * the cost is at most one comparison per frame. */
#ifndef CATENARY_VIRTUAL_FRAME_FAULTS_H
#define CATENARY_VIRTUAL_FRAME_FAULTS_H

#include "route.h"

/* In the order of fault_player.FRAME_KINDS. LOSE_OUT: lost before the first device; LOSE_BACK: lost
 * after the last device. CORRUPT: bit errors on a cable; GARBLE: wrong bytes with a valid check
 * sequence. */
enum frame_fault_kind { FAULT_LOSE_OUT, FAULT_LOSE_BACK, FAULT_CORRUPT, FAULT_GARBLE, FAULT_DELAY, FAULT_DUPLICATE };

typedef struct {
    int lose_out, lose_back, garble, offset, duplicate;
    const arrival *corrupt;          /* first arrival with bit errors */
    int64_t delay;
} fate;

static const fate NO_FATE = {.offset = -1};

/* splitmix64 (Steele, Lea, Flood 2014) */
static inline uint64_t segment_random(cat_segment *s) {
    uint64_t z = s->random += 0x9E3779B97F4A7C15u;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}

static inline const arrival *route_crosses(const route *r, int cable) {
    for (uint32_t k = 0; k < r->arrival_count; k++)
        if (r->arrivals[k].cable == cable)
            return &r->arrivals[k];
    return NULL;
}

static void fate_add(cat_segment *s, const frame_fault *f, const arrival *where, fate *result) {
    switch (f->kind) {
    case FAULT_LOSE_OUT: result->lose_out = 1; break;
    case FAULT_LOSE_BACK: result->lose_back = 1; break;
    case FAULT_CORRUPT: result->corrupt = where; break;
    case FAULT_GARBLE: result->garble = 1; result->offset = f->offset; break;
    case FAULT_DELAY: result->delay += f->delay; break;
    case FAULT_DUPLICATE: result->duplicate = 1; break;
    }
}

/* Return the effect of all faults on a frame that takes this route, and count the frame. */
static fate fate_of(cat_segment *s, const route *r) {
    fate result = NO_FATE;
    for (int n = 0; s->fault_count && n < MAX_FRAME_FAULTS; n++) {
        frame_fault *f = &s->faults[n];
        if (!f->used || f->left == 0)
            continue;
        const arrival *where = f->kind == FAULT_CORRUPT ? route_crosses(r, f->cable) : NULL;
        if ((f->kind == FAULT_CORRUPT && !where) || f->seen++ % f->every)
            continue;
        f->left -= f->left > 0;
        fate_add(s, f, where, &result);
    }
    return result;
}

/* Invert the byte at `offset`; if it is negative, invert a random bit after the Ethernet header. */
static void frame_garble(cat_segment *s, uint8_t *frame, uint32_t length, int offset) {
    if (offset >= 0 && (uint32_t)offset < length)
        frame[offset] ^= 0xFF;
    if (offset >= 0 || length <= 14)
        return;
    uint64_t bit = segment_random(s) % (8ull * (length - 14));
    frame[14 + bit / 8] ^= (uint8_t)(1u << (bit & 7));
}

/* Count a corrupt frame: an RX error at the port of arrival, a forwarded error at each later port, and
 * an error in each later processing unit. */
static void frame_corrupted(cat_segment *s, const route *r, const arrival *where) {
    for (const arrival *a = where; a < r->arrivals + r->arrival_count; a++) {
        if (a->device < 0)
            continue;
        uint8_t *m = s->controllers[a->device].memory;
        count_up(m + (a == where ? REG_RX_ERRORS + 2 * a->port : REG_FORWARDED_ERRORS + a->port));
    }
    for (uint32_t k = where->stops; k < r->stop_count; k++)
        count_up(r->stops[k].controller->memory + REG_PROCESSING_UNIT_ERRORS);
}

static void frame_lost(cat_segment *s, int cause, int end, int64_t sent) {
    s->counters.lost++;
    s->losses[s->loss_count++ & (LOSS_LOG - 1)] = (loss){sent, cause, end};
}

#endif
