/* Plant: one MuJoCo model that the motors of several servos drive, instead of a separate shaft for
 * each motor. The servos can belong to several segments, the members of the plant.
 *
 * The plant has a fixed step on the clock of its members. Each step writes the motor torques, calls
 * mj_step, and reads the joint states and the sensors. A torque that a servo computes at time t acts
 * from t on. At t + step, the servos read the state of t + step. The code calls MuJoCo through a
 * function pointer and accesses its arrays by address, without Python and without allocation. It
 * never runs in the frame path. Time budget: 10 us per step of a six-axis arm, 30 us of a humanoid
 * that stands on its feet, nearly all of it in mj_step. `plant_time.h` takes the steps.
 *
 * `due` is written while all members are locked. A thread that holds one of them may read it.
 *
 * The model includes the inertia, viscous friction and dry friction of the motors (armature, damping
 * and frictionloss). A brake is additional dry friction that is switched on and off. */
#ifndef CATENARY_VIRTUAL_PLANT_H
#define CATENARY_VIRTUAL_PLANT_H

#include <setjmp.h>

#include "device_cycle.h"

enum { MAX_MEMBERS = 8, MAX_SENSORS = 256 };
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

/* Value of a sensor of the model, as a REAL32 in a slot of a device:
 * scale (value + bias + noise), with Gaussian noise of its own sequence. */
typedef struct plant_sensor {
    const double *value;              /* in sensordata */
    int64_t *slot;                    /* NULL: no device is connected */
    double scale, bias, noise;        /* noise: standard deviation */
    uint64_t random;                  /* state of the generator */
} plant_sensor;

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
    plant_sensor sensors[MAX_SENSORS];
    int sensor_count;
    uint8_t *freed;                   /* constraint to deactivate before the next step; NULL: none */
    struct cat_segment *members[MAX_MEMBERS];
    int member_count;
    int64_t period, due;              /* [ns] */
    int wild;                         /* number, from 1, of the joint that exceeded WILD; 0: none */
    int apart;                        /* set if the members do not have the same clock */
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
    if (p->freed)
        *p->freed = 0;
    p->freed = NULL;
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

/* Return a uniform random number in (0, 1] (splitmix64, Steele et al., OOPSLA 2014). */
static inline double sensor_uniform(plant_sensor *n) {
    uint64_t z = n->random += 0x9E3779B97F4A7C15u;
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9u;
    z = (z ^ z >> 27) * 0x94D049BB133111EBu;
    return (double)((z ^ z >> 31) >> 11) * 0x1p-53 + 0x1p-53;
}

/* Update the slot of a sensor. The noise is a Box-Muller transform of two uniform numbers. */
static void sensor_show(plant_sensor *n) {
    double noise = 0;
    if (n->slot == NULL)
        return;
    if (n->noise > 0)
        noise = n->noise * sqrt(-2 * log(sensor_uniform(n))) * cos(2 * M_PI * sensor_uniform(n));
    float shown = (float)(n->scale * (*n->value + n->bias + noise));
    uint32_t bits;
    memcpy(&bits, &shown, sizeof bits);
    *n->slot = bits;
}

/* Update the encoder values and the sensors, and set `wild` if a motor is too fast. */
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
    for (int k = 0; k < p->sensor_count; k++)
        sensor_show(&p->sensors[k]);
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

/* Return the time up to which a segment may work: before the next step of its plant. */
static inline int64_t plant_bound(const cat_segment *s, int64_t until) {
    return !s->plant || until < s->plant->due ? until : s->plant->due - 1;
}

static void plant_hang(plant_joint *j, servo_axis *a) {
    j->axis = a;
    a->joint = j;
    a->position = j->ratio * (*j->q - j->zero);
    a->velocity = j->ratio * *j->v;
}

/* Disconnect the motors and sensors of a device that is removed. */
static void plant_forget(plant *p, const controller *c) {
    for (int k = 0; p && k < p->sensor_count; k++)
        if (p->sensors[k].slot >= c->slots && p->sensors[k].slot < c->slots + c->slot_count)
            p->sensors[k].slot = NULL;
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
