/* Common code of the C peers, independent of how a frame is received: see peer.h.
 *
 * The program reads the job from stdin, one `key value...` per line. It prints the result as one
 * line of JSON, and writes PHASES int64 [ns] per cycle to the file of samples. Like every peer, it
 * inherits scheduling and processor from the worker that starts it. */
#include "peer.h"

#include <math.h>

static struct job job;
static uint8_t sent[FRAME_MAX], received[FRAME_MAX + 64];
static int raw_socket;
static unsigned turn;

static unsigned read_hex(const char *text, uint8_t *bytes) {
    unsigned length = 0, value;
    while (length < FRAME_MAX && sscanf(text + 2 * length, "%2x", &value) == 1)
        bytes[length++] = (uint8_t)value;
    return length;
}

static void read_job(void) {
    static char line[2 * FRAME_MAX + 256], text[2 * FRAME_MAX + 2];
    while (fgets(line, sizeof line, stdin)) {
        struct axis a = {0};
        struct datagram d;
        unsigned state, body;
        if (sscanf(line, "interface %31s", job.interface) == 1) continue;
        if (sscanf(line, "samples %511s", job.samples) == 1) continue;
        if (sscanf(line, "period_ns %ld", &job.period_ns) == 1) continue;
        if (sscanf(line, "cycles %ld", &job.cycles) == 1) continue;
        if (sscanf(line, "warm_up %ld", &job.warm_up) == 1) continue;
        if (sscanf(line, "busy_wait_ns %ld", &job.busy_wait_ns) == 1) continue;
        if (sscanf(line, "amplitude %lf", &job.amplitude) == 1) continue;
        if (sscanf(line, "counts_per_rad %lf", &job.counts_per_rad) == 1) continue;
        if (sscanf(line, "counts_per_torque %lf", &job.counts_per_torque) == 1) continue;
        if (sscanf(line, "stiffness %lf", &job.stiffness) == 1) continue;
        if (sscanf(line, "damping %lf", &job.damping) == 1) continue;
        if (sscanf(line, "al_status %u", &job.al_status) == 1) continue;
        if (sscanf(line, "body %u", &body) == 1) {
            job.body = body ? BODY_PD : BODY_SINE;
        } else if (sscanf(line, "frame %3028s", text) == 1) {
            job.length = read_hex(text, job.frame);
        } else if (sscanf(line, "datagram %u %u %u", &d.offset, &d.length, &d.expected_counter) == 3
                   && job.datagram_count < DATAGRAMS_MAX) {
            job.datagrams[job.datagram_count++] = d;
        } else if (sscanf(line, "request %u %3028s", &state, text) == 2
                   && job.request_count < REQUESTS_MAX) {
            struct request *request = &job.requests[job.request_count++];
            request->state = state;
            request->length = read_hex(text, request->frame);
        } else if (sscanf(line, "axis %u %u %u %u %u %u %u", &a.controlword, &a.mode,
                          &a.target_position, &a.target_torque, &a.statusword, &a.actual_position,
                          &a.actual_velocity) == 7 && job.axis_count < AXES_MAX) {
            job.axes[job.axis_count++] = a;
        } else {
            fprintf(stderr, "invalid line in the job: %.60s\n", line);
            exit(2);
        }
    }
}

static void emit(void) {
    turn++;
    for (unsigned i = 0; i < job.datagram_count; i++)
        sent[job.datagrams[i].offset + 1] = (uint8_t)(turn & 0x7F);
    if (send(raw_socket, sent, job.length, 0) < 0) fail("send");
}

/* Return true if the answer to the last emit has arrived. Discard older frames. */
static int collect(void) {
    unsigned length;
    while ((length = peer_receive(raw_socket, received)) > 0)
        if (length >= job.length && received[job.datagrams[0].offset + 1] == (turn & 0x7F)) return 1;
    return 0;
}

static int counters_right(void) {
    for (unsigned i = 0; i < job.datagram_count; i++) {
        const struct datagram *d = &job.datagrams[i];
        if (load16(received + d->offset + 10 + d->length) != d->expected_counter) return 0;
    }
    return 1;
}

static unsigned enable_word(uint16_t status) {
    if ((status & 0x4F) == 0x08) return 0x80; /* fault: reset */
    if ((status & 0x6F) == 0x21) return 0x07; /* ready to switch on */
    if ((status & 0x6F) == 0x23) return 0x0F; /* switched on */
    if ((status & 0x6F) == 0x27) return 0x0F; /* operation enabled */
    return 0x06;
}

/* Move every drive one step towards "operation enabled" at a constant position. Return true if all
 * are enabled. */
static int enable(void) {
    unsigned enabled = 0;
    for (unsigned i = 0; i < job.axis_count; i++) {
        struct axis *a = &job.axes[i];
        uint16_t status = load16(received + a->statusword);
        enabled += (status & 0x6F) == 0x27;
        a->home = load32(received + a->actual_position);
        store16(sent + a->controlword, (uint16_t)enable_word(status));
        sent[a->mode] = job.body == BODY_PD ? 10 : 8;
        store32(sent + a->target_position, a->home);
        store16(sent + a->target_torque, 0);
    }
    return enabled == job.axis_count;
}

static void follow_sine(double t) {
    int32_t offset = (int32_t)(job.amplitude * sin(M_PI * t) * job.counts_per_rad);
    for (unsigned i = 0; i < job.axis_count; i++)
        store32(sent + job.axes[i].target_position, job.axes[i].home + offset);
}

static void pull_to_sine(double t) {
    double reference = job.amplitude * sin(M_PI * t);
    for (unsigned i = 0; i < job.axis_count; i++) {
        const struct axis *a = &job.axes[i];
        double position = (load32(received + a->actual_position) - a->home) / job.counts_per_rad;
        double velocity = load32(received + a->actual_velocity) / job.counts_per_rad;
        double torque = job.stiffness * (reference - position) - job.damping * velocity;
        store16(sent + a->target_torque, (uint16_t)(int16_t)(torque * job.counts_per_torque));
    }
}

/* Sleep until `busy_wait_ns` before the cycle start, then poll the clock. Return the time. */
static int64_t wait_for_start(int64_t start) {
    wait_until(start - job.busy_wait_ns);
    int64_t now = now_ns(CLOCK_MONOTONIC);
    while (now < start) now = now_ns(CLOCK_MONOTONIC);
    return now;
}

/* Run cycles until the BRD of the frame returns `state`, or for state 0 until the drives are
 * enabled. */
static int64_t reach(unsigned state, int64_t deadline) {
    for (int i = 0; i < 5000; i++) {
        deadline += job.period_ns;
        wait_until(deadline);
        int answered = collect();
        if (answered && state && (received[job.al_status] & 0x1F) == state) return deadline;
        if (answered && !state && enable()) return deadline;
        emit();
    }
    fprintf(stderr, "state %u was not reached in 5000 cycles (AL status 0x%02x)\n", state,
            received[job.al_status]);
    exit(1);
}

int main(void) {
    read_job();
    unsigned index = if_nametoindex(job.interface);
    if (!index) fail(job.interface);
    raw_socket = peer_open(index);
    int64_t total = job.warm_up + job.cycles, lost = 0, cpu = 0;
    int64_t *samples = calloc((size_t)(job.cycles * PHASES), sizeof *samples);
    if (!samples || job.datagram_count == 0) fail("job");
    memset(samples, 1, (size_t)(job.cycles * PHASES) * sizeof *samples); /* touch the pages */
    memcpy(sent, job.frame, job.length);
    lock_memory();

    int64_t deadline = now_ns(CLOCK_MONOTONIC) + job.period_ns;
    for (unsigned i = 0; i + 1 < job.request_count; i++) { /* the last one is for leaving */
        if (send(raw_socket, job.requests[i].frame, job.requests[i].length, 0) < 0) fail("send");
        deadline = reach(job.requests[i].state, deadline);
    }
    deadline = reach(0, deadline);
    emit();

    int64_t before = 0, sent_at = now_ns(CLOCK_MONOTONIC), start = deadline;
    for (int64_t cycle = 0; cycle < total; cycle++) {
        if (cycle == job.warm_up) cpu = now_ns(CLOCK_PROCESS_CPUTIME_ID);
        deadline += job.period_ns;
        int64_t woke = wait_for_start(deadline);
        int valid = collect() && counters_right();
        int64_t inputs_ready = now_ns(CLOCK_MONOTONIC);
        double t = (double)(deadline - start) * 1e-9;
        if (job.body == BODY_PD) pull_to_sine(t);
        else follow_sine(t);
        int64_t processed = now_ns(CLOCK_MONOTONIC);
        emit();
        int64_t out = now_ns(CLOCK_MONOTONIC);
        if (cycle >= job.warm_up) {
            int64_t *s = samples + (cycle - job.warm_up) * PHASES;
            s[0] = woke - before;
            s[1] = woke - deadline;
            s[2] = inputs_ready - woke;
            s[3] = processed - inputs_ready;
            s[4] = out - processed;
            s[6] = out - deadline;
            s[7] = inputs_ready - sent_at;
            lost += !valid;
            s[5] = now_ns(CLOCK_MONOTONIC) - out;
        }
        before = woke;
        sent_at = out;
    }
    cpu = now_ns(CLOCK_PROCESS_CPUTIME_ID) - cpu;

    const struct request *leave = &job.requests[job.request_count - 1];
    if (job.request_count && send(raw_socket, leave->frame, leave->length, 0) < 0) fail("send");
    FILE *file = fopen(job.samples, "wb");
    if (!file || fwrite(samples, sizeof *samples, (size_t)(job.cycles * PHASES), file)
                     != (size_t)(job.cycles * PHASES) || fclose(file)) fail(job.samples);
    printf("{\"lost\": %ld, \"cpu_ns\": %ld}\n", (long)lost, (long)cpu);
    return 0;
}
