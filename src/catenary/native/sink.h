/* The sink table: a consumer that receives the data of every cycle after the hand-over to Python.
 *
 * `put` is called once per cycle, in the post-processing, by the thread that runs the cycle,
 * without the GIL. It must not block, allocate or raise, because it delays the next cycle start.
 * Its arguments belong to the cycle and are valid until it returns.
 * Python passes the table in a capsule named CAT_SINK_CAPSULE, made for the sizes of one engine's
 * blocks (`Engine.sink_fields`). The capsule keeps the objects used by the table alive.
 */
#ifndef CATENARY_SINK_H
#define CATENARY_SINK_H

#include <stdint.h>

#include "motion.h"

#define CAT_SINK_CAPSULE "catenary.sink"
#define CAT_SINK_VERSION 2u

typedef struct cat_sink {
    uint32_t version;                 /* CAT_SINK_VERSION */
    uint32_t record_size;             /* sizes of the three blocks that the sink expects [bytes] */
    uint32_t actual_size;
    uint32_t target_size;
    void *self;

    /* `number`: the cycle, increasing by one. `record`: its times and flags. `actual`: its actual
     * values and the commanded values. `target`: the requested values. */
    void (*put)(void *self, uint64_t number, const void *record, const void *actual,
                const void *target);

    /* Requests of other processes, checked by the core in every cycle: the header, followed by
     * `motion_axes` slots, at a multiple of 64 bytes. NULL: none. The memory must stay mapped, and a
     * client must not be able to truncate it. */
    cat_motion *motion;
    uint32_t motion_axes;             /* number of axes of the engine */
    uint32_t jog;                     /* 1: jogs and requests to enable or reset are accepted */
} cat_sink;

#endif
