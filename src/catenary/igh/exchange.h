/* One cycle of process images over libethercat.
 *
 * emit:    copy outputs into the domains, write the application time, sync clocks, queue, send
 * collect: receive, process every queued domain and read its state, copy inputs from the domains
 *
 * If a domain is processed before its frame is back, the kernel logs a change of its working
 * counter (ecrt_domain_process in IgH's master/domain.c, at most once a second). To prevent this,
 * the monitor datagram (a broadcast of 16 bytes) is queued last if the loop waits for answers.
 * Checking for it is cheap. The domains are processed when it is back or at the deadline.
 *
 * Budget without the calls: 0.1 us for three drives in one domain.
 */
#ifndef CATENARY_IGH_EXCHANGE_H
#define CATENARY_IGH_EXCHANGE_H

#include <errno.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "ethercat.h"
#include "exchange_memory.h"
#include "follow.h"
#include "image.h"

#define IGH_COMPLETE 2u               /* wc_state of ec_domain_state_t */
#define IGH_NAP_NS 20000              /* between two checks for missing frames */
#define IGH_PATIENCE_FIRST_NS 50000
#define IGH_PATIENCE_DECAY 14         /* patience decreases by 2^-14 of itself per cycle */
#define IGH_GRACE 2                   /* wait for the backup interface: times the patience */
#define IGH_DEAF 16u                  /* complete cycles without a monitor: main interface is lost */
#define IGH_MISSED_MAX 1000000000u

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
        unit->queued = unit->divider == 1 || x->serial % unit->divider == unit->phase;
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
    x->marked = x->waits || x->clock != IGH_NO_CLOCK;
    if (x->marked)
        igh_do(&x->calls, x->calls.monitor_queue, x->master);
    x->sent = igh_now(x->time);
    rc = igh_do(&x->calls, x->calls.send, x->master);
    if (rc < 0)
        x->send_errors++;
    x->collected = x->judged = x->received = x->back = x->attended = 0;
    return rc < 0 ? rc : 0;
}

/* Receive the frames that have arrived. The monitor datagram uses the main interface only. If that
 * interface is lost, the domains of a ring return on the backup interface. The cycle then counts as
 * received at once, as it does without a monitor datagram. */
static void igh_receive(igh_exchange *x)
{
    if (igh_do(&x->calls, x->calls.receive, x->master) < 0)
        x->receive_errors++;
    x->frame_stamp = igh_now(x->time);
    if (x->marked && !x->received)
        x->monitored = x->calls.monitor_process(x->master);
    x->received = x->marked && x->monitored != UINT32_MAX;
    x->back = x->received || !x->marked || x->deaf >= IGH_DEAF;
}

/* Process the queued domains. Return the number of domains that are not complete. */
static uint32_t igh_process(igh_exchange *x)
{
    igh_domain_state state;
    uint32_t u, missing = 0;
    x->redundancy = 0;
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
        x->al_status = state.bits & CAT_AL_STATE;
    x->link_up = state.bits >> 4 & 1;
}

/* Threaded execution: sleep for the usual round trip (`patience`), then check every IGH_NAP_NS until
 * the frames are back. A first check that is too early increases patience by one step; a successful
 * first check decreases it by 2^-IGH_PATIENCE_DECAY. */
static void igh_wait_for_answers(igh_exchange *x, int64_t deadline)
{
    int64_t look = x->sent + x->patience;
    uint32_t looks = 0;
    do {
        igh_wait_until(x->time, look < deadline ? look : deadline, 0);
        igh_receive(x);
        look = x->frame_stamp + IGH_NAP_NS;
        looks++;
    } while (!x->back && x->frame_stamp < deadline);
    if (looks == 1 && x->received)
        x->patience -= x->patience >> IGH_PATIENCE_DECAY;
    else if (x->received && x->patience < x->frame_stamp - x->sent)
        x->patience += IGH_NAP_NS;
}

/* With a backup interface, some answers may arrive there after the monitor datagram. */
static uint32_t igh_wait_for_backup(igh_exchange *x, int64_t deadline, uint32_t missing)
{
    int64_t until = x->sent + IGH_GRACE * x->patience;
    while (missing > 0 && x->frame_stamp < deadline && x->frame_stamp < until) {
        igh_wait_until(x->time, x->frame_stamp + IGH_NAP_NS, 0);
        igh_receive(x);
        missing = igh_process(x);
    }
    return missing;
}

static int igh_collect(void *self, int64_t deadline)
{
    igh_exchange *x = self;
    uint32_t missing;
    int first = !x->judged;
    if (x->collected || x->serial == 0)
        return 0;
    x->waits |= deadline != 0;
    if (deadline != 0)
        igh_wait_for_answers(x, deadline);
    else
        igh_receive(x);
    missing = igh_process(x);
    if (deadline != 0)
        missing = igh_wait_for_backup(x, deadline, missing);
    igh_judge(x);
    if (x->received)
        x->deaf = 0;
    else if (first && missing == 0 && x->deaf < IGH_DEAF)
        x->deaf++;
    if (x->clock != IGH_NO_CLOCK)
        igh_watch_clocks(x, first);
    x->collected = missing == 0;
    return (int)missing;
}

static void igh_drain(void *self)
{
    (void)self;                       /* the master fetches frames in its receive call */
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

/* Invalidate the table: the master's handles are invalid, and later calls return -EBADF. */
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
    x->image.fill = NULL;
    return 0;
}

#endif
