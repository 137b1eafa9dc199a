/* Plant: one MuJoCo model that the motors of several servos drive, instead of a separate shaft for
 * each motor.
 *
 * The plant has a fixed step on the segment's clock. Each step writes the motor torques, calls
 * mj_step, and reads the joint states. A torque that a servo computes at time t acts from t on. At
 * t + step, the servos read the state of t + step. The code calls MuJoCo through a function pointer
 * and accesses its arrays by address, without Python and without allocation. It never runs in the
 * frame path. In real time, only one thread steps the plant, and it releases the segment while
 * MuJoCo computes. Time budget: 10 us per step of a six-axis arm, nearly all of it in mj_step.
 *
 * The model includes the inertia, viscous friction and dry friction of the motors (armature, damping
 * and frictionloss). A brake is additional dry friction that is switched on and off. */
#ifndef CATENARY_VIRTUAL_PLANT_H
#define CATENARY_VIRTUAL_PLANT_H

#include <setjmp.h>

#include "device_cycle.h"

#define WILD 1e6                      /* maximum plausible velocity of a motor [rad/s] */

/* Joint of the model, and its motor: motor angle = ratio (q - zero). */
typedef struct plant_joint {
    servo_axis *axis;                 /* NULL: no motor is connected */
    double *q, *v, *force, *friction; /* in qpos, qvel, qfrc_applied, dof_frictionloss */
    double ratio, zero;               /* motor turns per joint turn, signed; zero position [rad] */
    double dry, brake;                /* dry friction at the joint; additional friction of the closed brake */
    int64_t brake_delay, closes;      /* delay after the motor torque has ended; time of closing [ns] */
    double place;                     /* position to which the joint was moved by hand */
    uint8_t placed;
} plant_joint;

/* First fields of mjLogMessage (MuJoCo 4). */
typedef struct { int level, topic; char subject[1024]; } mujoco_message;
enum { MUJOCO_WARNING = 2, MUJOCO_ERROR = 3 };

typedef struct plant {
    void (*step)(const void *model, void *data);
    void (*set_handler)(void (*)(const mujoco_message *));   /* sets the message handler of this thread; NULL: not available */
    const void *model;
    void *data;
    plant_joint *joints;
    int count;
    int64_t period, due;              /* [ns] */
    int wild;                         /* number, from 1, of the joint that exceeded WILD; 0: none */
    int ending;                       /* real time: the thread must end */
    uint64_t steps;
    char words[256];                  /* warning or error message of MuJoCo, which stops the plant */
    jmp_buf escape;                   /* exit from a failed step */
} plant;

static inline int plant_braked(plant_joint *j, int64_t now) {
    if (j->axis == NULL || !servo_powered(j->axis))
        return j->closes <= now;
    j->closes = now + j->brake_delay;
    return 0;
}

static void plant_apply(plant *p, int64_t now) {
    for (int k = 0; k < p->count; k++) {
        plant_joint *j = &p->joints[k];
        *j->force = j->axis ? j->ratio * (j->axis->torque + j->axis->load) : 0;
        *j->friction = j->dry + (plant_braked(j, now) ? j->brake : 0);
        if (j->placed) {
            *j->q = j->place;
            *j->v = 0;
            j->placed = 0;
        }
    }
}

/* Update the encoder values, and set `wild` if a motor is too fast. */
static void plant_show(plant *p) {
    for (int k = 0; k < p->count; k++) {
        plant_joint *j = &p->joints[k];
        double velocity = j->ratio * *j->v;
        if (!(fabs(velocity) < WILD))
            p->wild = k + 1;
        if (!j->axis || p->wild || j->placed)
            continue;
        j->axis->position = j->ratio * (*j->q - j->zero);
        j->axis->velocity = velocity;
    }
}

static __thread plant *plant_stepped;  /* the plant that this thread is stepping */

/* Store the first warning or error of MuJoCo. After an error, MuJoCo would end the process. Therefore the
 * handler leaves the step with longjmp. The state of the step is not used again. */
static void plant_message(const mujoco_message *m) {
    plant *p = plant_stepped;
    if (m->level < MUJOCO_WARNING)
        return;
    if (!p->words[0])
        strncpy(p->words, m->subject, sizeof p->words - 1);
    if (m->level >= MUJOCO_ERROR)
        longjmp(p->escape, 1);
}

static void plant_simulate(plant *p) {
    if (p->set_handler == NULL) {
        p->step(p->model, p->data);
        return;
    }
    plant_stepped = p;
    p->set_handler(plant_message);
    if (_setjmp(p->escape) == 0)
        p->step(p->model, p->data);
    p->set_handler(NULL);
}

/* Do the step that is due. After a failure, stop the plant and wake the service. In real time, other
 * threads can run while MuJoCo computes, but they do not pass p->due. */
static void plant_step(cat_segment *s) {
    plant *p = s->plant;
    plant_apply(p, s->now);
    if (!s->is_virtual)
        pthread_mutex_unlock(&s->mutex);
    plant_simulate(p);
    if (!s->is_virtual)
        pthread_mutex_lock(&s->mutex);
    p->steps++;
    plant_show(p);
    p->due += p->period;
    if (p->due <= s->now - CATCH_UP_STEPS * p->period)
        p->due = s->now + p->period;
    if (!p->wild && !p->words[0])
        return;
    p->due = NEVER;
    s->pending = 1;
    wake_service(s);
}

/* Return the time up to which the caller may work. Only the thread that steps the plant may pass the
 * due time of a step. */
static inline int64_t plant_bound(const cat_segment *s, int64_t until, int steps_plant) {
    return !s->plant || steps_plant || until < s->plant->due ? until : s->plant->due - 1;
}

static void plant_hang(plant_joint *j, servo_axis *a) {
    j->axis = a;
    a->joint = j;
    a->position = j->ratio * (*j->q - j->zero);
    a->velocity = j->ratio * *j->v;
}

/* Disconnect the motors of a device that is removed. */
static void plant_forget(plant *p, const controller *c) {
    for (int k = 0; p && k < p->count; k++)
        for (int n = 0; n < c->axis_count; n++)
            if (p->joints[k].axis == &c->axes[n])
                p->joints[k].axis = NULL;
}

/* Move the shaft by hand to a position [rad at the motor]. */
static inline void servo_place(servo_axis *a, double position) {
    plant_joint *j = a->joint;
    a->position = position;
    if (j == NULL)
        return;
    j->place = j->zero + position / j->ratio;
    j->placed = 1;
}

static void plant_free(plant *p) {
    if (p)
        free(p->joints);
    free(p);
}

#endif
