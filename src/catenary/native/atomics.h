/* Named memory orders for Cython, which has no atomics (C11 semantics through GCC's builtins). */
#ifndef CATENARY_ATOMICS_H
#define CATENARY_ATOMICS_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

static inline uint32_t cat_load_acquire32(const uint32_t *p) { return __atomic_load_n(p, __ATOMIC_ACQUIRE); }
static inline uint64_t cat_load_acquire64(const uint64_t *p) { return __atomic_load_n(p, __ATOMIC_ACQUIRE); }
static inline uint32_t cat_load_relaxed32(const uint32_t *p) { return __atomic_load_n(p, __ATOMIC_RELAXED); }
static inline uint64_t cat_load_relaxed64(const uint64_t *p) { return __atomic_load_n(p, __ATOMIC_RELAXED); }
static inline void cat_store_release32(uint32_t *p, uint32_t v) { __atomic_store_n(p, v, __ATOMIC_RELEASE); }
static inline void cat_store_release64(uint64_t *p, uint64_t v) { __atomic_store_n(p, v, __ATOMIC_RELEASE); }
static inline void *cat_load_acquire_pointer(void *const *p) { return __atomic_load_n(p, __ATOMIC_ACQUIRE); }
static inline void cat_store_release_pointer(void **p, void *v) { __atomic_store_n(p, v, __ATOMIC_RELEASE); }
static inline uint32_t cat_exchange32(uint32_t *p, uint32_t v) { return __atomic_exchange_n(p, v, __ATOMIC_ACQ_REL); }
/* Replace *p by `to` if it equals `from`. Return 1 if it was replaced. */
static inline int cat_change32(uint32_t *p, uint32_t from, uint32_t to) {
    return __atomic_compare_exchange_n(p, &from, to, 0, __ATOMIC_ACQ_REL, __ATOMIC_ACQUIRE);
}
static inline uint32_t cat_add32(uint32_t *p, uint32_t v) { return __atomic_fetch_add(p, v, __ATOMIC_ACQ_REL); }
static inline uint64_t cat_add64(uint64_t *p, uint64_t v) { return __atomic_fetch_add(p, v, __ATOMIC_ACQ_REL); }
static inline void cat_store_relaxed64(uint64_t *p, uint64_t v) { __atomic_store_n(p, v, __ATOMIC_RELAXED); }
static inline uint32_t cat_or32(uint32_t *p, uint32_t v) { return __atomic_fetch_or(p, v, __ATOMIC_ACQ_REL); }
static inline void cat_fence(void) { __atomic_thread_fence(__ATOMIC_SEQ_CST); }

/* Copies under a seqlock: another thread may access the bytes at the same time. The reader
 * checks afterwards whether its copy is consistent. Each word of the shared block is accessed by one
 * relaxed atomic operation (Boehm, "Can seqlocks get along with programming language memory models?", 2012). */
static inline size_t cat_shared_words(const void *shared, size_t size) {
    return (uintptr_t)shared % sizeof(uint64_t) ? 0 : size / sizeof(uint64_t);
}

static inline void cat_copy_to_shared(void *to, const void *from, size_t size) {
    size_t words = cat_shared_words(to, size), i;
    for (i = 0; i < words; i++) {
        uint64_t word;
        memcpy(&word, (const uint8_t *)from + i * sizeof word, sizeof word);
        __atomic_store_n((uint64_t *)to + i, word, __ATOMIC_RELAXED);
    }
    for (i = words * sizeof(uint64_t); i < size; i++)
        __atomic_store_n((uint8_t *)to + i, ((const uint8_t *)from)[i], __ATOMIC_RELAXED);
}

static inline void cat_copy_from_shared(void *to, const void *from, size_t size) {
    size_t words = cat_shared_words(from, size), i;
    for (i = 0; i < words; i++) {
        uint64_t word = __atomic_load_n((const uint64_t *)from + i, __ATOMIC_RELAXED);
        memcpy((uint8_t *)to + i * sizeof word, &word, sizeof word);
    }
    for (i = words * sizeof(uint64_t); i < size; i++)
        ((uint8_t *)to)[i] = __atomic_load_n((const uint8_t *)from + i, __ATOMIC_RELAXED);
}

static inline void cat_clear_shared(void *to, size_t size) {
    for (size_t i = 0; i < size; i++) __atomic_store_n((uint8_t *)to + i, 0, __ATOMIC_RELAXED);
}

#endif
