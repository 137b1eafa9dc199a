/* FMMUs, ETG.1000.4 §6.7: bit-wise mapping of logical addresses to process RAM. */
#ifndef CATENARY_VIRTUAL_FMMU_H
#define CATENARY_VIRTUAL_FMMU_H

#include "controller/controller.h"
#include "sync_manager.h"

static void fmmu_configured(controller *c, int n) {
    const uint8_t *r = c->memory + REG_FMMU + n * FMMU_SIZE;
    fmmu *f = &c->fmmus[n];
    uint64_t start = load32(r);
    uint32_t length = load16(r + 4), start_bit = r[6] & 7, stop_bit = r[7] & 7;
    f->first = start * 8 + start_bit;
    f->end = length ? (start + length - 1) * 8 + stop_bit + 1 : f->first;
    f->physical = (uint64_t)load16(r + 8) * 8 + (r[10] & 7);
    f->reads = (r[11] & 1) != 0;
    f->writes = (r[11] & 2) != 0;
    f->active = (r[12] & 1) && f->end > f->first;
    f->bytewise = start_bit == 0 && stop_bit == 7 && (r[10] & 7) == 0;
    c->fmmu_active = 0;
    c->logical_first = UINT64_MAX;
    c->logical_end = 0;
    for (int k = 0; k < c->fmmu_count; k++) {
        const fmmu *g = &c->fmmus[k];
        if (!g->active)
            continue;
        c->fmmu_active++;
        c->logical_first = g->first < c->logical_first ? g->first : c->logical_first;
        c->logical_end = g->end > c->logical_end ? g->end : c->logical_end;
    }
}

static inline int bit_at(const uint8_t *p, uint64_t bit) { return p[bit >> 3] >> (bit & 7) & 1; }

static inline void put_bit(uint8_t *p, uint64_t bit, int value) {
    uint8_t mask = (uint8_t)(1u << (bit & 7));
    p[bit >> 3] = (uint8_t)(value ? p[bit >> 3] | mask : p[bit >> 3] & ~mask);
}

/* Access the part of a datagram with the logical bytes [base, base + size) that FMMU f covers. Return
 * 1 if any byte was accessed. */
static int fmmu_access(controller *c, const fmmu *f, uint64_t base, uint32_t size, uint8_t *data, int write) {
    uint64_t lo = f->first > base * 8 ? f->first : base * 8;
    uint64_t hi = f->end < (base + size) * 8 ? f->end : (base + size) * 8;
    if (lo >= hi)
        return 0;
    uint64_t physical = f->physical + (lo - f->first);
    uint32_t first_byte = (uint32_t)(physical >> 3);
    uint32_t bytes = (uint32_t)((physical + (hi - lo) + 7) / 8) - first_byte;
    if ((uint64_t)first_byte + bytes > c->memory_size)
        return 0;
    int outputs = first_byte >= REG_DIGITAL_OUTPUT && first_byte + bytes <= REG_DIGITAL_OUTPUT_END;
    /* for example a cyclically mapped mailbox status, 0x080D */
    int registers = first_byte < REG_END && !outputs;
    if (registers && (write || first_byte + bytes > REG_END))
        return 0;
    if (f->bytewise && !registers)
        return ram_access(c, first_byte, bytes, data + (lo / 8 - base), write);

    uint8_t *part = c->segment->scratch;     /* bytes <= 1500 + 2, limited by the datagram */
    uint64_t in_data = lo - base * 8, in_part = physical - (uint64_t)first_byte * 8, count = hi - lo;
    if (write) {
        for (uint32_t k = 0; k < bytes; k++)
            part[k] = ram_peek(c, first_byte + k);
        for (uint64_t k = 0; k < count; k++)
            put_bit(part, in_part + k, bit_at(data, in_data + k));
        return ram_access(c, first_byte, bytes, part, 1);
    }
    if (registers)
        memcpy(part, c->memory + first_byte, bytes);
    else if (!ram_access(c, first_byte, bytes, part, 0))
        return 0;
    for (uint64_t k = 0; k < count; k++)
        put_bit(data, in_data + k, bit_at(part, in_part + k));
    return 1;
}

/* Process a logical datagram at one controller, and return the increment of the working counter.
 * Take the outputs before inserting the inputs, because their areas in a frame can overlap. */
static inline int fmmu_datagram(controller *c, uint32_t address, uint32_t size, uint8_t *data, int reads, int writes) {
    uint64_t base = address;
    if (c->fmmu_active == 0 || c->logical_end <= base * 8 || c->logical_first >= (base + size) * 8)
        return 0;
    if (reads && writes && c->no_lrw)
        return 0;
    int read = 0, written = 0;
    for (int n = 0; writes && n < c->fmmu_count; n++)
        if (c->fmmus[n].active && c->fmmus[n].writes)
            written |= fmmu_access(c, &c->fmmus[n], base, size, data, 1);
    for (int n = 0; reads && n < c->fmmu_count; n++)
        if (c->fmmus[n].active && c->fmmus[n].reads)
            read |= fmmu_access(c, &c->fmmus[n], base, size, data, 0);
    return read + (reads ? 2 * written : written);
}

#endif
