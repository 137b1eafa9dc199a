/* The last rows of somebody's work, from one writer to any number of readers in any process.
 *
 * Row `number` lies in slot number % count, behind a sequence number that is odd while it is
 * written (a seqlock): a reader copies and looks whether it was overwritten meanwhile. The writer
 * never looks at a reader; readers map the memory read-only, so they can neither delay nor break it.
 * A writer that is killed in mid-write leaves an odd number behind, and all other rows whole.
 *
 * Waking: one system call of the writer wakes one sleeper, and each reader that has news wakes two
 * more: a hundred readers cost the writer what one costs. Where a reader dies with its wake-up,
 * the others sleep one row longer.
 */
#ifndef CATENARY_RING_H
#define CATENARY_RING_H

#include <stdint.h>
#include <string.h>

#include "atomics.h"
#include "futex.h"

enum { RING_WOKEN_BY_READER = 2, RING_TRIES = 1000 };

typedef struct share_ring {           /* shared */
    uint64_t newest;                  /* number of the last row; 0: none yet */
    uint32_t tick;                    /* futex word: counts rows */
    uint32_t ended;                   /* no more rows will come */
    uint8_t slots[] __attribute__((aligned(64)));
} share_ring;

typedef struct ring_view {            /* private: what one process has checked */
    share_ring *ring;
    uint64_t count;                   /* of slots, a power of two */
    uint64_t stride;                  /* from slot to slot [bytes] */
    uint64_t size;                    /* of a row [bytes], behind the slot's sequence number */
} ring_view;

static inline uint64_t ring_stride(uint64_t size) { return (sizeof(uint64_t) + size + 63) / 64 * 64; }

static inline uint64_t *ring_slot(const ring_view *v, uint64_t number) {
    return (uint64_t *)(v->ring->slots + (number & (v->count - 1)) * v->stride);
}

static inline uint64_t ring_newest(const ring_view *v) {
    return __atomic_load_n(&v->ring->newest, __ATOMIC_ACQUIRE);
}

/* Read before `newest`: then that was the last. */
static inline int ring_is_ended(const ring_view *v) { return cat_load_acquire32(&v->ring->ended) != 0; }

/* Where the bytes of row `number` go, by cat_copy_to_shared; a reader drops what it copies between
 * this and ring_publish. */
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

/* Whether row `number` is there and was copied whole. */
static inline int ring_copy(const ring_view *v, uint64_t number, uint8_t *bytes) {
    const uint64_t *slot = ring_slot(v, number);
    uint64_t whole = 2 * number + 2;
    if (__atomic_load_n(slot, __ATOMIC_ACQUIRE) != whole) return 0;
    cat_copy_from_shared(bytes, slot + 1, v->size);
    __atomic_thread_fence(__ATOMIC_ACQUIRE);
    return __atomic_load_n(slot, __ATOMIC_RELAXED) == whole;
}

/* Copies the newest row; its number, 0: there is none. The writer would have to write `count` rows
 * during one copy for a second try. */
static inline uint64_t ring_copy_newest(const ring_view *v, uint8_t *bytes) {
    for (int k = 0; k < RING_TRIES; k++) {
        uint64_t number = ring_newest(v);
        if (number == 0 || ring_copy(v, number, bytes)) return number;
    }
    return 0;
}

/* Rows `first` to `first + rows - 1`, one behind the other, those that are still there; how many.
 * `end`: the number of the last one copied, first - 1 where there was none. The loop is bounded by
 * a count: `number` comes from shared memory, where a client can write 2^64 - 1. */
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

/* Waits for a row behind `seen`, until `deadline` [ns, CLOCK_MONOTONIC]. 1: it is there; 0: the
 * deadline has passed or nothing more will come; -EINTR. */
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
