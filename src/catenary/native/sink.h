/* The sink table: who is given every cycle, after the frames and behind the hand-over.
 *
 * `put` is called once a cycle, in the cycle's tail, by whatever thread runs the cycle, without the
 * GIL. It must not block, allocate or raise: the next instant does not wait. What it is given is
 * the cycle's until it returns.
 * Python passes the table in a capsule named CAT_SINK_CAPSULE, made for the sizes of one engine's
 * blocks (`Engine.sink_fields`); the capsule keeps alive what the table stands on.
 */
#ifndef CATENARY_SINK_H
#define CATENARY_SINK_H

#include <stdint.h>

#define CAT_SINK_CAPSULE "catenary.sink"
#define CAT_SINK_VERSION 1u

typedef struct cat_sink {
    uint32_t version;                 /* CAT_SINK_VERSION */
    uint32_t record_size;             /* bytes of the three blocks it was made for */
    uint32_t actual_size;
    uint32_t target_size;
    void *self;

    /* `number` of the cycle, one more each time; `record`: its times and flags; `actual`: its values
     * and what was commanded; `target`: what was asked for. */
    void (*put)(void *self, uint64_t number, const void *record, const void *actual,
                const void *target);
} cat_sink;

#endif
