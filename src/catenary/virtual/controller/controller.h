/* Virtual EtherCAT SubDevice controller and its segment: memory, values derived from it for the frame
 * path, and the events that wake the application.
 *
 * Two sides access a controller: frames (the EtherCAT side) and the application (the PDI side). The
 * frame path holds the mutex of the segment. The application also holds it, except to access single
 * values or to copy memory. The functions in this file do not allocate memory, wait or call Python. */
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

/* Events for the application, which are stored until it fetches them. */
enum controller_event {
    EVENT_AL_CONTROL = 1,
    EVENT_MAILBOX_WRITTEN = 2,       /* SM0 was filled by the MainDevice */
    EVENT_MAILBOX_READ = 4,          /* SM1 was emptied by the MainDevice */
    EVENT_REPEAT_REQUEST = 8,
    EVENT_WATCHDOG = 16,             /* the process data watchdog expired */
    EVENT_OUTPUTS = 32,              /* the first complete process data since `expect_outputs` */
    EVENT_EMERGENCY = 64,            /* a device model has set or reset its error code */
    EVENT_SYNC_SEEN = 128,           /* the first SYNC pulse has arrived */
    EVENT_SYNC_MISSED = 256,         /* too many consecutive pulses without new outputs */
    EVENT_SYNC_LOST = 512,           /* the pulses have stopped */
    EVENT_RESET = 1024               /* the MainDevice resets the device */
};

/* State of a SyncManager for the frame path, derived from its registers. */
typedef struct {
    uint16_t start, length;
    uint8_t enabled;                 /* activated by the MainDevice */
    uint8_t blocked;                 /* deactivated by the PDI: all access is refused */
    uint8_t mailbox, ecat_writes, watchdog;
    uint8_t full;                    /* mailbox */
    uint8_t open;                    /* the EtherCAT side has accessed the first but not the last byte */
    uint8_t latest, using;           /* three buffers: last complete one; the one in use by the EtherCAT side */
    uint8_t written;                 /* three buffers: complete data is available */
    uint32_t writes;                 /* number of complete writes from the producer */
    int64_t completed;               /* time at which the frame of the last write had passed */
} sync_manager;

typedef struct {
    uint64_t first, end;             /* logical bits [first, end) */
    uint64_t physical;               /* bit address */
    uint8_t active, reads, writes, bytewise;
} fmmu;

typedef struct {
    uint8_t *image;                  /* content of the EEPROM */
    uint32_t words;
    uint16_t pending;                /* active command; 0: none */
    uint32_t address;
    uint16_t word;                   /* word to write */
    int64_t due;
    int64_t read_time, write_time;   /* [ns] */
    int loaded;                      /* the alias was loaded after power-on */
} sii_access;

/* Port of a controller. DL control contains the mode of its loop. */
typedef struct {
    int32_t cable;                   /* number of the connected cable; -1: none */
    uint8_t exists;                  /* the controller has this port */
    uint8_t link;                    /* link state that the controller has detected */
    uint8_t closed;                  /* its loop is closed */
    int64_t loss_due;                /* time at which the controller will detect the loss of light */
} port;

typedef struct {
    crystal crystal;
    int64_t anchor, local;           /* the local time at segment time `anchor` was `local` [ns] */
    double fraction;                 /* remaining fraction of `local` [ns] */
    double correction;               /* correction of the rate by the time control loop */
    double mean, speed;              /* filters of the loop: difference [ns], speed counter difference */
} dc_clock;

typedef struct {
    uint64_t next0, next1;           /* system times of the next pulses [ns], modulo 2^64 */
    int64_t due;                     /* segment time of the earlier pulse */
    uint32_t pulses0, pulses1;       /* numbers of pulses since the controller was created */
    uint8_t active;
    uint8_t awaits0, awaits1;        /* a next pulse is pending */
} sync_unit;

/* Synchronisation of a device to SYNC0 or SYNC1, and the counters of 0x1C32 and 0x1C33. */
typedef struct {
    int64_t cycle, minimum, copy_time;            /* [ns] */
    int64_t last;                    /* segment time of the last pulse */
    int steps, left;                 /* internal cycles per pulse; remaining ones before the next pulse */
    uint16_t limit, missed_in_a_row;
    uint16_t missed, exceeded, shift_short;       /* 0x0B, 0x0C, 0x0D */
    uint8_t active, seen, error;     /* seen: pulses arrive */
    uint8_t signal;                  /* bit of the signal in 0x0981 */
} synchronous_cycle;

/* Mapping of an object: bits of a SyncManager buffer <-> slot. */
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
    uint8_t has_dc;                  /* width of the clock: 0, 32 or 64 bits */
    uint8_t no_lrw;
    uint8_t fixed_loops;             /* the controller ignores loop control (0x0101) */
    uint8_t al_unread;               /* the PDI has not fetched AL control */
    uint8_t frozen;                  /* injected: the application is frozen */
    uint8_t outputs_valid;           /* the outputs are valid: OP, and the watchdog has not expired */
    uint8_t outputs_seen, outputs_taken;            /* EVENT_OUTPUTS was raised; the model used the outputs */
    int64_t outputs_ns;              /* segment time of the last output update; NEVER: none */
    uint8_t inputs_stale;            /* the model has new inputs that are not in memory */
    uint8_t slots_stale;             /* the axes have new values that are not in the slots */
    uint8_t powered;
    uint8_t mute;                    /* injected: logical datagrams are ignored */
    uint8_t is_protected;            /* write protection by 0x0021 or 0x0031 */
    uint8_t reset_step;
    uint64_t registers_enabled, esc_enabled;        /* numbers of the frames that enabled writing */
    port ports[PORTS];
    uint8_t loops_before;            /* value of 0x0101 to restore at loops_due after temporary use */
    int64_t loops_due;
    uint16_t identification;         /* explicit device ID; 0: none */
    sync_manager sm[MAX_SM];
    int sm_count, sm_top;
    fmmu fmmus[MAX_FMMU];
    int fmmu_count, fmmu_active;
    uint64_t logical_first, logical_end;  /* bit range that contains all active FMMUs */
    sii_access sii;
    dc_clock clock;
    sync_unit sync;
    int64_t passage;                 /* time at which the current frame reached this device */
    int64_t watchdog_due, pdi_watchdog_due;
    uint8_t watchdog_armed, watchdog_expired;
    /* model */
    int model;
    synchronous_cycle synchronous;
    int64_t step_period, step_due;   /* [ns] */
    double step_seconds, step_rate;  /* the same period [s], and its reciprocal [Hz] */
    mapping outputs, inputs;
    int64_t *slots;
    int slot_count;
    struct servo_axis *axes;
    int axis_count;
    uint16_t emergency;              /* last error code, for the application */
} controller;

#define QUEUE_SIZE 256u               /* a power of two */
#define LOSS_LOG 4096u                /* a power of two */
#define MAX_FRAME_FAULTS 32

/* End of a cable: a port of a device, or one of the MainDevice's network interfaces. */
enum { END_FIRST = -1, END_SECOND = -2 };

typedef struct {
    int32_t device;                  /* or END_FIRST, END_SECOND */
    int32_t port;
} cable_end;

typedef struct {
    cable_end up, down;              /* `down` is farther from the MainDevice's first interface */
    int64_t delay;                   /* one way [ns] */
    uint8_t plugged, light;          /* light: both sides also have power */
} cable;

/* Reasons why a frame does not return. */
enum loss_cause {
    LOSS_NO_LIGHT = 1, LOSS_CLOSED_PORT, LOSS_CIRCULATING, LOSS_IN_FLIGHT, LOSS_INJECTED, LOSS_CORRUPT,
    LOSS_EXPIRED
};

typedef struct {
    int64_t sent;
    int cause, end;
} loss;

/* Route of a frame from one interface in the present state of the loops, computed by route.h. */
typedef struct { struct controller *controller; int64_t offset; } stop;
typedef struct { int32_t device, port, cable; uint32_t stops; int64_t offset; } arrival;

typedef struct {
    stop *stops;                     /* processing units, in order */
    arrival *arrivals;               /* arrivals at ports, including the final interface */
    int64_t *times;                  /* arrival times, 4 per device; NEVER: does not arrive */
    uint32_t stop_count, arrival_count;
    uint32_t circulates;             /* stop after an automatically closed port 0, counted from 1 */
    int64_t delay;
    int exit;                        /* interface at which it leaves (0, 1), or -cause if it is lost */
    int32_t opens;                   /* auto-closed loop that it opens: 4 * device + port; -1: none */
} route;

/* Fault of frames: the affected frames and the effect (frame_faults.h). */
typedef struct {
    int kind, used;
    int64_t left;                    /* remaining number of frames to affect; -1: unlimited */
    uint32_t every, seen;
    int64_t delay;
    int32_t cable, offset;           /* corrupt: cable; garble: offset of the byte, -1: random bit */
} frame_fault;

typedef struct {
    int64_t sent, arrival;
    uint32_t length;
    int from;                        /* interface that sent it */
    uint8_t bytes[CAT_FRAME_MAX + 2];
} queued_frame;

/* Network interface of the MainDevice on the segment, and the frames that return to it. */
typedef struct {
    struct cat_segment *segment;
    queued_frame *queue;
    uint16_t order[QUEUE_SIZE];      /* places in the queue, in order of arrival */
    uint32_t head, tail;             /* frames are removed at head and added at tail */
    int64_t busy_until;              /* end of the transmission towards the segment */
    int number;
    int up;                          /* the interface is active and emits light */
    uint8_t taken[CAT_FRAME_MAX + 2];
} segment_end;

typedef struct {
    uint64_t frames, malformed, foreign, lost, datagrams, expired;
} frame_counters;

typedef struct cat_segment {
    pthread_mutex_t mutex;
    controller *controllers;
    int count;
    cable *cables;                   /* cable n is the uplink of device n; one more cable closes a ring */
    int cable_count, ring;
    route routes[2];
    const route *route;              /* route of the current frame */
    int routes_stale;
    int64_t detection;               /* time from the loss of light to the closed loop [ns] */
    int64_t link_due;                /* next detection of a lost link */
    uint8_t write_mask[REG_END];
    int64_t now, epoch;              /* epoch: start of the fault clock; -1: not started */
    int64_t passage;                 /* start of the current frame */
    int64_t frame_end;               /* end of its last byte */
    int64_t *dues;                   /* due time of each controller */
    int64_t next_due;                /* earliest due time of all compiled work */
    int64_t sii_due;                 /* earliest end of an EEPROM access, for the packet loop */
    int64_t service_due;             /* due time of the service (Python) */
    struct plant *plant;             /* model of the joints that the motors drive; NULL: none */
    int synchronous;                 /* number of devices that synchronise to SYNC pulses */
    int inputs_stale;                /* set if any controller has stale inputs */
    int pending;                     /* set if the service has work, for example events of a controller */
    int event_fd;                    /* event descriptor of the service thread; -1: none */
    const cat_clock *clock;          /* shared virtual clock; NULL: the clock is private */
    int is_virtual;
    uint8_t scratch[2048], incoming[2048];
    frame_counters counters;
    frame_fault faults[MAX_FRAME_FAULTS];
    int fault_count;                 /* number of faults in use */
    uint64_t random;
    loss losses[LOSS_LOG];
    uint64_t loss_count;
    segment_end ends[2];
    int failed;                      /* -errno of a service that ran during the time of another segment */
    int (*service)(void *owner);      /* virtual time: run the service with the GIL; 0 or -errno */
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

/* Schedule work of this controller for the time `when`. */
static inline void due_at(controller *c, int64_t when) {
    int64_t *due = c->segment->dues + c->position;
    *due = when < *due ? when : *due;
    if (when < c->segment->next_due)
        c->segment->next_due = when;
}

#endif
