/* Wait-free bounded queue of records of one size, from one producer to one consumer. They may be
 * in different processes.
 *
 * The record with ticket t is in slot t % length. The slot's stamp is t + 1 once the record is
 * complete. When the queue is full, the producer either refuses the newest record or overwrites the
 * oldest. In the latter case the consumer detects the changed stamp and skips the lost records. If
 * a producer is killed during a put, its record is not in the queue, but the oldest one may already
 * be overwritten. If a consumer is killed during a take, the record stays in the queue.
 */
#ifndef CATENARY_RECORD_QUEUE_H
#define CATENARY_RECORD_QUEUE_H

#include <stdint.h>
#include <string.h>

#include "atomics.h"

typedef struct record_queue {
    uint64_t put __attribute__((aligned(64)));    /* written by the producer: records put */
    uint64_t refused;
    int32_t producer;                             /* id of its thread; 0 if none yet */
    uint64_t taken __attribute__((aligned(64)));  /* written by the consumer: records taken or lost */
    uint64_t lost;
    int32_t consumer;
    uint32_t size;                                /* of a record [bytes] */
    uint32_t length;                              /* in records */
    uint32_t overwrite;
} record_queue;

static inline uint64_t *queue_stamp(record_queue *q, uint64_t ticket) {
    return (uint64_t *)(q + 1) + ticket % q->length;
}

static inline uint8_t *queue_record(record_queue *q, uint64_t ticket) {
    return (uint8_t *)((uint64_t *)(q + 1) + q->length) + (ticket % q->length) * q->size;
}

static inline uint64_t queue_memory(uint32_t size, uint32_t length) {
    return sizeof(record_queue) + (uint64_t)length * (sizeof(uint64_t) + size);
}

/* Append a record. Return 1, or 0 if the queue is full and refuses it. */
static int queue_put(record_queue *q, const void *bytes) {
    uint64_t ticket = q->put;
    if (!q->overwrite && ticket - cat_load_acquire64(&q->taken) >= q->length) {
        q->refused++;
        return 0;
    }
    uint64_t *stamp = queue_stamp(q, ticket);
    __atomic_store_n(stamp, 0, __ATOMIC_RELAXED);
    __atomic_thread_fence(__ATOMIC_RELEASE);
    cat_copy_to_shared(queue_record(q, ticket), bytes, q->size);
    cat_store_release64(stamp, ticket + 1);
    cat_store_release64(&q->put, ticket + 1);
    return 1;
}

/* Take the oldest record that still exists. Return 1, or 0 if the queue is empty or if records are
 * overwritten faster than they can be copied. */
static int queue_take(record_queue *q, void *bytes) {
    for (uint32_t tries = 0; tries < 1000; tries++) {
        uint64_t ticket = q->taken, put = cat_load_acquire64(&q->put);
        if (ticket == put) return 0;
        if (put - ticket > q->length) {
            q->lost += put - q->length - ticket;
            ticket = put - q->length;
        }
        uint64_t *stamp = queue_stamp(q, ticket);
        uint64_t before = cat_load_acquire64(stamp);
        cat_copy_from_shared(bytes, queue_record(q, ticket), q->size);
        __atomic_thread_fence(__ATOMIC_ACQUIRE);
        int whole = before == ticket + 1 && cat_load_relaxed64(stamp) == before;
        q->lost += !whole;
        cat_store_release64(&q->taken, ticket + 1);
        if (whole) return 1;
    }
    return 0;
}

#endif
