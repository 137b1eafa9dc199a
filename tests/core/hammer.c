/* Two threads on the real headers, as fast as they can: for test_handover.py and test_lane.py. */
#include <pthread.h>
#include <sched.h>
#include <stdint.h>
#include <string.h>
#include "packet_ring.h"
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
