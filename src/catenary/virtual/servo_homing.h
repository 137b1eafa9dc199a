/* Homing of a servo axis, mode 6 (CiA 402-2 / IEC 61800-7-201 §13): the drive finds its home
 * position.
 *
 * With method 37 (formerly 35), the present position is the home position. Two manufacturer-specific
 * methods, numbered as in Maxon's EPOS4, search for a hard stop: -3 in positive direction and -4 in
 * negative direction. 0x2110 is the torque that indicates the stop, and the maximum torque of the
 * search. As the profile specifies, zero = home + home offset (0x607C): at home, the axis shows
 * -offset. Setting bit 4 starts the search, and clearing it stops the search. Included by servo.h. */
#ifndef CATENARY_VIRTUAL_SERVO_HOMING_H
#define CATENARY_VIRTUAL_SERVO_HOMING_H

#define HOMING_PRESSED 0.02           /* time at full torque and standstill that indicates a stop [s] */

typedef enum { HOMING_NOT_STARTED, HOMING_SEARCHES, HOMING_ATTAINED, HOMING_FAILED } homing_state;

enum { HOME_HERE_OLD = 35, HOME_HERE = 37, HOME_STOP_POSITIVE = -3, HOME_STOP_NEGATIVE = -4 };

/* Set home to the present position, and restart the loops there. */
static void homing_attain(servo_axis *a, const int64_t *slots) {
    a->zero = llrint(a->position * a->counts_per_radian) + slots[SLOT_HOME_OFFSET];
    servo_hold(a);
    a->homing = HOMING_ATTAINED;
}

static void homing_start(servo_axis *a, const int64_t *slots) {
    int64_t method = slots[SLOT_HOMING_METHOD];
    a->pressed = 0;
    a->ramp = a->velocity;
    if (method == HOME_HERE || method == HOME_HERE_OLD)
        homing_attain(a, slots);
    else if (method == HOME_STOP_POSITIVE || method == HOME_STOP_NEGATIVE)
        a->homing = HOMING_SEARCHES;
    else
        a->homing = HOMING_FAILED;
}

/* Start or stop homing, according to the mode and bit 4 of the controlword. */
static void homing_command(servo_axis *a, const int64_t *slots) {
    int asked = a->mode == HM && a->state == OPERATION_ENABLED && (slots[SLOT_CONTROLWORD] & 0x10);
    if (a->mode != HM)
        a->homing = HOMING_NOT_STARTED;
    if (asked && !a->homing_asked)
        homing_start(a, slots);
    else if (!asked && a->homing == HOMING_SEARCHES)
        a->homing = HOMING_NOT_STARTED;
    a->homing_asked = (uint8_t)asked;
}

/* Return the torque of mode 6. A search moves at 0x6099:01 with the ramp 0x609A, until the axis presses
 * against the stop, which is then home. Without a search, the axis stops. */
static double homing_drive(servo_axis *a, const int64_t *slots, double limit, double dt) {
    double speed = 0, step = larger(1e-3, (double)slots[SLOT_HOMING_ACCELERATION] * a->radian_per_velocity) * dt;
    if (a->homing == HOMING_SEARCHES) {
        speed = (double)slots[SLOT_HOMING_SPEED] * a->radian_per_velocity;
        speed = slots[SLOT_HOMING_METHOD] == HOME_STOP_POSITIVE ? speed : -speed;
        limit = smaller(limit, a->rated_torque * (double)slots[SLOT_HOMING_TORQUE] * 1e-3);
    }
    a->ramp += clamp(speed - a->ramp, step);
    double torque = clamp(servo_velocity_loop(a, a->ramp, 0, limit, dt), limit);
    int stuck = speed != 0 && torque * speed > 0 && fabs(torque) >= limit && fabs(a->velocity) < 0.1 * fabs(speed);
    a->pressed = stuck ? a->pressed + dt : 0;
    if (a->pressed < HOMING_PRESSED)
        return torque;
    homing_attain(a, slots);
    return 0;
}

/* Return bits 10, 12 and 13 of the statusword. */
static uint16_t homing_status(const servo_axis *a) {
    uint16_t stands = fabs(a->velocity) < 0.05 && a->homing != HOMING_SEARCHES ? 0x0400 : 0;
    if (a->homing == HOMING_ATTAINED)
        return stands | 0x1000;
    return a->homing == HOMING_FAILED ? stands | 0x2000 : stands;
}

#endif
