/* Two threads on the headers of the package, as fast as they can: for test_handover.py. With
 * HAMMER_MAIN it is a program: for tools/sanitize. */
#define _GNU_SOURCE
#include <pthread.h>
#include <sched.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include "packet_ring.h"
#include "pointer_handover.h"
#include "trigger.h"
#include "triple_buffer.h"

#define WORDS 100

typedef struct {
    cat_triple triple;
    uint64_t slots[3][WORDS];
    uint32_t stop;
} triple_work;

static void *write_vectors(void *argument) {
    triple_work *w = argument;
    for (uint64_t n = 1; !cat_load_acquire32(&w->stop); n++) {
        for (int i = 0; i < WORDS; i++) w->slots[w->triple.back][i] = n;
        cat_triple_publish(&w->triple);
        if (n % 32 == 0) sched_yield();  /* where there is one CPU */
    }
    return 0;
}

/* Until the reader has taken `count` vectors. torn: with unequal words; backward: not newer. */
void hammer_triple(uint64_t count, uint64_t *torn, uint64_t *backward) {
    static triple_work w;
    pthread_t writer;
    uint64_t last = 0, seen = 0, idle = 0;
    memset(&w, 0, sizeof w);
    cat_triple_init(&w.triple);
    *torn = *backward = 0;
    pthread_create(&writer, 0, write_vectors, &w);
    while (seen < count) {
        if (!cat_triple_take(&w.triple)) {
            if (++idle % 1000 == 0) sched_yield();
            continue;
        }
        const uint64_t *slot = w.slots[w.triple.front];
        uint64_t first = slot[0];
        for (int i = 1; i < WORDS; i++) {
            if (slot[i] != first) {
                ++*torn;
                break;
            }
        }
        if (first <= last) ++*backward;
        last = first;
        seen++;
    }
    cat_store_release32(&w.stop, 1);
    pthread_join(writer, 0);
}

static cat_packet_ring ring;
static uint64_t packets;

static void *push_packets(void *argument) {
    uint8_t bytes[CAT_FRAME_MAX];
    (void)argument;
    for (uint64_t n = 0; n < packets;) {
        uint32_t length = 8 + n % 200;
        memset(bytes, (int)(n & 0xFF), length);
        memcpy(bytes, &n, 8);
        if (cat_ring_push(&ring, bytes, length, (int64_t)n) == 0) n++;
        else sched_yield();
    }
    return 0;
}

/* How many packets came out of order, with another length or other bytes than went in. */
uint64_t hammer_ring(uint64_t count) {
    pthread_t producer;
    uint64_t wrong = 0, number;
    memset(&ring, 0, sizeof ring);
    packets = count;
    pthread_create(&producer, 0, push_packets, 0);
    for (uint64_t n = 0; n < count;) {
        const cat_packet *packet = cat_ring_peek(&ring);
        if (!packet) {
            sched_yield();
            continue;
        }
        memcpy(&number, packet->bytes, 8);
        int good = number == n && packet->stamp == (int64_t)n && packet->length == 8 + n % 200;
        for (uint32_t i = 8; good && i < packet->length; i++) good = packet->bytes[i] == (n & 0xFF);
        wrong += !good;
        cat_ring_drop(&ring);
        n++;
    }
    pthread_join(producer, 0);
    return wrong;
}

/* One owner, one user: requests by `take`, or objects by `claim`. A freed object is overwritten. */
#define OBJECTS 64
#define ALIVE 0x5AFE5AFE5AFE5AFEu

typedef struct {
    uint64_t alive;
    uint64_t number;
    uint64_t copy;                    /* of `number`: a torn object has another one */
} object;

typedef struct {
    cat_pointer pointer;
    object objects[OBJECTS];
    int requests;                     /* 1: take; 0: claim */
    uint32_t stop;
    uint64_t served, wrong, backward;
} pointer_work;

static void serve(pointer_work *w, const object *o, uint64_t *last) {
    if (o->alive != ALIVE || o->number != o->copy) w->wrong++;
    if (w->requests ? o->number <= *last : o->number < *last) w->backward++;
    *last = o->number;
    cat_store_release64(&w->served, w->served + 1);
}

static void *use_pointers(void *argument) {
    pointer_work *w = argument;
    uint64_t last = 0, turn = 0;
    while (!cat_load_acquire32(&w->stop)) {
        void *pointer = 0;
        if (w->requests) cat_pointer_take(&w->pointer, &pointer);
        else pointer = cat_pointer_claim(&w->pointer);
        if (pointer) serve(w, pointer, &last);
        cat_pointer_release(&w->pointer);
        if (++turn % 16 == 0) sched_yield();
    }
    return 0;
}

static object *unused_object(pointer_work *w) {
    for (;;) {
        for (int i = 0; i < OBJECTS; i++)
            if (!cat_pointer_is_used(&w->pointer, &w->objects[i])) return &w->objects[i];
        sched_yield();
    }
}

static int64_t monotonic(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}

#define POINTER_NS 20000000000LL

/* Offer objects until `count` were served, or for at most 20 s: on a busy machine, each hand-over
 * waits for a switch of threads. A place is overwritten as soon as it counts as unused.
 * wrong: an object that was overwritten meanwhile; backward: an older one, or a request twice.
 * Return the number of objects served. */
uint64_t hammer_pointer(uint64_t count, int requests, uint64_t *wrong, uint64_t *backward) {
    static pointer_work w;
    pthread_t user;
    memset(&w, 0, sizeof w);
    w.requests = requests;
    const int64_t end = monotonic() + POINTER_NS;
    pthread_create(&user, 0, use_pointers, &w);
    for (uint64_t n = 1; cat_load_acquire64(&w.served) < count && monotonic() < end; n++) {
        object *o = unused_object(&w);
        o->alive = 0;
        o->number = o->copy = n;
        o->alive = ALIVE;
        cat_pointer_offer(&w.pointer, o);
        if (n % 8 == 0) cat_pointer_offer(&w.pointer, requests ? CAT_POINTER_NONE : 0);
        if (n % 32 == 0) sched_yield();
    }
    cat_store_release32(&w.stop, 1);
    pthread_join(user, 0);
    *wrong = w.wrong;
    *backward = w.backward;
    return w.served;
}

/* Triggers: the sender sends as soon as the receiver has processed the previous one, while the
 * receiver is about to sleep. A lost wake-up lasts until the deadline. */
#define TRIGGER_NS 500000000LL

typedef struct {
    cat_trigger trigger;
    uint64_t processed;
    uint64_t count;
} trigger_work;

static void *send_triggers(void *argument) {
    trigger_work *w = argument;
    for (uint64_t n = 1; n <= w->count; n++) {
        cat_trigger_send(&w->trigger, (int64_t)n, 1000);
        while (cat_load_acquire64(&w->processed) < n) sched_yield();
    }
    return 0;
}

/* Return the number of triggers that were not received in time, or with a wrong cycle start. */
uint64_t hammer_trigger(uint64_t count) {
    static trigger_work w;
    pthread_t sender;
    uint64_t wrong = 0;
    memset(&w, 0, sizeof w);
    w.count = count;
    pthread_create(&sender, 0, send_triggers, &w);
    for (uint32_t n = 0; n < count; n++) {
        int rc = cat_trigger_wait(&w.trigger, n, 0, monotonic() + TRIGGER_NS);
        while (rc == -EINTR) rc = cat_trigger_wait(&w.trigger, n, 0, monotonic() + TRIGGER_NS);
        if (rc != 1 || cat_load_relaxed64(&w.trigger.scheduled) != n + 1) wrong++;
        while (cat_load_acquire32(&w.trigger.tick) == n) sched_yield();
        cat_store_release64(&w.processed, n + 1);
    }
    pthread_join(sender, 0);
    return wrong;
}

#ifdef HAMMER_MAIN
#include <stdio.h>
#include "law.h"
#include "ring.h"

/* The rows of a share: a writer, and a reader that never keeps it waiting. */
#define ROW_WORDS 40
#define ROWS 4

static ring_view view;
static uint64_t rows;

static void *write_rows(void *argument) {
    uint64_t row[ROW_WORDS];
    (void)argument;
    for (uint64_t n = 1; n <= rows; n++) {
        for (int i = 0; i < ROW_WORDS; i++) row[i] = n;
        cat_copy_to_shared(ring_begin(&view, n), row, sizeof row);
        ring_publish(&view, n);
        if (n % 32 == 0) sched_yield();
    }
    ring_end(&view);
    return 0;
}

/* How many rows were torn or older than the one before. */
static uint64_t hammer_rows(uint64_t count) {
    pthread_t writer;
    uint64_t row[ROW_WORDS], last = 0, wrong = 0;
    view = (ring_view){.count = ROWS, .size = sizeof row, .stride = ring_stride(sizeof row)};
    view.ring = aligned_alloc(64, (sizeof(share_ring) + ROWS * view.stride + 63) / 64 * 64);
    memset(view.ring, 0, sizeof(share_ring) + ROWS * view.stride);
    rows = count;
    pthread_create(&writer, 0, write_rows, 0);
    while (ring_wait(&view, last, INT64_MAX) == 1) {
        uint64_t number = ring_copy_newest(&view, (uint8_t *)row);
        for (int i = 0; i < ROW_WORDS; i++) wrong += row[i] != number;
        wrong += number <= last;
        last = number;
    }
    pthread_join(writer, 0);
    free(view.ring);
    return wrong;
}

/* Laws that return, and some that never do: the monitor gives them up. After one siglongjmp out of a
 * signal handler ThreadSanitizer delivers no further signal to that thread. */
#ifdef __SANITIZE_THREAD__
#define ENDLESS_STEPS 1
#else
#define ENDLESS_STEPS 3
#endif

static int short_step(const void *a, void *t, double *m, int64_t n, const double *p, int64_t k,
                      double time) {
    (void)a, (void)t, (void)n, (void)p, (void)k, (void)time;
    m[0] += 1;
    return CAT_LAW_GOES_ON;
}

static int endless_step(const void *a, void *t, double *m, int64_t n, const double *p, int64_t k,
                        double time) {
    (void)a, (void)t, (void)m, (void)n, (void)p, (void)k, (void)time;
    for (volatile uint32_t i = 0;; i++)
        if (i % 100000 == 0) usleep(1); /* ThreadSanitizer delivers signals in such calls only */
    return CAT_LAW_FINISHED;
}

#define PAUSES 200                   /* in which the monitor is parked */

static uint64_t run_short_steps(cat_law_monitor *monitor, const cat_law_numbers *numbers) {
    uint64_t wrong = 0;
    for (int pause = 0; pause < PAUSES; pause++) {
        cat_law_monitor_activate(monitor, 20000000);
        for (int n = 0; n < 100; n++)
            wrong += cat_law_call(&monitor->guard, short_step, 0, 0, numbers, 0) != CAT_LAW_GOES_ON;
        cat_law_monitor_park(monitor);
        if (pause % 20 == 0) usleep(6000); /* longer than a check: it sleeps */
    }
    return wrong;
}

static void *run_laws(void *argument) {
    cat_law_monitor *monitor = argument;
    double memory[1] = {0};
    cat_law_numbers numbers = {memory, 1, 0, 0};
    uint64_t wrong = run_short_steps(monitor, &numbers);
    cat_law_monitor_activate(monitor, 20000000);
    for (int n = 0; n < ENDLESS_STEPS; n++)
        wrong += cat_law_call(&monitor->guard, endless_step, 0, 0, &numbers, 0) != CAT_LAW_ABORTED;
    cat_law_monitor_park(monitor);
    return (void *)(uintptr_t)wrong;
}

/* Two runners at once, as the cycle and a rehearsal: each has a monitor. */
static uint64_t hammer_laws(void) {
    static cat_law_monitor monitors[2];
    pthread_t runners[2];
    uint64_t sum = 0;
    for (int k = 0; k < 2; k++)
        if (cat_law_monitor_start(&monitors[k], 0)) return 1;
    for (int k = 0; k < 2; k++) pthread_create(&runners[k], 0, run_laws, &monitors[k]);
    for (int k = 0; k < 2; k++) {
        void *wrong;
        pthread_join(runners[k], &wrong);
        sum += (uintptr_t)wrong;
        cat_law_monitor_stop(&monitors[k]);
    }
    return sum;
}

static int report(const char *what, uint64_t wrong) {
    printf("%s: %s\n", what, wrong ? "wrong" : "good");
    fflush(stdout);
    return wrong != 0;
}

int main(void) {
    uint64_t first, second;
    int failures = 0;
    hammer_triple(200000, &first, &second);
    failures += report("triple buffer", first + second);
    failures += report("packet ring (acyclic queue)", hammer_ring(200000));
    hammer_pointer(200000, 0, &first, &second);
    failures += report("pointer (stream)", first + second);
    hammer_pointer(200000, 1, &first, &second);
    failures += report("pointer (law)", first + second);
    failures += report("trigger", hammer_trigger(50000));
    failures += report("rows of a share", hammer_rows(200000));
    failures += report("law monitors", hammer_laws());
    return failures ? 1 : 0;
}
#endif
