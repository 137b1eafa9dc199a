/* The law table: a control law that runs natively between collect and emit (order "law").
 *
 * Arrays have axis_count elements and belong to the core; they are valid during the call only.
 * Targets start as what was committed last, or as the actual position and zero where the axis is
 * not followed yet; the core's limits apply to what the law leaves in them.
 */
#ifndef CATENARY_LAW_H
#define CATENARY_LAW_H

#include <stdint.h>

#define CAT_LAW_CAPSULE "catenary.law"
#define CAT_LAW_VERSION 1u

typedef struct cat_law_frame {
    uint32_t axis_count;
    uint32_t ok;                      /* 1: every needed sync unit answered in this cycle */
    double time;                      /* [s] of this cycle, from the first instant */
    double period;                    /* [s] */
    const double *actual_position;    /* [rad] */
    const double *actual_velocity;    /* [rad/s] */
    const double *actual_torque;      /* [N·m] */
    const uint8_t *axis_flags;        /* as plan.wish.Views.axis_flags */
    double *target_position;
    double *target_velocity;
    double *target_torque;
    const double *input_reals;
    const int64_t *input_integers;
    const uint8_t *input_bits;
    double *output_reals;
    int64_t *output_integers;
    uint8_t *output_bits;
} cat_law_frame;

typedef struct cat_law {
    uint32_t version;                 /* CAT_LAW_VERSION */
    uint32_t reserved;
    void *self;

    /* Not 0: the law has finished; the axes hold from now on. Must not block or allocate. */
    int (*step)(void *self, const cat_law_frame *frame);
} cat_law;

#endif
