/* The motion words: shared memory through which clients request motions of single axes (jogs), changes
 * of the state of axes, and a stop of all axes. The core reads them in every cycle.
 *
 * Theory of operation. The header has the global words, one slot per axis has the others. Each word has
 * 8 bytes, and each side accesses it by one atomic operation. Clients write the first cache line of the
 * header and of each slot, and the words of a sweep. The core writes the other words of the second one.
 * The core trusts no word: it copies each one once, checks it, and keeps all of its state in private
 * memory.
 *
 *     stop          clients add 1; any change stops all axes. It needs no lease.
 *     stopper       pid of the last client that did so; stored before `stop`; for messages only
 *     token         newest token, a random number of 48 bits. The core issues one every 50 ms, and keeps
 *                   the last ones with their times of issue in private memory.
 *
 *     begun, press  number of a press. A client stores `begun`, then the parameters and the first
 *                   heartbeat, then `press` (release). The core accepts parameters only while both are
 *                   equal, before and after its copy.
 *     heartbeat     echoed token + (low 16 bits of the press << 48): a heartbeat extends no other press.
 *                   The jog may continue until 200 ms after the issue of that token. Unknown and old
 *                   tokens extend nothing, so that delayed heartbeats extend nothing.
 *     released      number of the press that was released
 *     velocity      signed [rad/s or m/s]
 *     distance      positive [rad or m]; NaN: until release
 *     acceleration  positive [rad/s² or m/s²]; NaN: that of the axis
 *     sweep_start, sweep_end    first and last frequency of a sweep [Hz]
 *     sweep_duration            [s]; 0: the jog is not a sweep. A sweep has no distance.
 *     request       number << 8 | requested state; a new number is a new request
 *     answer        press << 8 | status (jog_status)
 *     taken         number << 8 | status (request_status)
 *
 * Presses and requests have numbers of 56 bits. Clients write to a slot only while they hold the lease on
 * its axis, except for `released`.
 */
#ifndef CATENARY_MOTION_H
#define CATENARY_MOTION_H

#include <stdint.h>

#define CAT_MOTION_TOKEN_MASK 0xFFFFFFFFFFFFull
#define CAT_MOTION_PRESS_SHIFT 48
#define CAT_MOTION_STATUS_BITS 8

typedef struct cat_motion {
    uint64_t stop;
    uint64_t stopper;
    uint64_t of_clients[6];
    uint64_t token;
    uint64_t of_core[7];
} cat_motion;

typedef struct cat_motion_slot {
    uint64_t press;
    uint64_t begun;
    uint64_t heartbeat;
    uint64_t released;
    double velocity;
    double distance;
    double acceleration;
    uint64_t request;
    uint64_t answer;
    uint64_t taken;
    uint64_t of_core[3];
    double sweep_start;
    double sweep_end;
    double sweep_duration;
} cat_motion_slot;

#endif
