/* Profile modes of a servo axis: profile position (1) and profile velocity (3), IEC 61800-7-201 /
 * CiA 402-2. The drive computes a trapezoidal trajectory (0x6086 = 0) with the velocity 0x6081, the
 * acceleration 0x6083 and the deceleration 0x6084.
 *
 * Profile position. A rising edge of controlword bit 4 accepts 0x607A as a new set-point. The drive
 * uses it immediately if bit 5 is set or if no set-point is active. Otherwise it stores the set-point
 * in a buffer for one set-point. With bit 6, the set-point is relative to the last target. Statusword
 * bit 12 acknowledges the set-point. This bit is cleared when controlword bit 4 is 0 and the buffer is
 * free.
 * Statusword bit 10: the position was within 0x6067 of the target for the time 0x6068. Controlword
 * bit 9 (blending into the next set-point) is ignored.
 * Profile velocity. 0x60FF is the target. Statusword bit 10: the velocity was within 0x606D of the
 * target for the time 0x606E. Statusword bit 12: the speed is at most 0x606F.
 * Both modes. Halt (controlword bit 8) slows down as 0x605D selects and then holds. Bit 10 then means
 * standstill. When halt is cleared, the motion continues. Included by servo.h. */
#ifndef CATENARY_VIRTUAL_SERVO_PROFILE_H
#define CATENARY_VIRTUAL_SERVO_PROFILE_H

enum { NEW_SET_POINT = 0x10, CHANGE_AT_ONCE = 0x20, RELATIVE = 0x40, HALT = 0x100 };
enum { HALT_QUICK_STOP_RAMP = 2 };

static inline int is_profile_mode(int mode) { return mode == PP || mode == PV; }

static int64_t profile_target(const servo_axis *a, const int64_t *slots) {
    int64_t last = a->profile.buffered ? a->profile.next : a->profile.goal;
    int64_t raw = slots[SLOT_TARGET_POSITION];
    int relative = (slots[SLOT_CONTROLWORD] & RELATIVE) != 0;
    int64_t goal = last + (relative ? raw : wrap32(raw - last));
    int64_t least = slots[SLOT_LIMIT_MIN], most = slots[SLOT_LIMIT_MAX];
    if (least < most)
        goal = goal < least ? least : goal > most ? most : goal;
    return goal;
}

static void profile_begin(servo_axis *a, int64_t goal) {
    a->profile.goal = goal;
    a->profile.in_process = 1;
    a->profile.in_window = 0;
}

/* Process the set-point handshake. */
static void profile_command(servo_axis *a, const int64_t *slots) {
    uint16_t word = (uint16_t)slots[SLOT_CONTROLWORD];
    int asked = (word & NEW_SET_POINT) != 0, rises = asked && !a->profile.asked;
    a->profile.asked = (uint8_t)asked;
    if (a->mode != PP || a->state != OPERATION_ENABLED || a->ramping != RAMP_NONE)
        return;
    if (rises && ((word & CHANGE_AT_ONCE) || !a->profile.in_process)) {
        int64_t goal = profile_target(a, slots);
        a->profile.buffered = 0;
        profile_begin(a, goal);
        a->profile.acknowledged = 1;
    } else if (rises && !a->profile.buffered) {
        a->profile.next = profile_target(a, slots);
        a->profile.buffered = a->profile.acknowledged = 1;
    }
    if (!asked && !a->profile.buffered)
        a->profile.acknowledged = 0;
}

static inline double profile_step(const servo_axis *a, int64_t raw, double dt) {
    return larger(1e-3, (double)raw * a->radian_per_velocity) * dt;
}

/* Return the velocity of the next step [rad/s], which approaches `wanted` within the ramps. */
static double profile_ramp(const servo_axis *a, const int64_t *slots, double wanted, double dt) {
    int halted = (slots[SLOT_CONTROLWORD] & HALT) != 0;
    int quick = halted && slots[SLOT_HALT_OPTION] == HALT_QUICK_STOP_RAMP;
    double now = a->command_velocity;
    int slower = now * wanted < 0 || fabs(wanted) < fabs(now);
    int64_t raw = slots[!slower ? SLOT_ACCELERATION : quick ? SLOT_QUICK_STOP_DECELERATION : SLOT_DECELERATION];
    return now + clamp(wanted - now, profile_step(a, raw, dt));
}

/* Return the maximum velocity at which the axis can still stop at the target, after one more step. */
static double profile_approach(const servo_axis *a, const int64_t *slots, double distance, double dt) {
    double step = profile_step(a, slots[SLOT_DECELERATION], dt);
    double braking = sqrt(0.25 * step * step + 2 * step / dt * fabs(distance)) - 0.5 * step;
    double speed = smaller((double)slots[SLOT_PROFILE_VELOCITY] * a->radian_per_velocity, a->velocity_limit);
    return copysign(smaller(smaller(speed, braking), fabs(distance) / dt), distance);
}

static void profile_position(servo_axis *a, const int64_t *slots, double dt) {
    double distance = ((double)a->profile.goal - a->command) * a->radian_per_count;
    int halted = (slots[SLOT_CONTROLWORD] & HALT) != 0;
    double wanted = halted ? 0 : profile_approach(a, slots, distance, dt);
    a->command_velocity = profile_ramp(a, slots, wanted, dt);
    a->command += a->command_velocity * dt * a->counts_per_radian;
    if (!halted && fabs((double)a->profile.goal - a->command) < 0.5 && fabs(a->command_velocity) * dt * a->counts_per_radian < 1.0) {
        a->command = (double)a->profile.goal;
        a->command_velocity = 0;
    }
}

/* Return 1 (bit 10) if the motor has been in the window for the required time. */
static int profile_in_window(servo_axis *a, int inside, int64_t milliseconds, double dt) {
    a->profile.in_window = inside ? a->profile.in_window + dt : 0;
    return inside && a->profile.in_window * 1e3 >= (double)milliseconds;
}

static void profile_reached(servo_axis *a, const int64_t *slots, double dt) {
    if (slots[SLOT_CONTROLWORD] & HALT) {
        a->profile.reached = fabs(a->velocity) < 0.05 && a->command_velocity == 0;
        return;
    }
    if (a->mode == PV) {
        double error = fabs((double)slots[SLOT_TARGET_VELOCITY] - a->velocity * a->velocity_per_radian);
        a->profile.reached = (uint8_t)profile_in_window(
            a, error <= (double)slots[SLOT_VELOCITY_WINDOW], slots[SLOT_VELOCITY_WINDOW_TIME], dt);
        return;
    }
    int64_t off = llabs(servo_counts(a) - a->profile.goal);
    int inside = a->command_velocity == 0 && off <= slots[SLOT_POSITION_WINDOW];
    int reached = profile_in_window(a, inside, slots[SLOT_POSITION_WINDOW_TIME], dt);
    if (reached && a->profile.buffered) {
        a->profile.buffered = reached = 0;
        profile_begin(a, a->profile.next);
    }
    if (reached)
        a->profile.in_process = 0;
    a->profile.reached = (uint8_t)(reached && !a->profile.in_process);
}

/* Compute command and command_velocity for one step of the trajectory. */
static void profile_drive(servo_axis *a, const int64_t *slots, double dt) {
    if (a->mode == PP)
        profile_position(a, slots, dt);
    else {
        int halted = (slots[SLOT_CONTROLWORD] & HALT) != 0;
        double wanted = (double)slots[SLOT_TARGET_VELOCITY] * a->radian_per_velocity;
        a->command_velocity = profile_ramp(a, slots, halted ? 0 : clamp(wanted, a->velocity_limit), dt);
    }
    profile_reached(a, slots, dt);
}

/* Return bits 10 to 13 of the statusword. */
static uint16_t profile_status(const servo_axis *a, const int64_t *slots) {
    uint16_t word = a->profile.reached ? 0x0400 : 0;
    if (a->mode == PV)
        return word | (fabs(a->velocity) * a->velocity_per_radian <= (double)slots[SLOT_VELOCITY_THRESHOLD] ? 0x1000 : 0);
    int64_t least = slots[SLOT_LIMIT_MIN], most = slots[SLOT_LIMIT_MAX];
    if (least < most && (a->profile.goal == least || a->profile.goal == most))
        word |= 0x0800;
    if (a->following_time > 0)
        word |= 0x2000;
    return word | (a->profile.acknowledged ? 0x1000 : 0);
}

#endif
