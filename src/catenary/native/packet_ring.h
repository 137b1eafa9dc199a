/* A bounded ring of Ethernet frames between one producer thread and one consumer thread.
 * Neither waits for the other. Push fails if the ring is full; peek returns NULL if it is empty.
 */
#ifndef CATENARY_PACKET_RING_H
#define CATENARY_PACKET_RING_H

#include <stdint.h>
#include <string.h>
#include "atomics.h"
#include "link.h"

#define CAT_RING_SLOTS 64u            /* a power of two */

typedef struct cat_packet {
    uint32_t length;
    uint32_t reserved;
    int64_t stamp;                    /* [ns], set by the producer */
    uint8_t bytes[CAT_FRAME_MAX + 6]; /* + 6 aligns the next slot */
} cat_packet;

typedef struct cat_packet_ring {
    uint32_t head __attribute__((aligned(64)));   /* next slot to write; changed by the producer */
    uint32_t tail __attribute__((aligned(64)));   /* next slot to read; changed by the consumer */
    cat_packet slots[CAT_RING_SLOTS];
} cat_packet_ring;

/* Return 0, -1 if the ring is full, -2 if the frame is too long. */
static inline int cat_ring_push(cat_packet_ring *ring, const uint8_t *bytes, uint32_t length, int64_t stamp) {
    uint32_t head = ring->head;
    if (length > CAT_FRAME_MAX) return -2;
    if (head - cat_load_acquire32(&ring->tail) >= CAT_RING_SLOTS) return -1;
    cat_packet *slot = &ring->slots[head & (CAT_RING_SLOTS - 1u)];
    slot->length = length;
    slot->stamp = stamp;
    memcpy(slot->bytes, bytes, length);
    cat_store_release32(&ring->head, head + 1u);
    return 0;
}

/* Return the oldest packet, or NULL if the ring is empty. It is valid until cat_ring_drop. */
static inline const cat_packet *cat_ring_peek(const cat_packet_ring *ring) {
    uint32_t tail = ring->tail;
    if (cat_load_acquire32(&ring->head) == tail) return 0;
    return &ring->slots[tail & (CAT_RING_SLOTS - 1u)];
}

static inline void cat_ring_drop(cat_packet_ring *ring) {
    cat_store_release32(&ring->tail, ring->tail + 1u);
}

#endif
