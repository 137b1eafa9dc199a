/* A mutex in shared memory, for slow paths. It is robust (the next waiter acquires the lock of a dead
 * owner), error-checking, and has priority inheritance (the owner inherits the priority of its
 * waiters): pthread_mutexattr_setrobust(3), _setprotocol(3).
 * Locking and unlocking take 20 ns without contention. */
#ifndef CATENARY_MUTEX_H
#define CATENARY_MUTEX_H

#include <errno.h>
#include <pthread.h>
#include <stdint.h>
#include <string.h>
#include <time.h>

typedef struct share_mutex {
    char magic[8];
    uint32_t version;
    uint32_t size;                    /* sizeof(pthread_mutex_t): must be the same in all processes */
    pthread_mutex_t mutex;
} share_mutex;

#define MUTEX_MAGIC "CATMUTEX"
#define MUTEX_VERSION 1u

/* Initialise a mutex, before other processes map it. Return 0 or -errno. */
static inline int mutex_init(share_mutex *m) {
    pthread_mutexattr_t attributes;
    int rc = pthread_mutexattr_init(&attributes);
    if (!rc) rc = pthread_mutexattr_setpshared(&attributes, PTHREAD_PROCESS_SHARED);
    if (!rc) rc = pthread_mutexattr_setrobust(&attributes, PTHREAD_MUTEX_ROBUST);
    if (!rc) rc = pthread_mutexattr_setprotocol(&attributes, PTHREAD_PRIO_INHERIT);
    if (!rc) rc = pthread_mutexattr_settype(&attributes, PTHREAD_MUTEX_ERRORCHECK);
    if (!rc) rc = pthread_mutex_init(&m->mutex, &attributes);
    memcpy(m->magic, MUTEX_MAGIC, sizeof m->magic);
    m->version = MUTEX_VERSION;
    m->size = sizeof(pthread_mutex_t);
    return -rc;
}

static inline int mutex_is_ours(const share_mutex *m) {
    return memcmp(m->magic, MUTEX_MAGIC, sizeof m->magic) == 0 && m->version == MUTEX_VERSION
        && m->size == sizeof(pthread_mutex_t);
}

/* Wait at most `timeout` [ns]. Return 0 if acquired, 1 if acquired from an owner that died,
 * -ETIMEDOUT, -EDEADLK (this thread already holds it) or another -errno (the mutex is damaged). */
static inline int mutex_lock(share_mutex *m, int64_t timeout) {
    struct timespec until;
    int rc = pthread_mutex_trylock(&m->mutex);
    if (rc == EBUSY && timeout > 0) {
        clock_gettime(CLOCK_REALTIME, &until);
        until.tv_sec += timeout / 1000000000 + (until.tv_nsec + timeout % 1000000000) / 1000000000;
        until.tv_nsec = (until.tv_nsec + timeout % 1000000000) % 1000000000;
        rc = pthread_mutex_timedlock(&m->mutex, &until);
    }
    if (rc == EBUSY) return -ETIMEDOUT;
    if (rc != EOWNERDEAD) return -rc;
    rc = pthread_mutex_consistent(&m->mutex);
    return rc ? -rc : 1;
}

static inline int mutex_unlock(share_mutex *m) { return -pthread_mutex_unlock(&m->mutex); }

#endif
