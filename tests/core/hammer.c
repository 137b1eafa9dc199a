/* Two threads on the real headers, as fast as they can: for test_handover.py and tools/sanitize. */
#include <pthread.h>
#include <sched.h>
#include <stdint.h>
#include <string.h>
#include "packet_ring.h"
#include "pointer_handover.h"
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

/* Offers objects until `count` were served; a place is overwritten as soon as it counts as unused.
 * wrong: an object that was overwritten meanwhile; backward: an older one, or a request twice. */
void hammer_pointer(uint64_t count, int requests, uint64_t *wrong, uint64_t *backward) {
    static pointer_work w;
    pthread_t user;
    memset(&w, 0, sizeof w);
    w.requests = requests;
    pthread_create(&user, 0, use_pointers, &w);
    for (uint64_t n = 1; cat_load_acquire64(&w.served) < count; n++) {
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
}
