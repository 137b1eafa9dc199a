/* Reaction time of a thread that waits for an event, in C.
 *
 *     reaction eventfd|timerfd CPU PRIORITY COUNT PERIOD_NS FILE
 *
 * eventfd: another thread of lower priority writes the time as the value of the event. timerfd: the
 * kernel's timer expires at a known time. CPU -1: any. FILE receives one int64 [ns] per event. */
#include "machine.h"

#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/timerfd.h>
#include <unistd.h>

static int event;
static long count, period_ns;

static void *trigger(void *priority) {
    be_real_time(*(int *)priority - 10);
    int64_t instant = now_ns(CLOCK_MONOTONIC);
    for (long i = 0; i < count; i++) {
        wait_until(instant += period_ns);
        uint64_t now = (uint64_t)now_ns(CLOCK_MONOTONIC);
        if (write(event, &now, sizeof now) != sizeof now) break;
    }
    return NULL;
}

int main(int words, char **word) {
    if (words != 7) return 2;
    int by_timer = !strcmp(word[1], "timerfd"), cpu = atoi(word[2]), priority = atoi(word[3]);
    count = atol(word[4]);
    period_ns = atol(word[5]);
    int64_t *samples = calloc((size_t)count, sizeof *samples);
    if (!samples || count < 1 || period_ns < 1) return 2;
    memset(samples, 1, (size_t)count * sizeof *samples); /* touch the pages */
    stay_on(cpu);
    lock_memory();
    be_real_time(priority);
    pthread_t thread;
    int64_t expiry = now_ns(CLOCK_MONOTONIC);
    if (by_timer) {
        event = timerfd_create(CLOCK_MONOTONIC, 0);
        struct itimerspec t = {timespec_of(period_ns), timespec_of(expiry + period_ns)};
        if (timerfd_settime(event, TFD_TIMER_ABSTIME, &t, NULL)) { perror("timerfd"); return 1; }
    } else {
        event = eventfd(0, 0);
        if (pthread_create(&thread, NULL, trigger, &priority)) { perror("thread"); return 1; }
    }
    for (long i = 0; i < count; i++) {
        uint64_t value; /* time of the event, or number of expirations */
        if (read(event, &value, sizeof value) != sizeof value) { perror("read"); return 1; }
        int64_t now = now_ns(CLOCK_MONOTONIC);
        expiry += by_timer ? (int64_t)value * period_ns : 0;
        samples[i] = now - (by_timer ? expiry : (int64_t)value);
    }
    if (!by_timer) pthread_join(thread, NULL);
    FILE *file = fopen(word[6], "wb");
    if (!file || fwrite(samples, sizeof *samples, (size_t)count, file) != (size_t)count
        || fclose(file)) { perror(word[6]); return 1; }
    return 0;
}
