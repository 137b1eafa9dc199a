/* Futex calls: wait until a 32-bit word changes, across threads or processes (CLOCK_MONOTONIC). */
#ifndef CATENARY_FUTEX_H
#define CATENARY_FUTEX_H

#include <errno.h>
#include <linux/futex.h>
#include <stdint.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

/* Sleep while *word == value, for at most timeout_ns. Return 0 if woken or if the word has changed,
 * -ETIMEDOUT or -EINTR. */
static inline int cat_futex_wait(uint32_t *word, uint32_t value, int64_t timeout_ns) {
    struct timespec timeout = {timeout_ns / 1000000000, timeout_ns % 1000000000};
    if (syscall(SYS_futex, word, FUTEX_WAIT_PRIVATE, value, &timeout, 0, 0) == 0) return 0;
    return errno == EAGAIN ? 0 : -errno;
}

static inline void cat_futex_wake(uint32_t *word) {
    syscall(SYS_futex, word, FUTEX_WAKE_PRIVATE, 0x7fffffff, 0, 0, 0);
}

/* Like cat_futex_wait, for a word in memory that processes share. `deadline_ns` is absolute;
 * INT64_MAX waits without a timeout. The wait is as precise as clock_nanosleep, but can be ended
 * early by a wake-up. */
static inline int cat_futex_wait_shared(uint32_t *word, uint32_t value, int64_t deadline_ns) {
    struct timespec until = {deadline_ns / 1000000000, deadline_ns % 1000000000};
    struct timespec *timeout = deadline_ns == INT64_MAX ? 0 : &until;
    if (syscall(SYS_futex, word, FUTEX_WAIT_BITSET, value, timeout, 0, FUTEX_BITSET_MATCH_ANY) == 0) return 0;
    return errno == EAGAIN ? 0 : -errno;
}

static inline void cat_futex_wake_some_shared(uint32_t *word, int count) {
    syscall(SYS_futex, word, FUTEX_WAKE, count, 0, 0, 0);
}

static inline void cat_futex_wake_shared(uint32_t *word) {
    cat_futex_wake_some_shared(word, 0x7fffffff);
}

#endif
