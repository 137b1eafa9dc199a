/* Memory of the cycle. It causes no page faults in the cycle thread and is locked if the system
 * permits it.
 *
 * cat_memory_take    return a zeroed part, aligned to a cache line
 * cat_memory_settle  touch every page, then lock it (real time only, before the cycle uses it)
 * cat_memory_touch   touch every page without locking: for memory of lower priority
 * cat_memory_free    release everything; the kernel unlocks unmapped pages
 *
 * A memory is a list of chunks. A chunk is a mapping of whole pages: this header, then its parts. A
 * new chunk is allocated when the newest is full, touched or locked. A part cannot be freed alone;
 * it lives as long as the memory.
 *
 * state  RESERVED  mapped but not touched; sufficient for virtual time
 *        TOUCHED   every page has a page frame; `error` is the errno of mlock if it failed
 *        LOCKED    touched, and never swapped out
 *
 * The kernel refuses a whole chunk that exceeds RLIMIT_MEMLOCK: memories that
 * settle first are locked first. Touching adds 0 to a byte of each page atomically, so an owner may
 * settle its memory at any time.
 *
 * A forked child finds zeros in touched memory (MADV_WIPEONFORK). Copy-on-write would cause one page
 * fault per page in the cycle of the parent. With MADV_DONTFORK, a child that reads a NumPy view would
 * crash. In the child, the header of a chunk is also zero, so cat_memory_free has no effect.
 *
 * AddressSanitizer cannot check parts of a mapping. With it, each part is a separate heap block.
 */
#ifndef CATENARY_LOCKED_MEMORY_H
#define CATENARY_LOCKED_MEMORY_H

#include <errno.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#define CAT_CACHE_LINE 64u
#define CAT_CHUNK_SIZE (16u * 1024u)  /* minimum */

enum { CAT_MEMORY_RESERVED, CAT_MEMORY_TOUCHED, CAT_MEMORY_LOCKED };

typedef struct cat_chunk {
    struct cat_chunk *next;
    size_t size;                      /* bytes, this header included */
    size_t used;
    int state;
    int error;                        /* errno of mlock; 0: none */
} cat_chunk;

typedef struct cat_memory {
    cat_chunk *chunks;                /* list, newest first */
} cat_memory;

/* Sums over several memories. */
typedef struct cat_memory_state {
    size_t locked;                    /* bytes */
    size_t touched;                   /* bytes that are touched and not locked */
    int error;                        /* errno of the last memory that is not locked */
} cat_memory_state;

static inline size_t cat_round_up(size_t size, size_t step) { return (size + step - 1) / step * step; }

static inline cat_chunk *cat_chunk_new(size_t room) {
    size_t size = cat_round_up(sizeof(cat_chunk), CAT_CACHE_LINE) + room;
    cat_chunk *chunk;
#ifdef __SANITIZE_ADDRESS__
    chunk = (cat_chunk *)aligned_alloc(CAT_CACHE_LINE, cat_round_up(size, CAT_CACHE_LINE));
    if (!chunk) return 0;
    __builtin_memset(chunk, 0, size);
#else
    if (size < CAT_CHUNK_SIZE) size = CAT_CHUNK_SIZE;
    size = cat_round_up(size, (size_t)sysconf(_SC_PAGESIZE));
    chunk = (cat_chunk *)mmap(0, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (chunk == (cat_chunk *)MAP_FAILED) return 0;
#endif
    chunk->size = size;
    chunk->used = cat_round_up(sizeof(cat_chunk), CAT_CACHE_LINE);
    return chunk;
}

/* Return `count` zeroed elements of `size` bytes; NULL: out of memory. */
static inline void *cat_memory_take(cat_memory *memory, size_t count, size_t size) {
    cat_chunk *chunk = memory->chunks;
    size_t bytes;
    if (__builtin_mul_overflow(count, size, &bytes) || bytes > SIZE_MAX / 2) return 0;
    if (bytes == 0) bytes = 1;
    if (!chunk || chunk->state != CAT_MEMORY_RESERVED || chunk->size - chunk->used < bytes) {
        chunk = cat_chunk_new(bytes);
        if (!chunk) return 0;
        chunk->next = memory->chunks;
        memory->chunks = chunk;
    }
    void *part = (uint8_t *)chunk + chunk->used;
    chunk->used = cat_round_up(chunk->used + bytes, CAT_CACHE_LINE);
    if (chunk->used > chunk->size) chunk->used = chunk->size;
    return part;
}

/* Touch every page of a range, so that each has its own page frame. */
static inline void cat_touch(void *start, size_t size) {
    size_t page = (size_t)sysconf(_SC_PAGESIZE), at;
    volatile uint8_t *bytes = (volatile uint8_t *)start;
    for (at = 0; at < size; at += page - ((uintptr_t)start + at) % page)
        __atomic_fetch_add(bytes + at, 0, __ATOMIC_RELAXED);
}

/* Touch every page of a chunk and exclude it from copy-on-write. Linux before 4.14 refuses
 * MADV_WIPEONFORK: then a fork slows the cycle of the parent. The child does not depend on it. */
static inline void cat_chunk_touch(cat_chunk *chunk) {
#ifndef __SANITIZE_ADDRESS__
    madvise(chunk, chunk->size, MADV_WIPEONFORK);
#endif
    cat_touch(chunk, chunk->size);
}

static inline void cat_memory_settle(cat_memory *memory) {
    for (cat_chunk *chunk = memory->chunks; chunk; chunk = chunk->next) {
        if (chunk->state != CAT_MEMORY_RESERVED) continue;
        cat_chunk_touch(chunk);
        chunk->error = mlock(chunk, chunk->size) ? errno : 0;
        chunk->state = chunk->error ? CAT_MEMORY_TOUCHED : CAT_MEMORY_LOCKED;
    }
}

static inline void cat_memory_touch(cat_memory *memory) {
    for (cat_chunk *chunk = memory->chunks; chunk; chunk = chunk->next) {
        if (chunk->state != CAT_MEMORY_RESERVED) continue;
        cat_chunk_touch(chunk);
        chunk->state = CAT_MEMORY_TOUCHED;
    }
}

/* Add the state of a memory to the sums. */
static inline void cat_memory_add_state(const cat_memory *memory, cat_memory_state *sum) {
    for (const cat_chunk *chunk = memory->chunks; chunk; chunk = chunk->next) {
        if (chunk->state == CAT_MEMORY_LOCKED) sum->locked += chunk->size;
        if (chunk->state != CAT_MEMORY_TOUCHED) continue;
        sum->touched += chunk->size;
        sum->error = chunk->error;
    }
}

static inline void cat_memory_free(cat_memory *memory) {
    while (memory->chunks) {
        cat_chunk *chunk = memory->chunks;
        memory->chunks = chunk->next;
#ifdef __SANITIZE_ADDRESS__
        if (chunk->state == CAT_MEMORY_LOCKED) munlock(chunk, chunk->size);
        free(chunk);
#else
        munmap(chunk, chunk->size);
#endif
    }
}

#endif
