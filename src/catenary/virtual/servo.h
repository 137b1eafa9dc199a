/* Servo axis: motor, control loops, and the drive side of the CiA 402 state machine (IEC 61800-7-201
 * §10 state machine, §12 to §14 modes). The axis runs in the internal cycle of the device.
 *
 * The code follows the profile and is independent of the MainDevice side, so that each tests the
 * other. Motor: J dv/dt = T + T_load - b v - T_c sign(v), semi-implicit Euler; or a joint of a plant
 * (plant.h). Time budget: 0.1 us per step. */
#ifndef CATENARY_VIRTUAL_SERVO_H
#define CATENARY_VIRTUAL_SERVO_H

#include <math.h>

#include "controller/controller.h"
#include "controller/distributed_clock.h"

/* Slots of one axis, at `AXIS_SLOTS * axis + slot`. devices/servo_objects.py maps objects to them. */
enum servo_slot {
    SLOT_CONTROLWORD, SLOT_STATUSWORD, SLOT_MODE, SLOT_MODE_DISPLAY,
    SLOT_TARGET_POSITION, SLOT_TARGET_VELOCITY, SLOT_TARGET_TORQUE,
    SLOT_POSITION_OFFSET, SLOT_VELOCITY_OFFSET, SLOT_TORQUE_OFFSET,
    SLOT_POSITION_DEMAND, SLOT_POSITION, SLOT_VELOCITY, SLOT_TORQUE_DEMAND, SLOT_TORQUE,
    SLOT_FOLLOWING_ERROR, SLOT_ERROR_CODE, SLOT_DIGITAL_INPUTS, SLOT_DIGITAL_OUTPUTS,
    SLOT_QUICK_STOP_OPTION, SLOT_SHUTDOWN_OPTION, SLOT_DISABLE_OPTION, SLOT_FAULT_OPTION,
    SLOT_FOLLOWING_WINDOW, SLOT_FOLLOWING_TIME, SLOT_LIMIT_MIN, SLOT_LIMIT_MAX,
    SLOT_MAX_TORQUE, SLOT_MAX_SPEED, SLOT_QUICK_STOP_DECELERATION, SLOT_DECELERATION,
    SLOT_INTERPOLATION_PERIOD, SLOT_INTERPOLATION_EXPONENT, SLOT_VELOCITY_DEMAND,
    SLOT_POLARITY,
    SLOT_HOME_OFFSET, SLOT_HOMING_METHOD, SLOT_HOMING_SPEED, SLOT_HOMING_SLOW,
    SLOT_HOMING_ACCELERATION, SLOT_HOMING_TORQUE, SLOT_ABORT_CONNECTION_OPTION,
    SLOT_PROFILE_VELOCITY, SLOT_ACCELERATION, SLOT_HALT_OPTION, SLOT_POSITION_WINDOW, SLOT_POSITION_WINDOW_TIME,
    SLOT_VELOCITY_WINDOW, SLOT_VELOCITY_WINDOW_TIME, SLOT_VELOCITY_THRESHOLD,
    SLOT_PROBE_FUNCTION, SLOT_PROBE_STATUS, SLOT_PROBE_SOURCE_1, SLOT_PROBE_SOURCE_2,
    /* four each: probe 1 positive, probe 1 negative, probe 2 positive, probe 2 negative edge */
    SLOT_PROBE_POSITIONS, SLOT_PROBE_TIMES = SLOT_PROBE_POSITIONS + 4, SLOT_PROBE_COUNTERS = SLOT_PROBE_TIMES + 4,
    AXIS_SLOTS = SLOT_PROBE_COUNTERS + 4
};

enum {
    NOT_READY, SWITCH_ON_DISABLED, READY_TO_SWITCH_ON, SWITCHED_ON, OPERATION_ENABLED,
    QUICK_STOP_ACTIVE, FAULT_REACTION_ACTIVE, FAULT
};

enum { PP = 1, PV = 3, HM = 6, CSP = 8, CSV = 9, CST = 10 };

/* Values of 0x6007, the reaction to a loss of process data. */
enum { ABORT_NOTHING = 0, ABORT_FAULT = 1, ABORT_DISABLE_VOLTAGE = 2, ABORT_QUICK_STOP = 3 };

enum {
    ERROR_OVERCURRENT = 0x2310, ERROR_STO = 0xFF01, ERROR_FOLLOWING = 0x8611,
    ERROR_COMMUNICATION = 0x7500, ERROR_OVERSPEED = 0x8400,
    ERROR_SYNCHRONISATION = 0x8700
};

typedef enum { RAMP_NONE, RAMP_TO_DISABLED, RAMP_AND_STAY, RAMP_TO_READY, RAMP_TO_SWITCHED_ON, RAMP_TO_FAULT } ramp_end;

struct plant_joint;

/* Differences of real drives from the profile. devices/servo_quirks.py lists the sources. */
typedef struct servo_quirks {
    double mode_delay;                                /* delay from 0x6060 to 0x6061 [s] */
    uint32_t refused_modes;                           /* bit n: 0x6061 never shows mode n */
    uint8_t never_bit_12, follows_without_bit_12, ignores_quick_stop, ignores_disable;
} servo_quirks;

/* Set-points that the drive last followed, except the position, in the units of their objects. */
typedef struct servo_targets {
    int64_t velocity, velocity_offset, torque, torque_offset;
} servo_targets;

/* State of the profile modes (servo_profile.h): unwrapped counts; seconds within the window of bit 10. */
typedef struct servo_profile {
    int64_t goal, next;
    double in_window;
    uint8_t asked, acknowledged, in_process, buffered, reached;
} servo_profile;

/* Input of a touch probe (servo_probe.h). */
typedef struct servo_probe {
    double from, to;                                  /* range in which its switch is closed [rad]; empty: no switch */
    uint8_t wire;                                     /* level that is applied from outside */
} servo_probe;

/* Differences of the touch probes of real drives. devices/touch_probe.py lists the sources. */
typedef struct probe_quirks {
    uint8_t toggles, keeps_stored, one_edge;
} probe_quirks;

enum { PROBES = 2 };

typedef struct servo_axis {
    /* parameters, SI units */
    double inertia, viscous, coulomb, load;           /* kg m2, N m s/rad, N m, N m */
    double rated_torque, velocity_limit;              /* N m, rad/s */
    double counts_per_radian, velocity_per_radian;    /* units of 0x6064 per rad; of 0x606C per rad/s */
    double radian_per_count, radian_per_velocity, per_inertia, per_torque;  /* reciprocals, because division is slow */
    double position_gain, velocity_gain, integral_gain;
    /* state */
    double position, velocity, torque, integral;      /* rad, rad/s, N m, N m */
    struct plant_joint *joint;                        /* the driven joint; NULL: the motor's own shaft */
    /* set-points */
    int64_t target;                                   /* unwrapped target position, counts */
    double command, command_velocity, ramp;           /* counts; rad/s; rad/s */
    double interpolated;                              /* remaining time until the target is reached [s] */
    double following_time;                            /* time outside the following error window [s] */
    int64_t zero;                                     /* shaft position at which the axis shows 0, counts */
    double pressed;                                   /* time of pressing against a stop while homing [s] */
    int homing;
    uint8_t homing_asked;
    int state, mode;
    ramp_end ramping;
    uint16_t last_controlword, injected;
    uint8_t sto, fed;                                 /* safe torque off; process data is valid */
    double boot;                                      /* remaining time until the drive is ready [s] */
    servo_quirks quirks;
    servo_targets targets;
    servo_profile profile;
    double bit_12_hidden;                             /* remaining time for which bit 12 is hidden [s] */
    double mode_wait;                                 /* remaining time until the requested mode applies [s] */
    int mode_requested;
    servo_probe probes[PROBES];
    probe_quirks probe_quirks;
    double probed;                                    /* position at the last step [rad] */
    int64_t probed_at;                                /* time of the segment at the last step [ns] */
} servo_axis;

static const uint16_t statuswords[] = {
    [NOT_READY] = 0x0000, [SWITCH_ON_DISABLED] = 0x0040, [READY_TO_SWITCH_ON] = 0x0021,
    [SWITCHED_ON] = 0x0023, [OPERATION_ENABLED] = 0x0027, [QUICK_STOP_ACTIVE] = 0x0007,
    [FAULT_REACTION_ACTIVE] = 0x000F, [FAULT] = 0x0008};

static inline int64_t wrap32(int64_t counts) { return (int32_t)(uint32_t)(uint64_t)counts; }

static inline int servo_powered(const servo_axis *a) {
    return a->state == OPERATION_ENABLED || a->state == QUICK_STOP_ACTIVE || a->state == FAULT_REACTION_ACTIVE;
}

static inline int64_t servo_counts(const servo_axis *a) {
    return llrint(a->position * a->counts_per_radian) - a->zero;
}

/* Return 1 if the drive follows its targets. With bit 12 hidden or never set, it holds its last demand,
 * unless it has the quirk `follows_without_bit_12`. */
static inline int servo_follows(const servo_axis *a) {
    return a->quirks.follows_without_bit_12 || !(a->quirks.never_bit_12 || a->bit_12_hidden > 0);
}

/* Return the position in counts, without quantisation. */
static inline double servo_exact(const servo_axis *a) {
    return a->position * a->counts_per_radian - (double)a->zero;
}

/* Restart the loops at the motor's position, and discard earlier commands. */
static void servo_hold(servo_axis *a) {
    a->target = servo_counts(a);
    a->command = (double)a->target;
    a->command_velocity = 0;
    a->ramp = a->velocity;
    a->integral = 0;
    a->interpolated = 0;
    a->following_time = 0;
    a->targets = (servo_targets){0};
    a->profile = (servo_profile){.goal = a->target, .asked = a->profile.asked};
}

static void servo_fault(controller *c, servo_axis *a, int64_t *slots, uint16_t code) {
    if (a->state == FAULT || a->state == FAULT_REACTION_ACTIVE)
        return;
    slots[SLOT_ERROR_CODE] = code;
    c->emergency = code;
    raise_event(c, EVENT_EMERGENCY);
    int gentle = a->state == OPERATION_ENABLED && slots[SLOT_FAULT_OPTION] != 0 && !a->sto;
    a->ramp = a->velocity;
    a->ramping = gentle ? RAMP_TO_FAULT : RAMP_NONE;
    a->state = gentle ? FAULT_REACTION_ACTIVE : FAULT;
}

/* Start a quick stop as 0x605A selects. A negative code disables it: the drive continues as before. */
static void servo_quick_stop(servo_axis *a, int64_t option) {
    if (option < 0)
        return;
    a->ramp = a->velocity;
    if (option == 0) {
        a->state = SWITCH_ON_DISABLED;
        a->ramping = RAMP_NONE;
        return;
    }
    a->state = QUICK_STOP_ACTIVE;
    a->ramping = option >= 5 ? RAMP_AND_STAY : RAMP_TO_DISABLED;
}

/* Leave OPERATION_ENABLED for `state`, immediately or after a ramp. */
static void servo_leave(servo_axis *a, int64_t option, int state, ramp_end ramp) {
    a->ramp = a->velocity;
    a->ramping = option == 0 ? RAMP_NONE : ramp;
    if (option == 0)
        a->state = state;
}

/* Process the controlword. Commands are patterns of bits 0 to 3, and a rising edge of bit 7. */
static void servo_command(controller *c, servo_axis *a, int64_t *slots) {
    uint16_t word = (uint16_t)slots[SLOT_CONTROLWORD];
    int reset = (word & 0x80) && !(a->last_controlword & 0x80);
    a->last_controlword = word;
    int disable_voltage = !(word & 0x02), quick_stop = (word & 0x06) == 0x02;
    int shutdown = (word & 0x07) == 0x06, switch_on = (word & 0x07) == 0x07;
    int enable = (word & 0x0F) == 0x0F;
    switch (a->state) {
    case NOT_READY:
    case FAULT_REACTION_ACTIVE:
        return;
    case SWITCH_ON_DISABLED:
        if (shutdown && !a->sto)
            a->state = READY_TO_SWITCH_ON;                                  /* 2 */
        return;
    case READY_TO_SWITCH_ON:
        if (disable_voltage || quick_stop)
            a->state = SWITCH_ON_DISABLED;                                  /* 7 */
        else if (switch_on)
            a->state = SWITCHED_ON;                                         /* 3 */
        return;
    case SWITCHED_ON:
        if (disable_voltage || quick_stop)
            a->state = SWITCH_ON_DISABLED;                                  /* 10 */
        else if (shutdown)
            a->state = READY_TO_SWITCH_ON;                                  /* 6 */
        else if (enable) {
            servo_hold(a);
            a->state = OPERATION_ENABLED;                                   /* 4 */
            a->ramping = RAMP_NONE;
        }
        return;
    case OPERATION_ENABLED:
        if (disable_voltage)
            a->state = SWITCH_ON_DISABLED;                                  /* 9 */
        else if (quick_stop && a->quirks.ignores_quick_stop)
            return;
        else if (quick_stop)
            servo_quick_stop(a, slots[SLOT_QUICK_STOP_OPTION]);             /* 11 */
        else if (a->ramping != RAMP_NONE)
            return;
        else if (shutdown)
            servo_leave(a, slots[SLOT_SHUTDOWN_OPTION], READY_TO_SWITCH_ON, RAMP_TO_READY);      /* 8 */
        else if (switch_on && !enable && !a->quirks.ignores_disable)
            servo_leave(a, slots[SLOT_DISABLE_OPTION], SWITCHED_ON, RAMP_TO_SWITCHED_ON);        /* 5 */
        return;
    case QUICK_STOP_ACTIVE:
        if (disable_voltage)
            a->state = SWITCH_ON_DISABLED;                                  /* 12 */
        else if (enable && a->fed && a->ramping == RAMP_AND_STAY && fabs(a->velocity) < 0.05) {
            servo_hold(a);
            a->state = OPERATION_ENABLED;                                   /* 16 */
            a->ramping = RAMP_NONE;
        }
        return;
    case FAULT:
        if (reset && a->injected == 0) {
            slots[SLOT_ERROR_CODE] = 0;
            c->emergency = 0;
            raise_event(c, EVENT_EMERGENCY);
            a->state = SWITCH_ON_DISABLED;                                  /* 15 */
        }
        return;
    }
}

/* End a ramp when the axis is at standstill. */
static void servo_standstill(servo_axis *a) {
    static const int after[] = {[RAMP_TO_DISABLED] = SWITCH_ON_DISABLED, [RAMP_TO_READY] = READY_TO_SWITCH_ON,
                                [RAMP_TO_SWITCHED_ON] = SWITCHED_ON, [RAMP_TO_FAULT] = FAULT};
    if (a->ramping == RAMP_NONE || a->ramping == RAMP_AND_STAY || a->ramp != 0 || fabs(a->velocity) > 0.05)
        return;
    a->state = after[a->ramping];
    a->ramping = RAMP_NONE;
}

static void servo_supervise(controller *c, servo_axis *a, int64_t *slots, double dt) {
    if (a->sto && (servo_powered(a) || a->state == SWITCHED_ON || a->state == READY_TO_SWITCH_ON))
        a->state = SWITCH_ON_DISABLED;
    if (a->injected)
        servo_fault(c, a, slots, a->injected);
    if (fabs(a->velocity) > 1.2 * a->velocity_limit && servo_powered(a))
        servo_fault(c, a, slots, ERROR_OVERSPEED);
    if (a->state != OPERATION_ENABLED || (a->mode != CSP && a->mode != PP) || a->ramping != RAMP_NONE) {
        a->following_time = 0;
        return;
    }
    int64_t window = slots[SLOT_FOLLOWING_WINDOW];
    double error = a->command - servo_exact(a);
    int outside = window != 0xFFFFFFFF && fabs(error) > (double)window;
    a->following_time = outside ? a->following_time + dt : 0;
    if (outside && a->following_time * 1e3 >= (double)slots[SLOT_FOLLOWING_TIME])
        servo_fault(c, a, slots, ERROR_FOLLOWING);
}

static inline double smaller(double a, double b) { return a < b ? a : b; }
static inline double larger(double a, double b) { return a > b ? a : b; }
static inline double clamp(double value, double limit) { return larger(-limit, smaller(limit, value)); }

static inline double power_of_ten(int64_t exponent) {
    static const double small[] = {1, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9};
    return exponent <= 0 && exponent > -10 ? small[-exponent] : pow(10.0, (double)exponent);
}

/* Approach a new target position linearly within the interpolation period, 0x60C2. */
static void servo_interpolate(servo_axis *a, const int64_t *slots, int fresh, double dt, double rate) {
    int64_t goal = slots[SLOT_TARGET_POSITION] + slots[SLOT_POSITION_OFFSET];
    int64_t unwrapped = a->target + wrap32(goal - a->target);
    int64_t least = slots[SLOT_LIMIT_MIN], most = slots[SLOT_LIMIT_MAX];
    if (least < most)
        unwrapped = unwrapped < least ? least : unwrapped > most ? most : unwrapped;
    if (fresh || unwrapped != a->target) {
        double period = (double)slots[SLOT_INTERPOLATION_PERIOD] * power_of_ten(slots[SLOT_INTERPOLATION_EXPONENT]);
        a->interpolated = smaller(larger(period, dt), 1.0);
        a->target = unwrapped;
    }
    double before = a->command;
    if (a->interpolated > dt * 1.001) {
        a->command += ((double)a->target - a->command) * dt / a->interpolated;
        a->interpolated -= dt;
    } else {
        a->command = (double)a->target;
        a->interpolated = 0;
    }
    a->command_velocity = (a->command - before) * rate * a->radian_per_count;
}

static double servo_velocity_loop(servo_axis *a, double velocity, double feed_forward, double limit, double dt) {
    double error = clamp(velocity, a->velocity_limit) - a->velocity;
    double torque = a->velocity_gain * error + a->integral + feed_forward;
    if (fabs(torque) < limit || error * torque < 0)
        a->integral += a->integral_gain * error * dt;
    a->integral = clamp(a->integral, limit);
    return torque;
}

/* Return 1 for the ramp 0x6085, or 0 for the ramp 0x6084. Options 1 and 5 of 0x605A and option 1 of
 * 0x605E use 0x6084. Options that brake at the current or voltage limit use the steeper ramp
 * 0x6085. */
static int servo_ramps_quickly(const servo_axis *a, const int64_t *slots) {
    int64_t option = slots[SLOT_QUICK_STOP_OPTION];
    if (a->state == QUICK_STOP_ACTIVE)
        return option != 1 && option != 5;
    return a->state == FAULT_REACTION_ACTIVE && slots[SLOT_FAULT_OPTION] != 1;
}

/* Ramp the velocity down to zero, in any mode. */
static double servo_ramp(servo_axis *a, const int64_t *slots, double limit, double dt) {
    int quick = servo_ramps_quickly(a, slots);
    int64_t raw = slots[quick ? SLOT_QUICK_STOP_DECELERATION : SLOT_DECELERATION];
    double step = larger(1e-3, (double)raw * a->radian_per_velocity) * dt;
    a->ramp = fabs(a->ramp) <= step ? 0 : a->ramp - copysign(step, a->ramp);
    return servo_velocity_loop(a, a->ramp, 0, limit, dt);
}

#include "servo_homing.h"
#include "servo_probe.h"
#include "servo_profile.h"

/* Accept the set-points, or hold the last demand if the drive does not follow them. */
static void servo_take_targets(servo_axis *a, const int64_t *slots, int fresh, double dt, double rate) {
    if (!is_profile_mode(a->mode) && !servo_follows(a)) {
        a->command_velocity = 0;
        a->interpolated = 0;
        return;
    }
    a->targets = (servo_targets){slots[SLOT_TARGET_VELOCITY], slots[SLOT_VELOCITY_OFFSET],
                                 slots[SLOT_TARGET_TORQUE], slots[SLOT_TORQUE_OFFSET]};
    if (a->mode == CSP)
        servo_interpolate(a, slots, fresh, dt, rate);
    else if (is_profile_mode(a->mode))
        profile_drive(a, slots, dt);
}

static double servo_drive(servo_axis *a, const int64_t *slots, int fresh, double dt, double rate) {
    double limit = a->rated_torque * (double)slots[SLOT_MAX_TORQUE] * 1e-3;
    double torque;
    if (a->ramping == RAMP_NONE)
        servo_take_targets(a, slots, fresh, dt, rate);
    const servo_targets *t = &a->targets;
    double feed_forward = (double)t->torque_offset * 1e-3 * a->rated_torque;
    if (a->ramping != RAMP_NONE)
        torque = servo_ramp(a, slots, limit, dt);
    else if (a->mode == CSP || a->mode == PP) {
        double offset = (double)t->velocity_offset * a->radian_per_velocity;
        double error = (a->command - servo_exact(a)) * a->radian_per_count;
        torque = servo_velocity_loop(a, a->position_gain * error + a->command_velocity + offset, feed_forward, limit, dt);
    } else if (a->mode == CSV) {
        a->command_velocity = (double)(t->velocity + t->velocity_offset) * a->radian_per_velocity;
        torque = servo_velocity_loop(a, a->command_velocity, feed_forward, limit, dt);
    } else if (a->mode == PV) {
        torque = servo_velocity_loop(a, a->command_velocity, feed_forward, limit, dt);
    } else if (a->mode == CST) {
        torque = (double)t->torque * 1e-3 * a->rated_torque + feed_forward;
        if (fabs(a->velocity) > a->velocity_limit && torque * a->velocity > 0)
            torque = 0;
    } else if (a->mode == HM)
        torque = homing_drive(a, slots, limit, dt);
    else
        torque = servo_velocity_loop(a, 0, 0, limit, dt);
    return clamp(torque, limit);
}

static void servo_motor(servo_axis *a, double dt) {
    double net = a->torque + a->load - a->viscous * a->velocity;
    double friction = a->coulomb * dt * a->per_inertia;
    double velocity = a->velocity + net * dt * a->per_inertia;
    /* dry friction can stop a motor, but never reverses it */
    velocity = fabs(velocity) <= friction ? 0 : velocity - copysign(friction, velocity);
    a->velocity = velocity;
    a->position += velocity * dt;
}

static uint16_t servo_statusword(const servo_axis *a, const int64_t *slots) {
    uint16_t word = statuswords[a->state];
    word |= 0x0200;                                          /* remote: the drive accepts the controlword */
    if (!a->sto)
        word |= 0x0010;
    if (a->state == READY_TO_SWITCH_ON || a->state == SWITCHED_ON || a->state == OPERATION_ENABLED)
        word |= 0x0020;                                      /* quick stop is not active */
    if (a->state != OPERATION_ENABLED)
        return word;
    if (a->mode == HM)
        return word | homing_status(a);
    if (is_profile_mode(a->mode))
        return word | profile_status(a, slots);
    int cyclic = a->mode == CSP || a->mode == CSV || a->mode == CST;
    if (cyclic && a->ramping == RAMP_NONE && a->fed && !a->quirks.never_bit_12 && a->bit_12_hidden <= 0)
        word |= 0x1000;                                      /* the drive follows the set-point */
    if (a->mode == CSP && a->following_time > 0)
        word |= 0x2000;
    int64_t least = slots[SLOT_LIMIT_MIN], most = slots[SLOT_LIMIT_MAX];
    if (a->mode == CSP && least < most && (a->target == least || a->target == most))
        word |= 0x0800;
    return word;
}

static void servo_show(servo_axis *a, int64_t *slots) {
    int64_t counts = servo_counts(a);
    slots[SLOT_POSITION] = wrap32(counts);
    slots[SLOT_VELOCITY] = wrap32(llrint(a->velocity * a->velocity_per_radian));
    slots[SLOT_TORQUE] = llrint(1e3 * a->torque * a->per_torque);
    slots[SLOT_TORQUE_DEMAND] = slots[SLOT_TORQUE];
    int commanded = (a->mode == CSP || a->mode == PP) && servo_powered(a) && a->ramping == RAMP_NONE;
    slots[SLOT_POSITION_DEMAND] = wrap32(commanded ? llrint(a->command) : counts);
    slots[SLOT_VELOCITY_DEMAND] = wrap32(llrint(a->command_velocity * a->velocity_per_radian));
    slots[SLOT_FOLLOWING_ERROR] = wrap32(slots[SLOT_POSITION_DEMAND] - slots[SLOT_POSITION]);
    slots[SLOT_DIGITAL_INPUTS] = (slots[SLOT_DIGITAL_INPUTS] & ~8ll) | (a->sto ? 8 : 0);
    slots[SLOT_MODE_DISPLAY] = a->mode;
    slots[SLOT_STATUSWORD] = servo_statusword(a, slots);
}

static inline int servo_knows_mode(const servo_axis *a, int mode) {
    int known = mode == 0 || is_profile_mode(mode) || mode == HM || mode == CSP || mode == CSV || mode == CST;
    return known && !(a->quirks.refused_modes >> mode & 1);
}

/* Change the mode. The loops restart at the present position and keep their integral term, so that
 * the torque does not jump. The old mode stays active and displayed until the delay has passed, and
 * while an unsupported mode is requested. */
static void servo_change_mode(servo_axis *a, const int64_t *slots, double dt) {
    int mode = (int)slots[SLOT_MODE];
    if (mode != a->mode_requested)
        a->mode_wait = a->quirks.mode_delay;
    a->mode_requested = mode;
    if (mode == a->mode || !servo_knows_mode(a, mode))
        return;
    if (a->mode_wait > 0.5 * dt) {
        a->mode_wait -= dt;
        return;
    }
    double integral = a->integral;
    servo_hold(a);
    a->integral = integral;
    a->mode = mode;
}

/* React to a loss of process data while the axis is enabled, as 0x6007 selects. */
static void servo_abort_connection(controller *c, servo_axis *a, int64_t *slots) {
    switch (slots[SLOT_ABORT_CONNECTION_OPTION]) {
    case ABORT_NOTHING:
        return;
    case ABORT_DISABLE_VOLTAGE:
        a->state = SWITCH_ON_DISABLED;
        return;
    case ABORT_QUICK_STOP:
        servo_quick_stop(a, slots[SLOT_QUICK_STOP_OPTION]);
        return;
    default:
        servo_fault(c, a, slots, ERROR_COMMUNICATION);
    }
}

static inline double counted_down(double seconds, double dt) { return seconds > 1.5 * dt ? seconds - dt : 0; }

/* Take one step. `fed`: the process data is valid (OP, and the watchdog has not expired). `fresh`:
 * new process data has arrived since the last step. */
static void servo_step(controller *c, servo_axis *a, int64_t *slots, int fed, int fresh, double dt, double rate) {
    if (a->state == NOT_READY && (a->boot -= dt) <= 0)
        a->state = SWITCH_ON_DISABLED;                       /* 0, 1 */
    if (a->fed && !fed && a->state == OPERATION_ENABLED)
        servo_abort_connection(c, a, slots);
    a->fed = (uint8_t)fed;
    servo_change_mode(a, slots, dt);
    servo_command(c, a, slots);
    homing_command(a, slots);
    profile_command(a, slots);
    probes_command(a, slots);
    servo_supervise(c, a, slots, dt);
    a->torque = servo_powered(a) ? servo_drive(a, slots, fresh, dt, rate) : 0;
    if (a->joint == NULL)
        servo_motor(a, dt);
    probes_step(c, a, slots);
    servo_standstill(a);
    a->bit_12_hidden = counted_down(a->bit_12_hidden, dt);
}

/* Update the slots from the state of the axes, before they are read. */
static inline void slots_refresh(controller *c) {
    if (!c->slots_stale)
        return;
    c->slots_stale = 0;
    for (int k = 0; k < c->axis_count; k++)
        servo_show(&c->axes[k], c->slots + k * AXIS_SLOTS);
}

#endif
