/* A native thread that uses a link while another thread closes it: for test_interface.py. */
#include <pthread.h>
#include <stdint.h>
#include "atomics.h"
#include "link.h"

static cat_link *used;
static uint32_t stop;
static uint32_t running;
static pthread_t user;
static volatile uint32_t sum;

static void *use_link(void *argument) {
    const uint8_t *frame;
    (void)argument;
    cat_store_release32(&running, 1);
    while (!cat_load_acquire32(&stop)) {
        int length = __atomic_load_n(&used->receive, __ATOMIC_ACQUIRE)(used->self, &frame);
        for (int i = 0; i < length; i++) sum += frame[i];
        __atomic_load_n(&used->wait_until, __ATOMIC_ACQUIRE)(used->self, 0, 1);
    }
    return 0;
}

/* Returns when the thread runs. */
void use_begin(cat_link *link) {
    used = link;
    cat_store_release32(&stop, 0);
    cat_store_release32(&running, 0);
    pthread_create(&user, 0, use_link, 0);
    while (!cat_load_acquire32(&running)) {}
}

void use_end(void) {
    cat_store_release32(&stop, 1);
    pthread_join(user, 0);
}
