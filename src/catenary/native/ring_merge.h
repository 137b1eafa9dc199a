/* Merge of the two copies of an EtherCAT frame that were sent from both ends of a ring.
 *
 * Data areas that devices read into start as zero in both copies. The result is therefore the OR of
 * the two, and its working counter their sum. In a closed ring no device processes the second copy,
 * so it adds nothing. In a broken ring each copy meets only the devices of its side (ETG.1000.4
 * §4.3). SOEM (nicdrv.c, `ecx_outframe_red` and `ecx_waitinframe_red`) instead sends an empty
 * broadcast on the second link. In a broken ring it then sends the frame that returned on the first
 * link again on the second link. This needs no merge and carries the time beyond the break, but a
 * cycle takes two round trips. A datagram that the second copy lacks is a NOP there. It is not
 * merged. The datagram that distributes the time is not merged either. Beyond a break, the second
 * copy writes the time to the devices instead of reading the reference clock.
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

/* Return the total size of the datagram at `at`, or 0 if it exceeds the frame's `end`. */
static inline uint32_t cat_datagram_size(const uint8_t *frame, uint32_t at, uint32_t end) {
    if (at + CAT_DATAGRAM_HEADER + CAT_DATAGRAM_COUNTER > end) return 0;
    uint32_t size = CAT_DATAGRAM_HEADER + (cat_word(frame + at + 6) & 0x7FFu) + CAT_DATAGRAM_COUNTER;
    return at + size <= end ? size : 0;
}

/* Return the end of the datagrams according to the EtherCAT header; 0 if it exceeds the
 * length of the frame. */
static inline uint32_t cat_datagrams_end(const uint8_t *frame, uint32_t length) {
    if (length < CAT_MERGE_HEADER) return 0;
    uint32_t end = CAT_MERGE_HEADER + (cat_word(frame + 14) & 0x7FFu);
    return end <= length ? end : 0;
}

/* Return the offset of the data of the first NOP datagram, and set *size; 0 if there is none. */
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

/* Return 1 if the second copy's datagram must not be merged, because it is a different
 * request. */
static inline int cat_is_apart(const uint8_t *mine, const uint8_t *other) {
    return other[0] == CAT_NOP || (other[0] == CAT_FRMW && cat_word(other + 2) != cat_word(mine + 2));
}

/* Merge `other` into `frame`. Return 0, or -1 if the two are not copies of one frame (then `frame`
 * may have been changed up to the datagram that differs). */
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

/* Return 1 if all bytes are zero. A FRMW with zeros contains no time and would write
 * zeros to all devices. */
static inline int cat_is_zero(const uint8_t *data, uint32_t size) {
    for (uint32_t i = 0; i < size; i++)
        if (data[i]) return 0;
    return 1;
}

/* Make the second copy: datagrams that must not be sent twice become NOPs. These are datagrams with
 * a position address, because positions would count from the other end, and a FRMW whose data is
 * zero. A FRMW with other data contains the expected time of the reference clock. The second copy
 * sends it to an address that no device has, so it only writes the time to clocks beyond a break. */
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
