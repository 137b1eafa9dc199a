/* Distributed clocks over libethercat: what each cycle passes to the master, the difference of the
 * clocks, and a loop that follows the reference clock.
 *
 * The phase error is what the reference clock says to a frame, less our clock when the frame left,
 * modulo the period. Whole periods mean nothing: SYNC0 comes once a period, and the master leaves a
 * clock alone that is less than 1 ms off (EC_SYSTEM_TIME_TOLERANCE_NS in IgH's master/fsm_master.c).
 * IgH's and SOEM's examples normalise, too (update_master_clock in examples/rtai_rtdm_dc/main.c of
 * the former, ec_sync in samples/ec_sample/ec_sample.c of the latter).
 *
 * A frame that was late says little about the clocks, so all of this goes by medians of five.
 */
#ifndef CATENARY_IGH_FOLLOW_H
#define CATENARY_IGH_FOLLOW_H

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "exchange_memory.h"

#define IGH_SILENT 16u                /* misses in a row: the reference clock is not there */
#define IGH_SILENT_EVERY 1024u        /* cycles between two questions to one that is not */
#define IGH_STRAYS 8u                 /* errors beyond an eighth of a period in a row: a jump */
#define IGH_SEEK_SHARE 16             /* of the period: largest move of a cycle before OP */
#define IGH_SEEK_GAIN 8               /* of the error: move of a cycle before OP */

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

/* The remainder of a time in (-period / 2, period / 2]. */
static int64_t igh_modulo(int64_t time, int64_t period)
{
    int64_t rest = time % period;
    if (2 * rest > period)
        return rest - period;
    return 2 * rest <= -period ? rest + period : rest;
}

/* Adds a reading and returns the median of the last five; of the first one while there are fewer. */
static int64_t igh_median(igh_readings *r, int64_t reading)
{
    int64_t sorted[IGH_READINGS];
    uint32_t k, m;
    for (k = 0; r->count == 0 && k < IGH_READINGS; k++)
        r->last[k] = reading;
    r->last[r->count++ % IGH_READINGS] = reading;
    for (k = 0; k < IGH_READINGS; k++) {
        for (m = k; m > 0 && sorted[m - 1] > r->last[k]; m--)
            sorted[m] = sorted[m - 1];
        sorted[m] = r->last[k];
    }
    return sorted[IGH_READINGS / 2];
}

/* What all devices together say of their difference (a broadcast of 0x092C: the OR of all, at least
 * the largest, less than twice that). */
static void igh_note_spread(igh_exchange *x)
{
    int64_t spread = igh_median(&x->spreads, x->monitored);
    x->spread = spread;
    x->worst_spread = igh_larger(x->worst_spread, spread);
    x->mean_spread = x->spread_reads ? x->mean_spread + ((double)spread - x->mean_spread) / 16
                                     : (double)spread;
    x->spread_reads++;
}

/* Together: differences, and where the instants follow their phase, within the bound. Where the
 * reference follows, its own difference is among those of all devices. */
static void igh_judge_clocks(igh_exchange *x)
{
    int in_phase = x->clock == IGH_FOLLOW_MAIN
                   || (x->clock_reads >= 16 && llabs((int64_t)x->mean_error) <= x->bound);
    int locked = in_phase && x->spread_reads >= 16 && x->mean_spread <= (double)x->bound
                 && x->silent < IGH_SILENT && x->unheard < IGH_SILENT;
    x->changes += locked != x->locked;
    x->locked = (uint8_t)locked;
}

/* Before any device is in OP: quick, for the master leaves the clocks in some phase and starts SYNC0
 * by it. Slow enough for answers that come two cycles later, after a median of five. */
static int64_t igh_sought(const igh_exchange *x)
{
    double limit = (double)x->period / IGH_SEEK_SHARE;
    return (int64_t)igh_limited((double)x->phase_error / IGH_SEEK_GAIN, limit);
}

/* Our clock runs after the reference, by a critically damped loop of which neither the rate nor the
 * correction of one period leaves the limit. No wind-up: at the limit the rate learns nothing further
 * outwards. Nor from an error beyond an eighth of the period, and only one that lasts is corrected. */
static void igh_follow(igh_exchange *x)
{
    double error = (double)x->phase_error, wanted, applied;
    int far = 8 * llabs(x->phase_error) > x->period;
    if (!(x->al_status & IGH_OP)) {
        x->time->offset += igh_sought(x);
        return;
    }
    if (far && x->strays < IGH_STRAYS)
        error = 0;
    wanted = x->rate + 2 * x->bandwidth * error;
    applied = igh_limited(wanted, x->rate_limit);
    if (!far && (applied == wanted || (wanted > 0) != (error > 0)))
        x->rate = igh_limited(x->rate + x->bandwidth * x->bandwidth * error, x->rate_limit);
    x->time->offset += (int64_t)applied;
}

/* Errors beyond an eighth of the period, in a row: where they last, the clock has jumped. */
static void igh_count_strays(igh_exchange *x)
{
    if (8 * llabs(x->phase_error) <= x->period)
        x->strays = 0;
    else if (x->strays < IGH_STRAYS && ++x->strays == IGH_STRAYS && x->al_status & IGH_OP)
        x->jumps++;
}

/* The reference clock's time came back: 32 bits of it. */
static void igh_note_reference(igh_exchange *x, uint32_t time)
{
    x->ahead = (int32_t)(time - (uint32_t)(x->sent + x->epoch));
    x->phase_error = igh_median(&x->errors, igh_modulo(x->ahead, x->period));
    x->mean_error = x->clock_reads ? x->mean_error + ((double)x->phase_error - x->mean_error) / 16
                                   : (double)x->phase_error;
    x->worst_error = igh_larger(x->worst_error, x->phase_error);
    x->clock_reads++;
    x->silent = 0;
    igh_count_strays(x);
}

/* The clocks' datagrams are back. */
static void igh_attend_clocks(igh_exchange *x)
{
    uint32_t time;
    x->attended = 1;
    x->unheard = 0;
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

/* Once they are back; else it counts, once for each emit. */
static void igh_watch_clocks(igh_exchange *x, int first)
{
    if (x->heard && !x->attended)
        igh_attend_clocks(x);
    if (x->heard || !first)
        return;
    x->clock_misses++;
    x->unheard++;
    igh_judge_clocks(x);
}

#endif
