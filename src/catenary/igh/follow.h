/* Distributed clocks over libethercat: the times passed to the master in each cycle, the differences
 * of the clocks, and a control loop that follows the reference clock.
 *
 * The phase error is the reference time read by a frame minus our clock when the frame was sent,
 * modulo the period. Whole periods have no meaning: SYNC0 fires once a period, and the master does
 * not correct a clock offset below 1 ms (EC_SYSTEM_TIME_TOLERANCE_NS in IgH's master/fsm_master.c).
 * The examples of IgH and SOEM also normalise (update_master_clock in examples/rtai_rtdm_dc/main.c
 * of IgH, ec_sync in samples/ec_sample/ec_sample.c of SOEM).
 *
 * A late frame does not measure the clocks, so all values are medians of five readings.
 */
#ifndef CATENARY_IGH_FOLLOW_H
#define CATENARY_IGH_FOLLOW_H

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "exchange_memory.h"

#define IGH_SILENT 16u                /* consecutive misses: the reference clock is lost */
#define IGH_SILENT_EVERY 1024u        /* cycles between two reads of a lost reference clock */
#define IGH_STRAYS 8u                 /* consecutive errors above an eighth of a period: a jump */
#define IGH_SEEK_SHARE 16             /* before OP: largest correction per cycle is period / 16 */
#define IGH_SEEK_GAIN 8               /* before OP: correction per cycle is error / 8 */

/* Advance the application time by whole periods, even if this thread is late: the master computes
 * the start of SYNC0 from it. */
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

/* Return true if the reference time should be read in this cycle. libethercat prints an error on
 * stderr for every read without an answer, so a lost clock is read only every IGH_SILENT_EVERY. */
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

/* Add a reading and return the median of the last five. The first reading fills all five places. */
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

/* Record the OR of the differences of all devices, from a broadcast read of 0x092C. The OR is at
 * least the largest difference, and less than twice that. */
static void igh_note_spread(igh_exchange *x)
{
    int64_t spread = igh_median(&x->spreads, x->monitored);
    x->spread = spread;
    x->worst_spread = igh_larger(x->worst_spread, spread);
    x->mean_spread = x->spread_reads ? x->mean_spread + ((double)spread - x->mean_spread) / 16
                                     : (double)spread;
    x->spread_reads++;
}

/* Set `locked`: the differences are within the bound, and so is the phase error if the cycle starts
 * follow the reference clock. If the reference follows us, its difference is among the others. */
static void igh_judge_clocks(igh_exchange *x)
{
    int in_phase = x->clock == IGH_FOLLOW_MAIN
                   || (x->clock_reads >= 16 && llabs((int64_t)x->mean_error) <= x->bound);
    int locked = in_phase && x->spread_reads >= 16 && x->mean_spread <= (double)x->bound
                 && x->silent < IGH_SILENT && x->unheard < IGH_SILENT;
    x->changes += locked != x->locked;
    x->locked = (uint8_t)locked;
}

/* Return the correction before any device is in OP. It is fast, because the clocks start at an
 * arbitrary phase, which determines the start of SYNC0. It is slow enough for a delay of two cycles
 * and a median of five. */
static int64_t igh_sought(const igh_exchange *x)
{
    double limit = (double)x->period / IGH_SEEK_SHARE;
    return (int64_t)igh_limited((double)x->phase_error / IGH_SEEK_GAIN, limit);
}

/* Follow the reference clock with a critically damped loop. The rate and the correction per period
 * are limited. Anti-windup: at the limit, the rate integrates only inwards. An error above an eighth
 * of the period does not change the rate, and is corrected only if it persists (IGH_STRAYS). */
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

/* Count consecutive errors above an eighth of the period. If they persist, the clock has jumped. */
static void igh_count_strays(igh_exchange *x)
{
    if (8 * llabs(x->phase_error) <= x->period)
        x->strays = 0;
    else if (x->strays < IGH_STRAYS && ++x->strays == IGH_STRAYS && x->al_status & IGH_OP)
        x->jumps++;
}

/* Process a reading of the reference time (its lower 32 bits). */
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

/* Process the clock datagrams of this cycle, which are back. */
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

/* Process the clock datagrams when they are back. Otherwise count one miss for each emit. */
static void igh_watch_clocks(igh_exchange *x, int first)
{
    if (x->received && !x->attended)
        igh_attend_clocks(x);
    if (x->received || !first)
        return;
    x->clock_misses++;
    x->unheard++;
    igh_judge_clocks(x);
}

#endif
