/* One cycle of process images over libethercat, and the time it lives by.
 *
 * emit:    outputs into the domains, application time, clocks, queue, send
 * collect: receive, process and state of every domain that was queued; inputs out of the domains
 *
 * Everything that is called here may be called from a real-time thread (ecrt.h says so of each).
 * Budget without the calls: 0.1 us for three drives in one domain.
 */
#ifndef CATENARY_IGH_EXCHANGE_H
#define CATENARY_IGH_EXCHANGE_H

#include <errno.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "image.h"
#include "link.h"

#define IGH_OP 8                      /* al_states of ec_master_state_t: all in OP */
#define IGH_COMPLETE 2u               /* wc_state of ec_domain_state_t */
#define IGH_NAP_NS 20000              /* between two looks for what has not come back */
#define IGH_PATIENCE_FIRST_NS 50000
#define IGH_PATIENCE_DECAY 14         /* of patience, a cycle: 2^-14 */
#define IGH_SILENT 16u                /* misses in a row: the reference clock is not there */
#define IGH_SILENT_EVERY 1024u        /* cycles between two questions to one that is not */
#define IGH_MISSED_MAX 1000000000u

/* The calls of a cycle. Those that return nothing before 1.6.0 have two shapes. */
typedef union { void (*says_nothing)(void *); int (*says)(void *); } igh_call;
typedef union { void (*says_nothing)(void *, uint64_t); int (*says)(void *, uint64_t); } igh_call_time;
typedef union { void (*says_nothing)(void *, void *); int (*says)(void *, void *); } igh_call_state;

typedef struct igh_calls {
    int returns;                      /* whether they return something: never read it otherwise */
    igh_call receive, send, process, queue, sync_reference_clock, sync_slave_clocks;
    igh_call_time application_time, sync_reference_clock_to;
    igh_call_state domain_state, master_state;
    int (*reference_clock_time)(void *, uint32_t *);
    igh_call monitor_queue;
    uint32_t (*monitor_process)(void *);
} igh_calls;

static inline int igh_do(const igh_calls *calls, igh_call call, void *who)
{
    if (calls->returns)
        return call.says(who);
    call.says_nothing(who);
    return 0;
}

static inline void igh_tell(const igh_calls *calls, igh_call_time call, void *who, uint64_t time)
{
    if (calls->returns)
        call.says(who, time);
    else
        call.says_nothing(who, time);
}

static inline void igh_state(const igh_calls *calls, igh_call_state call, void *who, void *state)
{
    if (calls->returns)
        call.says(who, state);
    else
        call.says_nothing(who, state);
}

typedef struct { uint32_t counter, state, redundancy; } igh_domain_state;
typedef struct { uint32_t responding, bits; } igh_master_state;

typedef struct igh_copy { uint32_t domain_offset, image_offset, size; } igh_copy;

typedef struct igh_unit {             /* a sync unit: one domain */
    void *domain;
    uint8_t *data;
    uint32_t first_output, output_count, first_input, input_count;   /* in the list of copies */
    uint32_t every, phase;
    uint8_t optional, queued, back;
} igh_unit;

enum { IGH_NO_CLOCK, IGH_FOLLOW_REFERENCE, IGH_FOLLOW_MAIN };

/* The clock of the loop: CLOCK_MONOTONIC, or virtual time; where it follows the reference clock it
 * is CLOCK_MONOTONIC moved by `offset`, never faster or slower than by `rate_limit` of itself. */
typedef struct igh_time {
    cat_link link;
    int is_virtual;
    int64_t virtual_now;
    int64_t offset;
} igh_time;

typedef struct igh_exchange {
    cat_image image;
    igh_time *time;
    igh_calls calls;
    void *master;
    igh_unit *units;
    igh_copy *copies;
    uint8_t *outputs, *inputs, *unit_valid, *unit_fresh;
    uint32_t *unit_missed;
    uint16_t *unit_counter;
    uint8_t ok, whole, al_status, link_up, redundancy;
    uint16_t al_counter;
    int64_t frame_stamp;

    uint32_t serial;                  /* of the emit */
    uint8_t collected;                /* everything that was sent is back and judged */
    uint8_t judged;                   /* misses of this emit have been counted */
    int64_t sent, patience;           /* when; how long answers take, as found [ns] */

    int clock;                        /* IGH_NO_CLOCK ... */
    int64_t period, epoch;
    int64_t app_time, app_seen;       /* told last [ns, link clock]; `now` of then */
    double rate, rate_limit, bandwidth;
    int64_t phase_error;              /* reference less application time, of the last cycle [ns] */
    uint64_t clock_reads, clock_misses, send_errors, receive_errors;

    int64_t bound;                    /* of phase and differences, for `locked` [ns] */
    double mean_error, mean_spread;   /* over some 16 cycles [ns] */
    int64_t worst_error, spread, worst_spread;
    uint64_t spread_reads, silent, jumps, changes;   /* silent: misses in a row */
    uint8_t locked;
} igh_exchange;

/* ---- time */

static int64_t igh_monotonic(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static int64_t igh_now(void *self)
{
    const igh_time *t = self;
    return (t->is_virtual ? t->virtual_now : igh_monotonic()) + t->offset;
}

static int igh_wait_until(void *self, int64_t deadline, int wake_on_frame)
{
    igh_time *t = self;
    struct timespec at;
    (void)wake_on_frame;
    deadline -= t->offset;
    if (t->is_virtual) {
        if (deadline > t->virtual_now)
            t->virtual_now = deadline;
        return 0;
    }
    if (deadline <= 0)
        return 0;
    at.tv_sec = deadline / 1000000000;
    at.tv_nsec = deadline % 1000000000;
    return -clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL);
}

static int igh_send_frame(void *self, const uint8_t *frame, uint32_t length)
{
    (void)self, (void)frame, (void)length;
    return -EOPNOTSUPP;
}

static int igh_receive_frame(void *self, const uint8_t **frame)
{
    (void)self, (void)frame;
    return 0;
}

static void igh_time_open(igh_time *t, int is_virtual)
{
    memset(t, 0, sizeof *t);
    t->is_virtual = is_virtual;
    t->virtual_now = 1000000000;
    t->link.version = CAT_LINK_VERSION;
    t->link.flags = is_virtual ? CAT_LINK_VIRTUAL_TIME : 0;
    t->link.self = t;
    t->link.send = igh_send_frame;
    t->link.receive = igh_receive_frame;
    t->link.now = igh_now;
    t->link.wait_until = igh_wait_until;
}

/* ---- clocks */

/* The application time goes on by whole periods, however late this thread is within one: the
 * master lets SYNC0 start by it. */
static void igh_advance(igh_exchange *x, int64_t now)
{
    int64_t ahead = x->app_time + x->period - now;
    if (x->serial == 1)
        x->app_time = now;
    else if (ahead > x->period / 2 || ahead < -x->period / 2)
        x->app_time += (1 - (ahead + (ahead > 0 ? x->period / 2 : -x->period / 2)) / x->period)
                       * x->period;
    else
        x->app_time += x->period;
}

static void igh_tell_clocks(igh_exchange *x)
{
    const igh_calls *calls = &x->calls;
    igh_advance(x, igh_now(x->time));
    igh_tell(calls, calls->application_time, x->master, (uint64_t)(x->app_time + x->epoch));
    if (x->clock == IGH_FOLLOW_MAIN) {
        if (calls->sync_reference_clock_to.says)
            igh_tell(calls, calls->sync_reference_clock_to, x->master,
                     (uint64_t)(igh_now(x->time) + x->epoch));
        else
            igh_do(calls, calls->sync_reference_clock, x->master);
    }
    igh_do(calls, calls->sync_slave_clocks, x->master);
    igh_do(calls, calls->monitor_queue, x->master);
}

static double igh_limited(double value, double limit)
{
    return value > limit ? limit : value < -limit ? -limit : value;
}

/* Whether the reference clock's time is to be asked for: libethercat complains on stderr of every
 * question that has no answer, so a clock that stays silent is asked now and then. */
static int igh_asks_reference(const igh_exchange *x)
{
    return x->silent < IGH_SILENT || x->serial % IGH_SILENT_EVERY == 0;
}

static int64_t igh_larger(int64_t a, int64_t b)
{
    return llabs(a) > llabs(b) ? a : b;
}

/* What all devices together say of their difference (a broadcast of 0x092C: the OR of all, at least
 * the largest, less than twice that). All ones: not back. */
static void igh_note_spread(igh_exchange *x)
{
    uint32_t spread = x->calls.monitor_process(x->master);
    if (spread == UINT32_MAX)
        return;
    x->spread = spread;
    x->worst_spread = igh_larger(x->worst_spread, spread);
    x->mean_spread = x->spread_reads ? x->mean_spread + (spread - x->mean_spread) / 16 : spread;
    x->spread_reads++;
}

/* Together: differences, and where the instants follow their phase, within the bound. Where the
 * reference follows, its own difference is among those of all devices. */
static void igh_judge_clocks(igh_exchange *x)
{
    int in_phase = x->clock == IGH_FOLLOW_MAIN
                   || (x->clock_reads >= 16 && llabs((int64_t)x->mean_error) <= x->bound);
    int locked = in_phase && x->spread_reads >= 16 && x->mean_spread <= (double)x->bound
                 && x->silent < IGH_SILENT;
    x->changes += locked != x->locked;
    x->locked = (uint8_t)locked;
}

/* Our clock runs after the reference, by a critically damped loop of which neither the rate nor the
 * correction of one period leaves the limit.
 * An error beyond an eighth of the period is no drift: the master has not set the clocks yet, which
 * it has done by OP; after that it is gone after, as fast as the limit lets, and nothing learnt. */
static void igh_follow(igh_exchange *x)
{
    double error = (double)x->phase_error, correction;
    if (8 * llabs(x->phase_error) <= x->period) {
        x->rate += x->bandwidth * x->bandwidth * error;
        x->rate = igh_limited(x->rate, x->rate_limit);
    } else if (x->al_status != IGH_OP) {
        return;
    }
    correction = igh_limited(x->rate + 2 * x->bandwidth * error, x->rate_limit);
    x->time->offset += (int64_t)correction;
}

/* The reference clock's time came back: 32 bits of it. */
static void igh_note_reference(igh_exchange *x, uint32_t time)
{
    x->phase_error = (int32_t)(time - (uint32_t)(x->app_time + x->epoch));
    x->mean_error = x->clock_reads ? x->mean_error + ((double)x->phase_error - x->mean_error) / 16
                                   : (double)x->phase_error;
    x->worst_error = igh_larger(x->worst_error, x->phase_error);
    x->clock_reads++;
    x->silent = 0;
    if (8 * llabs(x->phase_error) > x->period && x->al_status == IGH_OP)
        x->jumps++;
}

static void igh_attend_clocks(igh_exchange *x)
{
    uint32_t time;
    igh_note_spread(x);
    if (igh_asks_reference(x)) {
        if (x->calls.reference_clock_time(x->master, &time) < 0) {
            x->clock_misses++;
            x->silent++;
        } else {
            igh_note_reference(x, time);
            if (x->clock == IGH_FOLLOW_REFERENCE)
                igh_follow(x);
        }
    }
    igh_judge_clocks(x);
}

/* ---- the image table */

static int igh_emit(void *self)
{
    igh_exchange *x = self;
    uint32_t u, k;
    int rc;
    x->serial++;
    if (x->serial == 0)
        x->serial = 2;
    for (u = 0; u < x->image.unit_count; u++) {
        igh_unit *unit = &x->units[u];
        unit->back = 0;
        unit->queued = unit->every == 1 || x->serial % unit->every == unit->phase;
        if (!unit->queued)
            continue;
        for (k = unit->first_output; k < unit->first_output + unit->output_count; k++)
            memcpy(unit->data + x->copies[k].domain_offset,
                   x->outputs + x->copies[k].image_offset, x->copies[k].size);
    }
    if (x->clock != IGH_NO_CLOCK)
        igh_tell_clocks(x);
    for (u = 0; u < x->image.unit_count; u++)
        if (x->units[u].queued)
            igh_do(&x->calls, x->calls.queue, x->units[u].domain);
    rc = igh_do(&x->calls, x->calls.send, x->master);
    if (rc < 0)
        x->send_errors++;
    x->sent = igh_now(x->time);
    x->collected = x->judged = 0;
    return rc < 0 ? rc : 0;
}

/* What has come back of the domains that were queued: how many have not. */
static uint32_t igh_look(igh_exchange *x)
{
    igh_domain_state state;
    uint32_t u, missing = 0;
    x->redundancy = 0;
    if (igh_do(&x->calls, x->calls.receive, x->master) < 0)
        x->receive_errors++;
    x->frame_stamp = igh_now(x->time);
    for (u = 0; u < x->image.unit_count; u++) {
        igh_unit *unit = &x->units[u];
        if (!unit->queued || unit->back)
            continue;
        igh_do(&x->calls, x->calls.process, unit->domain);
        memset(&state, 0, sizeof state);
        igh_state(&x->calls, x->calls.domain_state, unit->domain, &state);
        unit->back = state.state == IGH_COMPLETE;
        x->unit_counter[u] = (uint16_t)state.counter;
        x->redundancy |= state.redundancy != 0;
        missing += !unit->back;
    }
    return missing;
}

static void igh_judge_unit(igh_exchange *x, uint32_t u)
{
    igh_unit *unit = &x->units[u];
    uint32_t k;
    x->unit_valid[u] = unit->back;
    x->unit_fresh[u] = unit->back;
    if (!unit->back) {
        if (!x->judged && x->unit_missed[u] < IGH_MISSED_MAX)
            x->unit_missed[u]++;
        if (!unit->optional)
            x->ok = 0;
        return;
    }
    x->unit_missed[u] = 0;
    for (k = unit->first_input; k < unit->first_input + unit->input_count; k++)
        memcpy(x->inputs + x->copies[k].image_offset,
               unit->data + x->copies[k].domain_offset, x->copies[k].size);
}

static void igh_judge(igh_exchange *x)
{
    igh_master_state state = {0, 0};
    uint32_t u;
    x->ok = x->whole = 1;
    for (u = 0; u < x->image.unit_count; u++) {
        x->unit_fresh[u] = 0;
        if (x->units[u].queued)
            igh_judge_unit(x, u);
        if (!x->unit_valid[u] && !x->units[u].optional)
            x->whole = 0;
    }
    x->judged = 1;
    igh_state(&x->calls, x->calls.master_state, x->master, &state);
    x->al_counter = (uint16_t)state.responding;
    if (state.responding > 0)
        x->al_status = state.bits & 0x0F;
    x->link_up = state.bits >> 4 & 1;
}

/* Threaded: naps as long as answers take, then looks now and then until the deadline. A look that
 * comes too early costs a line in the kernel's log ("working counter changes"): so one makes all
 * later naps longer by a step, and only thousands of good ones make them shorter. */
static int igh_collect(void *self, int64_t deadline)
{
    igh_exchange *x = self;
    int64_t look;
    uint32_t missing;
    if (x->collected || x->serial == 0)
        return 0;
    if (deadline != 0) {
        look = x->sent + x->patience;
        igh_wait_until(x->time, look < deadline ? look : deadline, 0);
    }
    missing = igh_look(x);
    if (deadline != 0 && missing == 0)
        x->patience -= x->patience >> IGH_PATIENCE_DECAY;
    while (missing > 0 && igh_now(x->time) < deadline) {
        look = igh_now(x->time) + IGH_NAP_NS;
        igh_wait_until(x->time, look < deadline ? look : deadline, 0);
        missing = igh_look(x);
        if (missing == 0 && x->patience < x->frame_stamp - x->sent)
            x->patience += IGH_NAP_NS;
    }
    igh_judge(x);
    if (x->clock != IGH_NO_CLOCK && !x->collected && missing == 0)
        igh_attend_clocks(x);
    x->collected = missing == 0;
    return (int)missing;
}

static void igh_drain(void *self)
{
    (void)self;                       /* the master takes frames when it is asked to receive */
}

static int igh_closed_emit(void *self)
{
    (void)self;
    return -EBADF;
}

static int igh_closed_collect(void *self, int64_t deadline)
{
    (void)self, (void)deadline;
    return -EBADF;
}

/* The master's handles are gone: whoever still holds the table gets -EBADF. */
static void igh_exchange_end(igh_exchange *x)
{
    x->image.emit = igh_closed_emit;
    x->image.collect = igh_closed_collect;
}

static void igh_exchange_close(igh_exchange *x)
{
    free(x->units);
    free(x->copies);
    free(x->outputs);
    free(x->inputs);
    free(x->unit_valid);
    free(x->unit_fresh);
    free(x->unit_missed);
    free(x->unit_counter);
}

static int igh_exchange_open(igh_exchange *x, uint32_t units, uint32_t copies, uint32_t output_size,
                             uint32_t input_size, uint32_t padding)
{
    x->units = calloc(units + 1, sizeof *x->units);
    x->copies = calloc(copies + 1, sizeof *x->copies);
    x->outputs = calloc(output_size + padding, 1);
    x->inputs = calloc(input_size + padding, 1);
    x->unit_valid = calloc(units + 1, 1);
    x->unit_fresh = calloc(units + 1, 1);
    x->unit_missed = calloc(units + 1, sizeof *x->unit_missed);
    x->unit_counter = calloc(units + 1, sizeof *x->unit_counter);
    if (!x->units || !x->copies || !x->outputs || !x->inputs || !x->unit_valid || !x->unit_fresh
        || !x->unit_missed || !x->unit_counter)
        return -ENOMEM;
    x->patience = IGH_PATIENCE_FIRST_NS;
    x->image.version = CAT_IMAGE_VERSION;
    x->image.unit_count = units;
    x->image.output_size = output_size;
    x->image.input_size = input_size;
    x->image.self = x;
    x->image.outputs = x->outputs;
    x->image.inputs = x->inputs;
    x->image.unit_valid = x->unit_valid;
    x->image.unit_fresh = x->unit_fresh;
    x->image.unit_missed = x->unit_missed;
    x->image.unit_counter = x->unit_counter;
    x->image.ok = &x->ok;
    x->image.whole = &x->whole;
    x->image.al_status = &x->al_status;
    x->image.al_counter = &x->al_counter;
    x->image.frame_stamp = &x->frame_stamp;
    x->image.emit = igh_emit;
    x->image.collect = igh_collect;
    x->image.drain = igh_drain;
    x->image.rehearse = NULL;
    return 0;
}

#endif
