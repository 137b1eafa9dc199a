/* What one exchange of process images over libethercat consists of. */
#ifndef CATENARY_IGH_EXCHANGE_MEMORY_H
#define CATENARY_IGH_EXCHANGE_MEMORY_H

#include <stdint.h>

#include "calls.h"
#include "image.h"
#include "kernel_time.h"

#define IGH_OP 8                      /* in al_states of ec_master_state_t: a device is in OP */
#define IGH_READINGS 5                /* of a median */

typedef struct igh_copy { uint32_t domain_offset, image_offset, size; } igh_copy;

typedef struct igh_unit {             /* a sync unit: one domain */
    void *domain;
    uint8_t *data;
    uint32_t first_output, output_count, first_input, input_count;   /* in the list of copies */
    uint32_t divider, phase;
    uint8_t optional, queued, back;
} igh_unit;

typedef struct igh_readings { int64_t last[IGH_READINGS]; uint32_t count; } igh_readings;

enum { IGH_NO_CLOCK, IGH_FOLLOW_REFERENCE, IGH_FOLLOW_MAIN };

typedef struct igh_exchange {
    cat_image image;
    igh_time *time;
    igh_calls calls;
    void *master;
    igh_unit *units;
    igh_copy *copies;
    uint8_t *outputs, *inputs, *unit_valid, *unit_fresh;
    uint32_t *unit_missed;
    uint16_t *unit_counter;
    uint8_t ok, whole, al_status, link_up, redundancy;
    uint16_t al_counter;
    int64_t frame_stamp;

    uint32_t serial;                  /* of the emit */
    uint8_t collected;                /* everything that was sent is back and judged */
    uint8_t judged;                   /* misses of this emit have been counted */
    uint8_t waits;                    /* answers are waited for: threaded */
    uint8_t marked;                   /* the monitor datagram left last of this emit */
    uint8_t heard;                    /* it has come back, and all others with it */
    uint8_t back;                     /* heard, or nothing better is known */
    uint8_t attended;                 /* the clocks have been looked at after this emit */
    uint32_t monitored;               /* what it says: the OR of all 0x092C [ns] */
    uint32_t deaf;                    /* cycles in a row that were complete without it */
    int64_t sent, patience;           /* when; how long answers take, as found [ns] */

    int clock;                        /* IGH_NO_CLOCK ... */
    int64_t period, epoch;
    int64_t app_time;                 /* told last [ns, link clock] */
    double rate, rate_limit, bandwidth;
    int64_t ahead;                    /* reference less our clock, in the last cycle [ns] */
    igh_readings errors, spreads;
    int64_t phase_error;              /* `ahead` modulo the period, a median [ns] */
    uint32_t strays;                  /* phase errors beyond an eighth of a period, in a row */
    uint64_t clock_reads, clock_misses, send_errors, receive_errors;

    int64_t bound;                    /* of phase and differences, for `locked` [ns] */
    double mean_error, mean_spread;   /* over some 16 cycles [ns] */
    int64_t worst_error, spread, worst_spread;
    uint64_t spread_reads, jumps, changes;
    uint64_t silent, unheard;         /* in a row: no time told; no datagram back */
    uint8_t locked;
} igh_exchange;

#endif
