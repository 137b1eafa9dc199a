/* Read the cycles of a Catenary loop from C, C++ or C#, and send commands to it.
 *
 * Compile catenary_share.c with your program:
 *
 *     cc -pthread program.c $(catenary include)/catenary_share.c -I$(catenary include) -o program
 *
 * Alternatively, define CATENARY_SHARE_IMPLEMENTATION (in C also _GNU_SOURCE) in exactly one source file,
 * before its first #include, and include this header there. C11 or C++17, Linux, GCC or Clang.
 *
 * A share is shared memory that a loop writes in every cycle. Readers map it read-only. They can
 * neither delay nor change the loop. Commands need a lease: the right to command some axes for a
 * limited time. The rules are those of `cat.attach` in Python (docs/how_to/share.md).
 *
 * Functions that can fail return a negative code (enum catenary_code) and write a text to `error`,
 * which may be NULL. A share and its leases have no lock: use them from one thread at a time.
 * Only catenary_open, catenary_lease_take and the first catenary_stop allocate memory.
 */
#ifndef CATENARY_SHARE_H
#define CATENARY_SHARE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum catenary_code {
    CATENARY_OK = 0,
    CATENARY_E_ARGUMENT = -1,         /* invalid argument */
    CATENARY_E_NOT_FOUND = -2,        /* no share with this name */
    CATENARY_E_PERMISSION = -3,       /* the share does not permit it to this user */
    CATENARY_E_NOT_TRUSTED = -4,      /* it belongs to another user; pass the user id */
    CATENARY_E_DAMAGED = -5,          /* not a share, truncated, or invalid */
    CATENARY_E_VERSION = -6,          /* written by another version of Catenary */
    CATENARY_E_DEAD = -7,             /* the process of the loop was killed or has crashed */
    CATENARY_E_ENDED = -8,            /* the loop was closed */
    CATENARY_E_EMPTY = -9,            /* the loop has no cycle yet */
    CATENARY_E_OVERWRITTEN = -10,     /* the cycle no longer exists, or does not exist yet */
    CATENARY_E_LEASED = -11,          /* another client has a lease on the axis */
    CATENARY_E_LEASE_ENDED = -12,     /* the lease has ended */
    CATENARY_E_NOT_READ = -13,        /* the loop has not read the last 64 commands */
    CATENARY_E_LOCKED = -14,          /* another client has locked the desk for 2 s */
    CATENARY_E_FULL = -15,            /* 16 clients already have a lease */
    CATENARY_E_NO_COMMANDS = -16,     /* the share does not accept commands */
    CATENARY_E_SYSTEM = -17,          /* a system call has failed */
    CATENARY_E_INTERRUPTED = -18,     /* a signal has interrupted the wait */
    CATENARY_E_MEMORY = -19,          /* out of memory */
    CATENARY_E_REFUSED = -20          /* the core has refused a requested state */
};

/* Requested states of axes. */
enum catenary_request { CATENARY_DISABLE = 0, CATENARY_ENABLE = 1, CATENARY_QUICK_STOP = 2, CATENARY_RESET = 3 };

enum catenary_state { CATENARY_RUNNING = 1, CATENARY_ENDED = 2, CATENARY_DEAD = 3 };

/* Flags of catenary_open. */
enum { CATENARY_STALE = 1 };          /* accept a share whose process has died, to read its last cycles */

#define CATENARY_OWN_UID (-1)         /* this user or root */

typedef struct catenary_error {
    int32_t code;                     /* enum catenary_code */
    char text[508];                   /* UTF-8 */
} catenary_error;

/* Field of the row of a cycle. */
typedef struct catenary_field {
    const char *name;                 /* "position" */
    const char *unit;                 /* "rad"; "": a count, a code, or a unit of the device */
    uint64_t offset;                  /* in the row [bytes] */
    uint32_t count;                   /* of numbers: 1, one for each axis, or the length of an array */
    uint32_t size;                    /* of a number [bytes] */
    char kind;                        /* 'f' real, 'i' signed, 'u' unsigned, 'b' boolean */
    char per_axis;                    /* 1 if the field has one number for each axis */
} catenary_field;

typedef struct catenary_share catenary_share;
typedef struct catenary_lease catenary_lease;

/* ---- open and close */

/* Open the share `name` of the user `uid` (CATENARY_OWN_UID: this user or root). Pass only user ids that
 * you trust: the owner of a share can crash its readers. Return 0 or a code. */
int catenary_open(catenary_share **share, const char *name, int64_t uid, int flags, catenary_error *error);

/* Unmap a share and free it. Release its leases first. */
void catenary_close(catenary_share *share);

/* ---- description; texts are valid until catenary_close */

double catenary_period(const catenary_share *share);              /* [s] */
int64_t catenary_utc_offset_ns(const catenary_share *share);      /* UTC minus scheduled_ns */
int catenary_is_virtual(const catenary_share *share);             /* 1 if the loop has virtual time */
int64_t catenary_writer_pid(const catenary_share *share);
uint32_t catenary_axis_count(const catenary_share *share);
const char *catenary_axis_name(const catenary_share *share, uint32_t axis);     /* NULL: out of range */
int64_t catenary_find_axis(const catenary_share *share, const char *name);      /* -1: unknown */
uint32_t catenary_field_count(const catenary_share *share);
const catenary_field *catenary_field_at(const catenary_share *share, uint32_t k);   /* NULL: out of range */
const catenary_field *catenary_find_field(const catenary_share *share, const char *name);  /* NULL: unknown */

/* ---- read */

/* State of the loop: CATENARY_RUNNING, _ENDED or _DEAD. Reads /proc. */
int catenary_state(const catenary_share *share);

/* Number of the newest cycle; 0 before the first one. */
uint64_t catenary_newest(const catenary_share *share);

/* Wait for a cycle after cycle `seen`, for at most `timeout` [s]; a negative timeout sets no limit.
 * Return 1 if it exists and 0 after the timeout. CATENARY_E_ENDED and CATENARY_E_DEAD: no more cycles
 * will come. CATENARY_E_INTERRUPTED: call again. */
int catenary_wait(const catenary_share *share, uint64_t seen, double timeout, catenary_error *error);

/* Size of the row of a cycle [bytes]. */
size_t catenary_row_size(const catenary_share *share);

/* Copy the newest cycle, always complete, to `row` of `size` bytes. `number` receives its number and
 * may be NULL. Return 0, CATENARY_E_EMPTY before the first cycle, or CATENARY_E_ARGUMENT. */
int catenary_read(const catenary_share *share, void *row, size_t size, uint64_t *number,
                  catenary_error *error);

/* Copy cycle `number`. Return 0, CATENARY_E_OVERWRITTEN or CATENARY_E_ARGUMENT. */
int catenary_read_cycle(const catenary_share *share, uint64_t number, void *row, size_t size,
                        catenary_error *error);

/* Number `k` of a field in a row that was read; NaN if `field` is NULL or `k` is out of range. Integers
 * beyond 2^53 are rounded: read these from the bytes at `offset`. */
double catenary_value(const catenary_field *field, const void *row, uint32_t k);

/* ---- command */

/* Take a lease on `count` different axes (NULL: all axes) for `duration` [s], 0 to 3600 s. Each
 * catenary_lease_send and catenary_lease_renew starts this time again. Return 0 or a code, for example
 * CATENARY_E_LEASED with the process that has the axis. */
int catenary_lease_take(catenary_share *share, const uint32_t *axes, uint32_t count, double duration,
                        catenary_lease **lease, catenary_error *error);

/* Send set-points for the axes of the lease, in its order, and renew the lease. A quantity that is NULL
 * is not commanded. `position` [rad or m], `velocity` [rad/s or m/s], `torque` [N·m or N]. Return 0 or
 * a code. The lock of the desk is held for about 1 us, unless another client is stopped with it. */
int catenary_lease_send(catenary_lease *lease, const double *position, const double *velocity,
                        const double *torque, catenary_error *error);

/* Renew the lease for its full duration. Return 0 or a code. */
int catenary_lease_renew(catenary_lease *lease, catenary_error *error);

/* Request a state (enum catenary_request) of all axes of the lease, and renew the lease. CATENARY_RESET is
 * disabled with a fault reset. CATENARY_ENABLE and CATENARY_RESET are refused unless the share was opened
 * with `jog=True`. A later request of the program replaces it. Return 0 or a code. */
int catenary_lease_request(catenary_lease *lease, int state, catenary_error *error);

/* Answer to the last request: 1 if the core has taken it for all axes, 0 while an answer is missing, or
 * CATENARY_E_REFUSED. The field "enabled" shows whether an axis is enabled. */
int catenary_lease_request_status(const catenary_lease *lease, catenary_error *error);

/* Release the axes and free the lease. The axes then hold their commanded position. In a forked child,
 * only free the memory. Return 0 or a code. */
int catenary_lease_release(catenary_lease *lease, catenary_error *error);

/* Stop all axes at the next cycle with a quick stop. It needs no lease. Each axis needs a new request to
 * be enabled again. It is not an emergency stop (ISO 13850). Return 0 or a code. */
int catenary_stop(catenary_share *share, catenary_error *error);

#ifdef __cplusplus
}
#endif

#ifdef CATENARY_SHARE_IMPLEMENTATION
#include "catenary_share/lease.h"
#endif

#endif
