/* Ring buffer with the last rows of one writer, for any number of readers in any process.
 *
 * Row `number` is in slot number % count, after a sequence number that is odd during a write (a
 * seqlock). A reader copies the row and then checks that the writer has not overwritten it during the
 * copy. The writer never reads data of readers. Readers map the memory read-only, so they can neither
 * delay nor damage the writer. A writer that is killed during a write leaves an odd number in that
 * slot. All other rows remain valid.
 *
 * Wake-ups: the writer wakes one sleeping reader with one system call. Each reader that finds a new
 * row wakes two more. The cost for the writer does not depend on the number of readers. If a reader
 * dies after it was woken, the others sleep until the next row.
 */
#ifndef CATENARY_RING_H
#define CATENARY_RING_H

#include <stdint.h>
#include <string.h>

#include "../native/atomics.h"
#include "../native/futex.h"

enum { RING_WOKEN_BY_READER = 2, RING_TRIES = 1000 };

typedef struct share_ring {           /* shared */
    uint64_t newest;                  /* number of the last row; 0: none yet */
    uint32_t tick;                    /* futex word: counts rows */
    uint32_t ended;                   /* set when no more rows will come */
    uint8_t slots[] __attribute__((aligned(64)));
} share_ring;

typedef struct ring_view {            /* private to a process, which has checked the values */
    share_ring *ring;
    uint64_t count;                   /* of slots, a power of two */
    uint64_t stride;                  /* from slot to slot [bytes] */
    uint64_t size;                    /* of a row [bytes], after the slot's sequence number */
} ring_view;

static inline uint64_t ring_stride(uint64_t size) { return (sizeof(uint64_t) + size + 63) / 64 * 64; }

static inline uint64_t *ring_slot(const ring_view *v, uint64_t number) {
    return (uint64_t *)(v->ring->slots + (number & (v->count - 1)) * v->stride);
}

static inline uint64_t ring_newest(const ring_view *v) {
    return __atomic_load_n(&v->ring->newest, __ATOMIC_ACQUIRE);
}

/* Read this before `newest`: if it is set, `newest` is the last row. */
static inline int ring_is_ended(const ring_view *v) { return cat_load_acquire32(&v->ring->ended) != 0; }

/* Begin row `number` and return the address of its bytes, for cat_copy_to_shared. A reader discards
 * any copy that it makes between this call and ring_publish. */
static inline uint8_t *ring_begin(const ring_view *v, uint64_t number) {
    uint64_t *slot = ring_slot(v, number);
    __atomic_store_n(slot, 2 * number + 1, __ATOMIC_RELAXED);
    __atomic_thread_fence(__ATOMIC_RELEASE);
    return (uint8_t *)(slot + 1);
}

static inline void ring_publish(const ring_view *v, uint64_t number) {
    __atomic_store_n(ring_slot(v, number), 2 * number + 2, __ATOMIC_RELEASE);
    __atomic_store_n(&v->ring->newest, number, __ATOMIC_RELEASE);
    __atomic_fetch_add(&v->ring->tick, 1, __ATOMIC_SEQ_CST);
    cat_futex_wake_some_shared(&v->ring->tick, 1);
}

static inline void ring_end(const ring_view *v) {
    __atomic_store_n(&v->ring->ended, 1, __ATOMIC_RELEASE);
    __atomic_fetch_add(&v->ring->tick, 1, __ATOMIC_SEQ_CST);
    cat_futex_wake_shared(&v->ring->tick);
}

/* Return 1 if row `number` exists and the copy is consistent. */
static inline int ring_copy(const ring_view *v, uint64_t number, uint8_t *bytes) {
    const uint64_t *slot = ring_slot(v, number);
    uint64_t whole = 2 * number + 2;
    if (__atomic_load_n(slot, __ATOMIC_ACQUIRE) != whole) return 0;
    cat_copy_from_shared(bytes, slot + 1, v->size);
    __atomic_thread_fence(__ATOMIC_ACQUIRE);
    return __atomic_load_n(slot, __ATOMIC_RELAXED) == whole;
}

/* Copy the newest row. Return its number. Return 0 before the first row, or if all attempts fail. A
 * second attempt is necessary only if the writer writes `count` rows during one copy. */
static inline uint64_t ring_copy_newest(const ring_view *v, uint8_t *bytes) {
    for (int k = 0; k < RING_TRIES; k++) {
        uint64_t number = ring_newest(v);
        if (number == 0 || ring_copy(v, number, bytes)) return number;
    }
    return 0;
}

/* Copy the rows `first` to `first + rows - 1` that still exist, and return their count. `end` receives
 * the number of the last row copied, or first - 1. The loop counts rows instead of comparing numbers,
 * because numbers come from shared memory: a client can write 2^64 - 1 there. */
static inline uint64_t ring_copy_rows(const ring_view *v, uint64_t first, uint64_t rows, uint8_t *bytes,
                                      uint64_t *end) {
    uint64_t copied = 0;
    *end = first - 1;
    for (uint64_t k = 0; k < rows; k++) {
        uint64_t number = first + k;
        if (!ring_copy(v, number, bytes + copied * v->size)) continue;
        copied++;
        *end = number;
    }
    return copied;
}

/* Wait for a row after row `seen`, until `deadline` [ns, CLOCK_MONOTONIC]. Return 1 if it exists, 0
 * if the deadline has passed or no more rows will come, or -errno (-EINTR after a signal). */
static inline int ring_wait(const ring_view *v, uint64_t seen, int64_t deadline) {
    for (;;) {
        uint32_t tick = __atomic_load_n(&v->ring->tick, __ATOMIC_SEQ_CST);
        int rc, ended = ring_is_ended(v);
        if (ring_newest(v) > seen) {
            cat_futex_wake_some_shared(&v->ring->tick, RING_WOKEN_BY_READER);
            return 1;
        }
        if (ended) return 0;
        rc = cat_futex_wait_shared(&v->ring->tick, tick, deadline);
        if (rc == -ETIMEDOUT) return ring_newest(v) > seen;
        if (rc < 0) return rc;
    }
}

#endif
