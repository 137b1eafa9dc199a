/* One virtual EtherCAT SubDevice controller and the segment it stands in: memory, what is cached
 * of it for the frame path, and the events that wake the application.
 *
 * Two sides touch a controller: frames (the EtherCAT side, `noexcept`, answers from memory alone)
 * and the application (the PDI side). Whoever touches one holds the segment's mutex; nothing here
 * allocates, waits or calls Python. */
#ifndef CATENARY_VIRTUAL_CONTROLLER_H
#define CATENARY_VIRTUAL_CONTROLLER_H

#include <pthread.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "clock.h"
#include "crystal.h"
#include "link.h"
#include "registers.h"

#define MAX_SM 8
#define MAX_FMMU 8
#define MAX_AXES 8
#define MAX_MAPPED 256
#define PORTS 4
#define NEVER INT64_MAX

/* events for the application, kept until it fetches them */
enum controller_event {
    EVENT_AL_CONTROL = 1,
    EVENT_MAILBOX_WRITTEN = 2,       /* SM0 was filled by the MainDevice */
    EVENT_MAILBOX_READ = 4,          /* SM1 was emptied by the MainDevice */
    EVENT_REPEAT_REQUEST = 8,
    EVENT_WATCHDOG = 16,             /* the process data watchdog expired */
    EVENT_OUTPUTS = 32,              /* the first process data since the SyncManager was enabled */
    EVENT_EMERGENCY = 64,            /* a device model has a new error code */
    EVENT_SYNC_SEEN = 128,           /* the first SYNC0 pulse since the device waits for them */
    EVENT_SYNC_MISSED = 256,         /* too many pulses in a row without new outputs */
    EVENT_SYNC_LOST = 512,           /* no pulses any more */
    EVENT_RESET = 1024               /* the MainDevice resets the device */
};

/* A SyncManager as the frame path sees it; its registers stay the truth. */
typedef struct {
    uint16_t start, length;
    uint8_t enabled;                 /* activated by the MainDevice */
    uint8_t blocked;                 /* deactivated by the PDI: nobody passes */
    uint8_t mailbox, ecat_writes, watchdog;
    uint8_t full;                    /* mailbox */
    uint8_t open;                    /* EtherCAT side is between its first and last byte */
    uint8_t latest, using;           /* three buffers: last complete one; the one EtherCAT holds */
    uint8_t written;                 /* buffers: something complete is there */
    uint32_t writes;                 /* complete writes from the producer */
    int64_t completed;               /* when the frame of the last one has passed */
} sync_manager;

typedef struct {
    uint64_t first, end;             /* logical bits [first, end) */
    uint64_t physical;               /* bit */
    uint8_t active, reads, writes, bytewise;
} fmmu;

typedef struct {
    uint8_t *image;                  /* the EEPROM's content */
    uint32_t words;
    uint16_t pending;                /* command under way, 0: none */
    uint32_t address;
    uint16_t word;                   /* to be written */
    int64_t due;
    int64_t read_time, write_time;   /* [ns] */
    int loaded;                      /* the first load after power-on has taken the alias */
} sii_access;

/* One of a controller's four ports; its loop's mode is in DL control. */
typedef struct {
    int32_t cable;                   /* which hangs here, -1: none */
    uint8_t exists;                  /* the controller has this port */
    uint8_t link;                    /* as the controller sees it */
    uint8_t closed;                  /* its loop */
    int64_t loss_due;                /* the light went out; when that will have been seen */
} port;

typedef struct {
    crystal crystal;
    int64_t anchor, local;           /* at segment time `anchor` the local time was `local` [ns] */
    double fraction;                 /* and this part of a nanosecond */
    double correction;               /* of the rate, by the time control loop */
    double mean, speed;              /* its filters: difference [ns], speed counter difference */
} dc_clock;

typedef struct {
    int64_t next0, next1;            /* system times of the next pulses [ns], NEVER: none */
    int64_t due;                     /* of the earlier one, on the segment's clock */
    uint32_t pulses0, pulses1;
    uint8_t active;
} sync_unit;

/* A device that keeps time by SYNC0 or SYNC1, and the counters of 0x1C32 and 0x1C33. */
typedef struct {
    int64_t cycle, minimum, copy_time;            /* [ns] */
    int64_t last;                    /* segment time of the last pulse */
    int steps, left;                 /* of its own cycle in one of SYNC0; before the next pulse */
    uint16_t limit, missed_in_a_row;
    uint16_t missed, exceeded, shift_short;       /* 0x0B, 0x0C, 0x0D */
    uint8_t active, seen, error;     /* seen: pulses come */
    uint8_t signal;                  /* the bit in 0x0981 of the pulses it keeps time by */
} synchronous_cycle;

/* One object of a device in its process data: bits of a SyncManager buffer <-> a slot. */
typedef struct {
    uint32_t bit;
    uint16_t slot;
    uint8_t bits;
    uint8_t is_signed;
} mapped;

typedef struct {
    mapped entries[MAX_MAPPED];
    int count;
    int sm;                          /* -1: none */
} mapping;

struct servo_axis;
struct plant;
struct cat_segment;

enum { MODEL_NONE = 0, MODEL_SLOTS = 1, MODEL_SERVO = 2 };

typedef struct controller {
    struct cat_segment *segment;
    uint8_t *memory;
    uint32_t memory_size;
    int position;
    uint32_t events;
    uint8_t emulation;               /* AL status follows AL control; no microcontroller */
    uint8_t has_dc;                  /* bits of its clock: 0, 32 or 64 */
    uint8_t no_lrw;
    uint8_t fixed_loops;             /* it ignores loop control (0x0101) */
    uint8_t al_unread;               /* the PDI has not yet fetched AL control */
    uint8_t frozen;                  /* injected: the application stands still */
    uint8_t outputs_valid;           /* the application takes the outputs: OP and fed */
    uint8_t outputs_seen, outputs_taken;            /* EVENT_OUTPUTS was raised since the last arming */
    int64_t outputs_ns;              /* segment time at which they were last taken over, NEVER: not yet */
    uint8_t inputs_stale;            /* the model stepped; its inputs are not in memory yet */
    uint8_t slots_stale;             /* and not in the slots */
    uint8_t powered;
    uint8_t mute;                    /* injected: logical datagrams pass it by */
    uint8_t is_protected;            /* by 0x0021 or 0x0031 */
    uint8_t reset_step;
    uint64_t registers_enabled, esc_enabled;        /* numbers of the frames that enabled writing */
    port ports[PORTS];
    uint8_t loops_before;            /* 0x0101 under temporary use: what comes back at loops_due */
    int64_t loops_due;
    uint16_t identification;         /* explicit device ID, 0: none */
    sync_manager sm[MAX_SM];
    int sm_count, sm_top;
    fmmu fmmus[MAX_FMMU];
    int fmmu_count, fmmu_active;
    uint64_t logical_first, logical_end;  /* hull of the active FMMUs, bits */
    sii_access sii;
    dc_clock clock;
    sync_unit sync;
    int64_t passage;                 /* when the frame in work reached this device */
    int64_t watchdog_due, pdi_watchdog_due;
    uint8_t watchdog_armed, watchdog_expired;
    /* model */
    int model;
    synchronous_cycle synchronous;
    int64_t step_period, step_due;   /* [ns] */
    double step_seconds, step_rate;  /* [s], [Hz]: the period once more */
    mapping outputs, inputs;
    int64_t *slots;
    int slot_count;
    struct servo_axis *axes;
    int axis_count;
    uint16_t emergency;              /* last new error code for the application */
} controller;

#define QUEUE_SIZE 256u               /* a power of two */
#define LOSS_LOG 4096u                /* a power of two */
#define MAX_FRAME_FAULTS 32

/* Where a cable ends: a device's position, or one of the MainDevice's network interfaces. */
enum { END_FIRST = -1, END_SECOND = -2 };

typedef struct {
    int32_t device;                  /* or END_FIRST, END_SECOND */
    int32_t port;
} cable_end;

typedef struct {
    cable_end up, down;              /* `down` is farther from the MainDevice's first interface */
    int64_t delay;                   /* one way [ns] */
    uint8_t plugged, light;          /* light: both sides have power too */
} cable;

/* Why a frame did not come back. */
enum loss_cause { LOSS_NO_LIGHT = 1, LOSS_CLOSED_PORT, LOSS_CIRCULATING, LOSS_IN_FLIGHT, LOSS_INJECTED, LOSS_CORRUPT };

typedef struct {
    int64_t sent;
    int cause, end;
} loss;

/* The way of a frame from one interface, as the loops stand now (route.h makes it). */
typedef struct { struct controller *controller; int64_t offset; } stop;
typedef struct { int32_t device, port, cable; uint32_t stops; int64_t offset; } arrival;

typedef struct {
    stop *stops;                     /* where it is processed, in order */
    arrival *arrivals;               /* where it comes in, the interface at the end included */
    int64_t *times;                  /* 4 a device: when it comes in there, NEVER: it does not */
    uint32_t stop_count, arrival_count;
    uint32_t circulates;             /* stop behind an automatically closed port 0, counted from 1 */
    int64_t delay;
    int exit;                        /* 0, 1: the interface it leaves at; -cause */
    int32_t opens;                   /* device and port an auto-closed loop opens at, 4·n + port; -1 */
} route;

/* Faults that hit frames: which, and what becomes of them (frame_faults.h). */
typedef struct {
    int kind, used;
    int64_t left;                    /* frames still to be hit, -1: no end */
    uint32_t every, seen;
    int64_t delay;
    int32_t cable, offset;           /* corrupt; garble, -1: anywhere */
} frame_fault;

typedef struct {
    int64_t sent, arrival;
    uint32_t length;
    int from;                        /* the interface it came in at */
    uint8_t bytes[CAT_FRAME_MAX + 2];
} queued_frame;

/* One network interface of the MainDevice on the segment: frames on their way to it. */
typedef struct {
    struct cat_segment *segment;
    queued_frame *queue;
    uint16_t order[QUEUE_SIZE];      /* of the queue's places, by arrival */
    uint32_t head, tail;             /* take at head, put at tail */
    int64_t busy_until;              /* the wire towards the segment is occupied */
    int number;
    int up;                          /* somebody drives it: its cable has light */
    uint8_t taken[CAT_FRAME_MAX + 2];
} segment_end;

typedef struct {
    uint64_t frames, malformed, foreign, lost, datagrams;
} frame_counters;

typedef struct cat_segment {
    pthread_mutex_t mutex;
    controller *controllers;
    int count;
    cable *cables;                   /* cable n leads up from device n; the last one closes the ring */
    int cable_count, ring;
    route routes[2];
    const route *route;              /* of the frame in work */
    int routes_stale;
    int64_t detection;               /* from light out to loop closed [ns] */
    int64_t link_due;                /* of the next loss of a link */
    uint8_t write_mask[REG_END];
    int64_t now, epoch;              /* epoch: faults count their time from here, -1: not yet */
    int64_t passage;                 /* when the frame in work starts */
    int64_t frame_end;               /* and when its last byte has */
    int64_t *dues;                   /* of each controller's work: looked through at every instant */
    int64_t next_due;                /* of all compiled work */
    int64_t sii_due;                 /* of the earliest EEPROM access, for the packet loop */
    int64_t service_due;             /* of the application, Python */
    struct plant *plant;             /* what the motors of servos turn together; NULL: nothing */
    int synchronous;                 /* how many devices keep time by SYNC0 */
    int inputs_stale;                /* some controller's inputs are */
    int pending;                     /* some controller has events */
    int event_fd;                    /* wakes the service thread, -1: none */
    const cat_clock *clock;          /* virtual time is shared: whose; NULL: it is ours alone */
    int is_virtual;
    uint8_t scratch[2048], incoming[2048];
    frame_counters counters;
    frame_fault faults[MAX_FRAME_FAULTS];
    int fault_count;                 /* in use */
    uint64_t random;
    loss losses[LOSS_LOG];
    uint64_t loss_count;
    segment_end ends[2];
    int (*service)(void *owner);      /* virtual time: the application side, takes the GIL; 0 or -errno */
    void *owner;
} cat_segment;

static inline uint16_t load16(const uint8_t *p) { return (uint16_t)(p[0] | p[1] << 8); }
static inline uint32_t load32(const uint8_t *p) {
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}
static inline uint64_t load64(const uint8_t *p) {
    return (uint64_t)load32(p) | (uint64_t)load32(p + 4) << 32;
}
static inline void store16(uint8_t *p, uint16_t v) { p[0] = (uint8_t)v; p[1] = (uint8_t)(v >> 8); }
static inline void store32(uint8_t *p, uint32_t v) { store16(p, (uint16_t)v); store16(p + 2, (uint16_t)(v >> 16)); }
static inline void store64(uint8_t *p, uint64_t v) { store32(p, (uint32_t)v); store32(p + 4, (uint32_t)(v >> 32)); }

static inline uint32_t min32(uint32_t a, uint32_t b) { return a < b ? a : b; }

static void wake_service(cat_segment *s);

static inline void raise_event(controller *c, uint32_t event) {
    c->events |= event;
    if (!c->segment->pending) {
        c->segment->pending = 1;
        wake_service(c->segment);
    }
}

/* Something of this controller is due at `when`: the segment looks no later than that. */
static inline void due_at(controller *c, int64_t when) {
    int64_t *due = c->segment->dues + c->position;
    *due = when < *due ? when : *due;
    if (when < c->segment->next_due)
        c->segment->next_due = when;
}

#endif
