/* Triple buffer: passes the latest value from one writer thread to one reader thread. Neither thread
 * waits, and the reader never sees a torn value.
 *
 * There are three slots: the writer owns one, the reader owns one, and the third is offered. To
 * publish or to take a value, a thread exchanges its own slot for the offered one. A value that the
 * reader does not take in time is overwritten by the next one.
 */
#ifndef CATENARY_TRIPLE_BUFFER_H
#define CATENARY_TRIPLE_BUFFER_H

#include <stdint.h>
#include "atomics.h"

#define CAT_TRIPLE_NEW 4u             /* flag in `offered`: the reader has not taken this slot yet */

/* Each word has 60 bytes of padding on both sides, so that two words never share a cache line of 64
 * bytes at any address. The structure is not aligned to a cache line, because it is a member of
 * Python objects, which are aligned to 16 bytes only. */
typedef struct cat_triple {
    uint8_t before[60];
    uint32_t offered;             /* slot | CAT_TRIPLE_NEW */
    uint8_t between[60];
    uint32_t back;                /* the writer's slot */
    uint8_t apart[60];
    uint32_t front;               /* the reader's slot */
    uint8_t after[60];
} cat_triple;

static inline void cat_triple_init(cat_triple *triple) {
    triple->back = 0u;
    triple->offered = 1u;
    triple->front = 2u;
}

/* Offer the filled slot `back`, and set `back` to a free slot. */
static inline void cat_triple_publish(cat_triple *triple) {
    triple->back = cat_exchange32(&triple->offered, triple->back | CAT_TRIPLE_NEW) & 3u;
}

/* Set `front` to the newest slot and return 1. If there is no new value, return 0. */
static inline int cat_triple_take(cat_triple *triple) {
    if (!(cat_load_acquire32(&triple->offered) & CAT_TRIPLE_NEW)) return 0;
    triple->front = cat_exchange32(&triple->offered, triple->front) & 3u;
    return 1;
}

#endif
