/* Wait-free latest value, from one writer to any number of readers. They may be in different
 * processes.
 *
 * The writer uses four slots in turn. Each has a sequence number that is odd during a write (a
 * seqlock). A reader copies the slot published last, and repeats the copy if that slot was
 * overwritten. This happens only if the writer publishes three values during one copy. If a writer
 * is killed during a write, the previous value remains, and the next writer continues from there.
 */
#ifndef CATENARY_LATEST_VALUE_H
#define CATENARY_LATEST_VALUE_H

#include <stdint.h>
#include <string.h>

#include "atomics.h"

#define VALUE_SLOTS 4u
#define VALUE_TRIES 1000

typedef struct latest_value {
    uint64_t number;                  /* values published; the last is in slot number % SLOTS */
    uint64_t sequence[VALUE_SLOTS];
    int32_t writer;                   /* thread id of the writer; 0 if there is none yet */
    uint32_t size;
    uint8_t slots[] __attribute__((aligned(64)));
} latest_value;

static inline uint8_t *value_slot(latest_value *v, uint64_t number) {
    return v->slots + (number % VALUE_SLOTS) * v->size;
}

static void value_write(latest_value *v, const void *bytes) {
    uint64_t number = v->number + 1;
    uint64_t *sequence = &v->sequence[number % VALUE_SLOTS];
    __atomic_store_n(sequence, 2 * number + 1, __ATOMIC_RELAXED);
    __atomic_thread_fence(__ATOMIC_RELEASE);
    cat_copy_to_shared(value_slot(v, number), bytes, v->size);
    __atomic_store_n(sequence, 2 * number + 2, __ATOMIC_RELEASE);
    __atomic_store_n(&v->number, number, __ATOMIC_RELEASE);
}

/* Copy the value. Return its number, or -1 if a write interfered with every attempt. */
static int64_t value_read(latest_value *v, void *bytes) {
    for (int k = 0; k < VALUE_TRIES; k++) {
        uint64_t number = cat_load_acquire64(&v->number);
        const uint64_t *sequence = &v->sequence[number % VALUE_SLOTS];
        uint64_t before = __atomic_load_n(sequence, __ATOMIC_ACQUIRE);
        cat_copy_from_shared(bytes, value_slot(v, number), v->size);
        __atomic_thread_fence(__ATOMIC_ACQUIRE);
        uint64_t after = __atomic_load_n(sequence, __ATOMIC_RELAXED);
        uint64_t whole = number ? 2 * number + 2 : 0;
        if (before == whole && after == whole) return (int64_t)number;
    }
    return -1;
}

#endif
