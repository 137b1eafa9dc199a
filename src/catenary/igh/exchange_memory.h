/* State of one exchange of process images over libethercat. */
#ifndef CATENARY_IGH_EXCHANGE_MEMORY_H
#define CATENARY_IGH_EXCHANGE_MEMORY_H

#include <stdint.h>

#include "calls.h"
#include "image.h"
#include "kernel_time.h"

#define IGH_OP 8                      /* bit in al_states of ec_master_state_t: a device is in OP */
#define IGH_READINGS 5                /* readings per median */

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

    uint32_t serial;                  /* number of the emit */
    uint8_t collected;                /* all datagrams of this emit are back and judged */
    uint8_t judged;                   /* misses of this emit have been counted */
    uint8_t waits;                    /* collect waits for answers: threaded execution */
    uint8_t marked;                   /* the monitor datagram was sent last in this emit */
    uint8_t received;                 /* the monitor datagram is back, so all others are, too */
    uint8_t back;                     /* received, or sent without a usable monitor datagram */
    uint8_t attended;                 /* the clocks have been processed after this emit */
    uint32_t monitored;               /* content of the monitor datagram: OR of all 0x092C [ns] */
    uint32_t deaf;                    /* consecutive complete cycles without the monitor datagram */
    int64_t sent, patience;           /* time of sending; measured round trip [ns] */

    int clock;                        /* IGH_NO_CLOCK ... */
    int64_t period, epoch;
    int64_t app_time;                 /* last application time written [ns, link clock] */
    double rate, rate_limit, bandwidth;
    int64_t ahead;                    /* reference minus our clock, in the last cycle [ns] */
    igh_readings errors, spreads;
    int64_t phase_error;              /* median of `ahead` modulo the period [ns] */
    uint32_t strays;                  /* consecutive phase errors above an eighth of the period */
    uint64_t clock_reads, clock_misses, send_errors, receive_errors;

    int64_t bound;                    /* limit of phase error and differences for `locked` [ns] */
    double mean_error, mean_spread;   /* over about 16 cycles [ns] */
    int64_t worst_error, spread, worst_spread;
    uint64_t spread_reads, jumps, changes;
    uint64_t silent, unheard;         /* consecutive: no reference time; no monitor datagram back */
    uint8_t locked;
} igh_exchange;

#endif
