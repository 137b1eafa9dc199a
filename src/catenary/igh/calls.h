/* Function pointers to the calls of libethercat that a cycle makes.
 *
 * ecrt.h states for each of them that it may be called from a real-time thread.
 */
#ifndef CATENARY_IGH_CALLS_H
#define CATENARY_IGH_CALLS_H

#include <stdint.h>

/* The calls of a cycle. Those that return nothing before 1.6.0 have two signatures. */
typedef union { void (*says_nothing)(void *); int (*says)(void *); } igh_call;
typedef union { void (*says_nothing)(void *, uint64_t); int (*says)(void *, uint64_t); } igh_call_time;
typedef union { void (*says_nothing)(void *, void *); int (*says)(void *, void *); } igh_call_state;

typedef struct igh_calls {
    int returns;                      /* true if they return a value; otherwise never read it */
    igh_call receive, send, process, queue, sync_reference_clock, sync_slave_clocks;
    igh_call_time application_time, sync_reference_clock_to;
    igh_call_state domain_state, master_state;
    int (*reference_clock_time)(void *, uint32_t *);
    igh_call monitor_queue;
    uint32_t (*monitor_process)(void *);
} igh_calls;

static inline int igh_do(const igh_calls *calls, igh_call call, void *object)
{
    if (calls->returns)
        return call.says(object);
    call.says_nothing(object);
    return 0;
}

static inline void igh_tell(const igh_calls *calls, igh_call_time call, void *object, uint64_t time)
{
    if (calls->returns)
        call.says(object, time);
    else
        call.says_nothing(object, time);
}

static inline void igh_state(const igh_calls *calls, igh_call_state call, void *object, void *state)
{
    if (calls->returns)
        call.says(object, state);
    else
        call.says_nothing(object, state);
}

typedef struct { uint32_t counter, state, redundancy; } igh_domain_state;
typedef struct { uint32_t responding, bits; } igh_master_state;

#endif
