/* The latest value from one writer thread to one reader thread, never torn, never waiting.
 *
 * Three slots: the writer owns one, the reader owns one, the third is offered. Publishing and
 * taking exchange the own slot for the offered one. What the reader did not take in time is
 * overwritten: only the latest value counts.
 */
#ifndef CATENARY_TRIPLE_BUFFER_H
#define CATENARY_TRIPLE_BUFFER_H

#include <stdint.h>
#include "atomics.h"

#define CAT_TRIPLE_NEW 4u             /* with the slot's number: not taken yet */

typedef struct cat_triple {
    uint32_t offered __attribute__((aligned(64)));  /* slot | CAT_TRIPLE_NEW */
    uint32_t back __attribute__((aligned(64)));     /* the writer's slot */
    uint32_t front __attribute__((aligned(64)));    /* the reader's slot */
} cat_triple;

static inline void cat_triple_init(cat_triple *triple) {
    triple->back = 0u;
    triple->offered = 1u;
    triple->front = 2u;
}

/* Offers the slot `back` after it was filled; `back` is another one afterwards. */
static inline void cat_triple_publish(cat_triple *triple) {
    triple->back = cat_exchange32(&triple->offered, triple->back | CAT_TRIPLE_NEW) & 3u;
}

/* 1: `front` is a newer slot than before; 0: nothing new, `front` is as it was. */
static inline int cat_triple_take(cat_triple *triple) {
    if (!(cat_load_acquire32(&triple->offered) & CAT_TRIPLE_NEW)) return 0;
    triple->front = cat_exchange32(&triple->offered, triple->front) & 3u;
    return 1;
}

#endif
