/* One EtherCAT frame out of the two copies that a ring of devices was sent from both its ends.
 *
 * Data areas that devices read into start as zero in both copies, so what came back is the OR of
 * the two, and the working counter their sum: in a closed ring the second copy passes unprocessed
 * and adds nothing; in a cut one each copy has met the devices of its side alone (ETG.1000.4 §4.3).
 * SOEM (nicdrv.c, `ecx_outframe_red` and `ecx_waitinframe_red`) sends an empty broadcast on the second
 * link, and once it sees a cut, what came back on the first link again on the second: no merging,
 * and the time goes on behind the cut, but a cycle costs two round trips there.
 * A datagram that the second copy did not carry is a NOP there and left as it is; so is the time, which
 * the second copy brings to whoever is behind a cut instead of asking the reference clock.
 */
#ifndef CATENARY_RING_MERGE_H
#define CATENARY_RING_MERGE_H

#include <stdint.h>
#include "ethercat.h"

enum {
    CAT_MERGE_HEADER = CAT_ETHERNET_HEADER + CAT_ETHERCAT_HEADER,
    CAT_NOBODY = 0xFF                 /* both bytes of a station address that no device has */
};

static inline uint32_t cat_word(const uint8_t *p) { return (uint32_t)p[0] | (uint32_t)p[1] << 8; }

/* The whole size of the datagram at `at`, or 0 where it would leave the frame's `end`. */
static inline uint32_t cat_datagram_size(const uint8_t *frame, uint32_t at, uint32_t end) {
    if (at + CAT_DATAGRAM_HEADER + CAT_DATAGRAM_COUNTER > end) return 0;
    uint32_t size = CAT_DATAGRAM_HEADER + (cat_word(frame + at + 6) & 0x7FFu) + CAT_DATAGRAM_COUNTER;
    return at + size <= end ? size : 0;
}

/* Where the datagrams of a frame end: as its EtherCAT header says, within its length; 0: nowhere. */
static inline uint32_t cat_datagrams_end(const uint8_t *frame, uint32_t length) {
    if (length < CAT_MERGE_HEADER) return 0;
    uint32_t end = CAT_MERGE_HEADER + (cat_word(frame + 14) & 0x7FFu);
    return end <= length ? end : 0;
}

/* Where the data of the frame's first NOP datagram begin, and their size; 0: the frame has none. */
static inline uint32_t cat_find_nop(const uint8_t *frame, uint32_t length, uint32_t *size) {
    uint32_t end = cat_datagrams_end(frame, length);
    for (uint32_t at = CAT_MERGE_HEADER; at < end;) {
        uint32_t whole = cat_datagram_size(frame, at, end);
        if (whole == 0) return 0;
        if (frame[at] == CAT_NOP) {
            *size = whole - CAT_DATAGRAM_HEADER - CAT_DATAGRAM_COUNTER;
            return at + CAT_DATAGRAM_HEADER;
        }
        at += whole;
    }
    return 0;
}

/* Whether the second copy's datagram says nothing of the first's: it is not the same question. */
static inline int cat_is_apart(const uint8_t *mine, const uint8_t *other) {
    return other[0] == CAT_NOP || (other[0] == CAT_FRMW && cat_word(other + 2) != cat_word(mine + 2));
}

/* Merges `other` into `frame`. 0, or -1 where the two are not copies of one frame (then `frame` may
 * have been changed up to the datagram that differs). */
static inline int cat_ring_merge(uint8_t *frame, uint32_t length, const uint8_t *other, uint32_t other_length) {
    uint32_t end = cat_datagrams_end(frame, length);
    if (end == 0 || cat_datagrams_end(other, other_length) != end) return -1;
    for (uint32_t at = CAT_MERGE_HEADER; at < end;) {
        uint32_t size = cat_datagram_size(frame, at, end);
        if (size == 0 || cat_datagram_size(other, at, end) != size || frame[at + 1] != other[at + 1]) return -1;
        if (!cat_is_apart(frame + at, other + at)) {
            if (other[at] != frame[at]) return -1;
            uint32_t counter = at + size - CAT_DATAGRAM_COUNTER;
            for (uint32_t i = at + CAT_DATAGRAM_HEADER; i < counter; i++) frame[i] |= other[i];
            uint32_t sum = cat_word(frame + counter) + cat_word(other + counter);
            frame[counter] = (uint8_t)sum;
            frame[counter + 1] = (uint8_t)(sum >> 8);
        }
        at += size;
    }
    return 0;
}

/* Without a time in it a datagram that reads at one device and writes at all others would write zeros. */
static inline int cat_is_zero(const uint8_t *data, uint32_t size) {
    for (uint32_t i = 0; i < size; i++)
        if (data[i]) return 0;
    return 1;
}

/* Makes the second copy: datagrams that must not be there twice become NOPs. Those with a position
 * (it would count from the other end), and those that read at one device and write at all others, if
 * they carry nothing. If they do, it is the time that is expected of the reference clock: the second
 * copy asks nobody for a better one, and so leads the clocks behind a cut. */
static inline void cat_ring_second(uint8_t *frame, uint32_t length) {
    uint32_t end = cat_datagrams_end(frame, length);
    for (uint32_t at = CAT_MERGE_HEADER; at < end;) {
        uint32_t size = cat_datagram_size(frame, at, end);
        if (size == 0) return;
        switch (frame[at]) {
        case CAT_FRMW:
            if (!cat_is_zero(frame + at + CAT_DATAGRAM_HEADER,
                             size - CAT_DATAGRAM_HEADER - CAT_DATAGRAM_COUNTER)) {
                frame[at + 2] = frame[at + 3] = CAT_NOBODY;
                break;
            }
            /* fallthrough */
        case CAT_APRD: case CAT_APWR: case CAT_APRW: case CAT_ARMW:
            frame[at] = CAT_NOP;
        }
        at += size;
    }
}

#endif
