/* Common part of the C peers of `python -m benchmarks loop`: the job, the drives, the phases.
 *
 * These programs are the yardstick: a loop that a careful C programmer writes for this one segment.
 * Python brings the segment to PRE-OP and passes the frame of the cycle and the offsets of the
 * words in it. The programs do the rest. `c` and `c-ring` differ in how they receive a frame
 * (`peer_open`, `peer_receive`); `c-busy` is `c` with a busy-wait before each cycle start.
 *
 * A cycle: wait, receive the answer of the last cycle, process, send.
 */
#ifndef CATENARY_BENCH_PEER_H
#define CATENARY_BENCH_PEER_H

#include "machine.h" /* first, because it defines _GNU_SOURCE */

#include <arpa/inet.h>
#include <linux/if_ether.h>
#include <linux/if_packet.h>
#include <net/if.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

#define ETHERCAT 0x88A4
#define FRAME_MAX 1514
#define AXES_MAX 256
#define DATAGRAMS_MAX 16
#define REQUESTS_MAX 8
/* The phases of job.py: period, lateness, receive, process, send, tail, output_delay, input_age. */
#define PHASES 8

enum body { BODY_SINE = 0, BODY_PD = 1 };

/* Byte offsets into the frame of the cycle. */
struct axis {
    unsigned controlword, mode, target_position, target_torque;
    unsigned statusword, actual_position, actual_velocity;
    int32_t home;
};

struct datagram {
    unsigned offset, length, expected_counter;
};

/* A state to request while the cycle runs: the frame of the request, and the expected state. */
struct request {
    unsigned state, length;
    uint8_t frame[FRAME_MAX];
};

struct job {
    char interface[32], samples[512];
    int64_t period_ns, cycles, warm_up, busy_wait_ns;
    enum body body;
    double amplitude, counts_per_rad, counts_per_torque, stiffness, damping;
    unsigned length, al_status; /* of the frame; offset of the BRD's answer */
    uint8_t frame[FRAME_MAX];
    unsigned axis_count, datagram_count, request_count;
    struct axis axes[AXES_MAX];
    struct datagram datagrams[DATAGRAMS_MAX];
    struct request requests[REQUESTS_MAX];
};

/* The two functions in which the peers differ. `peer_receive` copies the oldest frame that has
 * arrived into `frame` and returns its length, or 0 if there is none. It does not wait. */
int peer_open(unsigned interface_index);
unsigned peer_receive(int socket, uint8_t *frame);

static inline uint16_t load16(const uint8_t *p) { return (uint16_t)(p[0] | p[1] << 8); }
static inline int32_t load32(const uint8_t *p) {
    int32_t value;
    memcpy(&value, p, 4);
    return value;
}
static inline void store16(uint8_t *p, uint16_t value) { memcpy(p, &value, 2); }
static inline void store32(uint8_t *p, int32_t value) { memcpy(p, &value, 4); }

static inline void fail(const char *what) {
    fprintf(stderr, "%s: %s\n", what, strerror(errno));
    exit(1);
}

#endif
