/* Steps of a device's model and exchange of its process data: in its internal cycle ("free run"), at
 * SYNC0 pulses ("DC Sync0", ETG.1020 §0x1C32), or likewise at SYNC1 pulses ("DC Sync1").
 *
 * With SYNC0, the device latches its inputs and updates its outputs at the pulse. Its internal cycle
 * is a fraction of the SYNC0 cycle, and each pulse restarts it. If the pulses stop, the internal
 * cycle continues, half a step later than expected. The device detects the loss after more than
 * `limit` + 1 cycles without a pulse. */
#ifndef CATENARY_VIRTUAL_DEVICE_CYCLE_H
#define CATENARY_VIRTUAL_DEVICE_CYCLE_H

#include "process_data.h"
#include "servo.h"
#include "controller/sync_unit.h"

enum { CATCH_UP_STEPS = 4000 };       /* maximum number of steps to catch up after a clock jump */

static void model_axes(controller *c, int fresh) {
    for (int k = 0; k < c->axis_count; k++)
        servo_step(c, &c->axes[k], c->slots + k * AXIS_SLOTS, c->outputs_valid, fresh,
                   c->step_seconds, c->step_rate);
    c->slots_stale = 1;
    watchdog_trigger_pdi(c);
}

static inline void model_inputs(controller *c) {
    c->inputs_stale = 1;
    c->segment->inputs_stale = 1;
}

static inline void model_fault(controller *c, uint16_t code) {
    for (int k = 0; k < c->axis_count; k++)
        servo_fault(c, &c->axes[k], c->slots + k * AXIS_SLOTS, code);
}

static inline uint8_t *outputs_status(controller *c) { return sm_registers(c, c->outputs.sm) + 5; }

static inline void outputs_accept(controller *c) {
    uint8_t *status = outputs_status(c);
    *status = (uint8_t)((*status & ~SM_STATUS_WRITTEN) | SM_STATUS_READ);
    c->outputs_ns = c->segment->now;
    outputs_take(c);
}

/* Take one step of the internal cycle. */
static void model_step_free(controller *c) {
    int fresh = 0;
    if (c->outputs.sm >= 0 && c->outputs_valid) {
        fresh = (*outputs_status(c) & SM_STATUS_WRITTEN) != 0;
        if (fresh || !c->outputs_taken)
            outputs_accept(c);
    }
    c->outputs_taken = c->outputs_valid;
    model_axes(c, fresh);
    model_inputs(c);
}

/* If the pulses have stopped, set the sync error. If the outputs are valid, also set a fault on all axes
 * and raise EVENT_SYNC_LOST. */
static void pulses_lost(controller *c) {
    synchronous_cycle *d = &c->synchronous;
    if (!d->seen || c->segment->now - d->last <= (int64_t)(d->limit + 1) * d->cycle)
        return;
    d->seen = 0;
    d->error = 1;
    if (!c->outputs_valid)
        return;
    model_fault(c, ERROR_SYNCHRONISATION);
    raise_event(c, EVENT_SYNC_LOST);
}

/* Take one step between two pulses, or after the last pulse. */
static void model_step_between(controller *c) {
    synchronous_cycle *d = &c->synchronous;
    model_axes(c, 0);
    if (d->left >= 0)
        d->left--;
    if (d->left == 0)
        c->step_due += c->step_period / 2;                   /* the next pulse comes first */
    if (d->left >= 0)
        return;
    pulses_lost(c);
    if (!d->seen)
        model_inputs(c);
}

static void model_step(controller *c) {
    if (c->frozen)
        return;
    if (c->synchronous.active)
        model_step_between(c);
    else
        model_step_free(c);
}

/* Return 1 if new outputs have arrived since the last pulse, in time to be copied for this pulse. Count
 * outputs that are too late. */
static int outputs_in_time(controller *c) {
    synchronous_cycle *d = &c->synchronous;
    if (c->outputs.sm < 0 || !(*outputs_status(c) & SM_STATUS_WRITTEN))
        return 0;
    if (c->sm[c->outputs.sm].completed + d->copy_time <= c->segment->now)
        return 1;
    d->shift_short++;
    return 0;
}

static void outputs_missed(controller *c) {
    synchronous_cycle *d = &c->synchronous;
    d->missed++;
    d->missed_in_a_row++;
    d->error = 1;
    if (d->missed_in_a_row != d->limit)
        return;
    model_fault(c, ERROR_SYNCHRONISATION);
    raise_event(c, EVENT_SYNC_MISSED);
}

/* Update the output pins of a terminal without a microcontroller at SYNC0 (Beckhoff, EtherCAT Slave
 * Controller, section II, 0x0150 digital I/O: "outputs updated at SYNC0"). */
static void pins_sync0(controller *c) {
    if (c->outputs.sm >= 0 && c->outputs_valid)
        outputs_accept(c);
}

/* Handle a pulse of the signal to which the device synchronises. */
static void model_pulse(controller *c) {
    synchronous_cycle *d = &c->synchronous;
    int64_t now = c->segment->now;
    if (c->frozen)
        return;
    d->exceeded += d->seen && now - d->last < d->minimum;
    d->last = now;
    d->error = 0;
    if (!d->seen) {
        d->seen = 1;
        raise_event(c, EVENT_SYNC_SEEN);
    }
    inputs_put(c);
    int fresh = c->outputs_valid && outputs_in_time(c);
    if (fresh || (c->outputs_valid && !c->outputs_taken))
        outputs_accept(c);
    if (!c->outputs_valid || fresh || c->outputs.sm < 0)     /* a device without outputs misses none */
        d->missed_in_a_row = 0;
    else
        outputs_missed(c);
    c->outputs_taken = c->outputs_valid;
    model_axes(c, fresh);
    d->left = d->steps - 1;
    c->step_due = now + c->step_period + (d->left == 0 ? c->step_period / 2 : 0);
}

/* Synchronise the device to the pulses of `signal` (SYNC_PULSE_0 or _1). Their period `cycle` is
 * divided into `steps` internal cycles. */
static void synchronous_begin(controller *c, int64_t cycle, int steps, uint8_t signal) {
    synchronous_cycle *d = &c->synchronous;
    d->cycle = cycle;
    d->signal = signal;
    d->steps = steps;
    d->left = d->seen = d->error = 0;
    d->missed_in_a_row = 0;
    c->segment->synchronous += !d->active;
    d->active = 1;
}

static void synchronous_end(controller *c) {
    c->segment->synchronous -= c->synchronous.active;
    c->synchronous.active = 0;
}

static inline void model_period(controller *c, int64_t period) {
    c->step_period = period;
    c->step_seconds = (double)period * 1e-9;
    c->step_rate = 1e9 / (double)period;
    c->step_due = c->segment->now + period;
    due_at(c, c->step_due);
}

/* Do all work of the model that is due now. A pulse is handled before a step. */
static inline void device_advance(controller *c) {
    int64_t now = c->segment->now;
    int pulses = c->sync.due <= now ? sync_advance(c) : 0;
    if (c->emulation && pulses & SYNC_PULSE_0)
        pins_sync0(c);
    if (c->synchronous.active && pulses & c->synchronous.signal)
        model_pulse(c);
    if (c->step_due > now)
        return;
    model_step(c);
    c->step_due += c->step_period;
    if (c->step_due <= now - CATCH_UP_STEPS * c->step_period)
        c->step_due = now + c->step_period;
}

#endif
