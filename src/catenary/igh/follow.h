/* Distributed clocks over libethercat: what the master is told each cycle, how far apart clocks are,
 * and a loop that follows the reference clock. */
#ifndef CATENARY_IGH_FOLLOW_H
#define CATENARY_IGH_FOLLOW_H

#include <stdint.h>
#include <stdlib.h>

#include "exchange_memory.h"

#define IGH_SILENT 16u                /* misses in a row: the reference clock is not there */
#define IGH_SILENT_EVERY 1024u        /* cycles between two questions to one that is not */

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

/* Whether the clocks' datagrams are back: with everything, or with any frame where a device need not
 * answer, or does not any more. Before OP that may be before the master has set them. */
static int igh_clocks_are_back(const igh_exchange *x, uint32_t missing)
{
    return missing == 0 || (x->heard && (x->clock_reads > 0 || x->al_status == IGH_OP));
}

static void igh_attend_clocks(igh_exchange *x)
{
    uint32_t time;
    x->attended = 1;
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

#endif
