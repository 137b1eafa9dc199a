# cython: boundscheck=False, wraparound=False, cdivision=True
"""Distributed clocks in the cycle: time in the frames, phase of the cycle starts, supervision.

The send time of every frame is recorded. The time that the reference clock wrote into it gives the
phase of its cycle start. A PI controller with decreasing bandwidth corrects phase errors by longer
or shorter periods. docs/explanation/distributed_clocks.md explains its gains; plan/clocks.py
contains the numbers. If the clocks follow the MainDevice, the cycle starts are set in phase once
and stay on their grid. tests/core/phase_twin.py is a Python model of the controller. Budget: 60 ns
per cycle.

A reference that does not answer is no longer read in each frame. A device that was switched off
returns with a different time, which must not reach the other clocks. All other clocks then follow
the time in the frame, which the core continues. The reference is probed periodically, and leads
again once its time agrees.
"""

from libc.math cimport fabs
from libc.stdint cimport int32_t, int64_t, uint8_t, uint16_t, uint32_t, uint64_t

from catenary.core._memory cimport cat_memory_free, memory_take
from catenary.core._native cimport CAT_FPRD, CAT_FRMW

cdef enum:
    HOLD = 2                   # an answer belongs to a cycle start that was fixed two cycles before
    REJECTED_MAX = 8           # errors beyond `step` in a row that mean a jump of the clock
    SILENT_MAX = 16            # cycles without an answer until the core continues the reference's time
    PROBED = 0xFFFFFFFF
    PROBE_EVERY = 8            # cycles between two probes of a lost reference
    ADP = 2                    # offset in a datagram's header
    ADO = 4
    DATA = 10
    NO_STATION = 0xFFFF        # as in IgH; a device has address 0 after power-on
    SYSTEM_TIME = 0x0910
    DIFFERENCE = 0x092C
    SETTLE = 16                # cycles within the bound, in addition to one round of all followers

cdef double FIRST_BANDWIDTH = 1.0 / 16
cdef double SLOWING = 0.25     # growth of the time constant per cycle [cycles]
cdef double MEAN_SHARE = 1.0 / 16
cdef double DIFFERENCE_SHARE = 1.0 / 8


# ---- the phase controller

cdef inline double bounded(double value, double limit) noexcept nogil:
    return limit if value > limit else -limit if value < -limit else value


cdef inline int64_t wrapped(int64_t value, int64_t period) noexcept nogil:
    """Return the value wrapped into ± half a period."""
    value %= period
    if value >= period - period // 2:
        value -= period
    elif value < -(period // 2):
        value += period
    return value


cdef int64_t moved(phase_t *p, double by) noexcept nogil:
    """Return the whole nanoseconds of a correction; keep the remainder."""
    cdef int64_t whole
    by += p.residue
    whole = <int64_t>by
    p.residue = by - whole
    return whole


cdef int64_t phase_coast(phase_t *p) noexcept nogil:
    """Return the shift for a cycle without an answer: the drift found so far."""
    return moved(p, p.drift) if p.state == FOLLOWING else 0


cdef int64_t phase_seek(phase_t *p, int64_t error) noexcept nogil:
    """Change to FOLLOWING. Return the delay that sets the cycle starts in phase at once. No cycle
    starts early.
    """
    p.state = FOLLOWING
    p.hold = HOLD
    p.rejected = 0
    p.bandwidth = FIRST_BANDWIDTH if FIRST_BANDWIDTH > p.bandwidth_end else p.bandwidth_end
    p.mean = 0
    return -error if error <= 0 else p.period - error


cdef int64_t phase_step(phase_t *p, int64_t error) noexcept nogil:
    """Return the shift of the next cycle start for an error within ± half a period (positive:
    late).

    Single errors beyond `step` are outliers. Several in a row mean that the clock has jumped. The
    jump is corrected within the rate limit, about as fast as the other clocks follow. If the
    cycle starts jumped as well, frames would arrive after the SYNC signals of the other clocks.
    """
    cdef double wanted, applied, gain
    if p.state == SEEKING:
        return phase_seek(p, error)
    if p.hold:
        p.hold -= 1
        return phase_coast(p)
    if -p.step <= error <= p.step:
        p.rejected = 0
    elif p.rejected < REJECTED_MAX:
        p.ignored += 1
        p.rejected += 1
        if p.rejected == REJECTED_MAX:
            p.jumps += 1
        return phase_coast(p)
    p.mean += (error - p.mean) * MEAN_SHARE
    wanted = p.drift - 2 * p.bandwidth * error
    applied = bounded(wanted, p.rate_limit)
    if applied == wanted or (wanted > 0) == (error > 0):  # anti-windup: integrate only inwards
        gain = p.bandwidth * p.bandwidth
        p.drift = bounded(p.drift - gain * error, p.drift_limit)
    p.bandwidth = p.bandwidth / (1 + SLOWING * p.bandwidth)
    if p.bandwidth < p.bandwidth_end:
        p.bandwidth = p.bandwidth_end
    return moved(p, applied)


# ---- the time in the frame

cdef inline void put32(uint8_t *field, uint32_t value) noexcept nogil:
    field[0] = value & 0xFF
    field[1] = (value >> 8) & 0xFF
    field[2] = (value >> 16) & 0xFF
    field[3] = value >> 24


cdef inline uint32_t word32(const uint8_t *data) noexcept nogil:
    return data[0] | <uint32_t>data[1] << 8 | <uint32_t>data[2] << 16 | <uint32_t>data[3] << 24


cdef inline void put16(uint8_t *field, uint16_t value) noexcept nogil:
    field[0] = value & 0xFF
    field[1] = value >> 8


cdef inline int64_t expected_time(const clock_t *k, int64_t now) noexcept nogil:
    """Return the reference time expected for a frame that leaves now, at the estimated rate."""
    cdef int64_t since
    if k.follows_main or k.samples == 0:
        return now + k.epoch
    since = now - k.time_sent
    return k.time + since - <int64_t>(since * (k.phase.drift / k.phase.period))


cdef void ask(clock_t *k) noexcept nogil:
    """Select the follower that the frame reads; periodically probe a lost reference instead."""
    if k.holding and k.silent % PROBE_EVERY == 0:
        k.asked = PROBED
        put16(k.watch_header + ADP, k.reference)
        put16(k.watch_header + ADO, SYSTEM_TIME)
        return
    k.turn = k.turn + 1 if k.turn + 1 < k.follower_count else 0
    k.asked = k.turn
    put16(k.watch_header + ADP, k.followers[k.turn].station)
    put16(k.watch_header + ADO, DIFFERENCE)


cdef void clock_emit(clock_t *k, int64_t now) noexcept nogil:
    """Write the time into the frame right before it leaves. Devices without a reference before them
    receive the expected reference time, so that they continue undisturbed.
    """
    k.payload = <uint32_t>expected_time(k, now)
    put32(k.time_header + DATA, k.payload)
    put16(k.time_header + ADP, NO_STATION if k.holding else k.reference)
    if k.main_header != NULL:
        put32(k.main_header + DATA, <uint32_t>(now + k.epoch))
    if k.watch_header != NULL:
        ask(k)
    k.sent = now
    k.sent_scheduled = k.scheduled
    k.awaited = 1


cdef void take_time(clock_t *k, const uint8_t *data, uint16_t counter) noexcept nogil:
    cdef uint32_t low = word32(data)
    cdef int64_t expected = expected_time(k, k.sent)
    if k.holding or counter == 0 or (low == k.payload and counter != k.listeners):
        return  # not read by the reference: the other devices received our own time
    k.time = expected + <int32_t>(low - <uint32_t>expected)
    k.time_sent = k.sent
    k.samples += 1
    k.sampled = 1


cdef void take_probe(clock_t *k, uint32_t low) noexcept nogil:
    """Let the reference lead again if it answers and its time agrees with ours."""
    cdef int32_t error = <int32_t>(low - k.payload)
    if -k.phase.step <= error <= k.phase.step:
        k.holding = 0
        k.silent = 0


cdef void take_difference(clock_t *k, const uint8_t *data, uint16_t counter) noexcept nogil:
    """Store a difference, or evaluate a probe. 0x092C is a sign-magnitude number. If a device does
    not answer, its last difference is kept; its process data reports the loss.
    """
    cdef follower_t *f
    cdef uint32_t raw = word32(data)
    cdef int32_t value = <int32_t>(raw & 0x7FFFFFFF)
    cdef int32_t magnitude = value
    cdef uint8_t outside
    if counter != 1:
        return
    if k.asked == PROBED:
        take_probe(k, raw)
        return
    f = &k.followers[k.asked]
    if raw >> 31:
        value = -value
    f.last = value
    f.mean = <double>value if f.reads == 0 else f.mean + (value - f.mean) * DIFFERENCE_SHARE
    f.reads += 1
    if magnitude > f.worst:
        f.worst = magnitude
    outside = fabs(f.mean) > k.bound
    k.outside += outside
    k.outside -= f.outside
    f.outside = outside


cdef void clock_take(clock_t *k, uint8_t command, const uint8_t *data,
                     uint16_t counter) noexcept nogil:
    """Evaluate one datagram of a returned frame; a no-op from `clock_close` to the next emit."""
    if not k.awaited:
        return
    if command == CAT_FRMW:
        take_time(k, data, counter)
    elif command == CAT_FPRD:
        take_difference(k, data, counter)


# ---- the end of a cycle's input

cdef int64_t follow_reference(clock_t *k) noexcept nogil:
    """Return the shift for the phase error of the cycle start, corrected for the send delay."""
    cdef int64_t at_instant
    if not k.sampled:
        return phase_coast(&k.phase)
    at_instant = k.time - (k.time_sent - k.sent_scheduled)
    k.error = wrapped(at_instant - k.target, k.phase.period)
    return phase_step(&k.phase, k.error)


cdef int64_t lead_reference(clock_t *k) noexcept nogil:
    """Return the shift that sets the cycle starts in phase with our own time; 0 afterwards. Measure
    the error of the reference.
    """
    if k.sampled:
        if k.phase.hold:
            k.phase.hold -= 1
        k.error = k.time - (k.time_sent + k.epoch)
        k.phase.mean += (k.error - k.phase.mean) * MEAN_SHARE
    if k.phase.state == SEEKING:
        return phase_seek(&k.phase,
                          wrapped(k.scheduled + k.epoch - k.target, k.phase.period))
    return 0


cdef void take_bound(clock_t *k) noexcept nogil:
    """Apply a new bound: evaluate all differences again, and clear `locked`."""
    cdef uint32_t i
    k.bound = k.bound_asked
    k.outside = 0
    for i in range(k.follower_count):
        k.followers[i].outside = k.followers[i].reads == 0 or fabs(k.followers[i].mean) > k.bound
        k.outside += k.followers[i].outside
    k.good = 0
    if k.locked:
        k.locked = 0
        k.changes += 1


cdef void watch(clock_t *k) noexcept nogil:
    """Update `locked`: set it after some time within the bound, clear it at once outside."""
    cdef bint good = (k.phase.state == FOLLOWING and k.phase.hold == 0 and k.samples > 0
                      and k.silent < SILENT_MAX and k.outside == 0
                      and fabs(k.phase.mean) <= k.bound)
    if not good:
        k.good = 0
        if k.locked:
            k.locked = 0
            k.changes += 1
    elif not k.locked:
        k.good += 1
        if k.good > SETTLE + k.follower_count:
            k.locked = 1
            k.changes += 1


cdef int64_t clock_close(clock_t *k) noexcept nogil:
    """Update the figures after the frames of a cycle were collected. Return the shift of the next
    cycle start [ns]; 0 before the first emit.
    """
    cdef int64_t move, magnitude
    if k.sent == 0:
        return 0
    if k.bound != k.bound_asked:
        take_bound(k)
    move = lead_reference(k) if k.follows_main else follow_reference(k)
    if k.sampled:
        k.silent = 0
        magnitude = -k.error if k.error < 0 else k.error
        if magnitude > k.worst_error:
            k.worst_error = magnitude
    else:
        k.silent += 1
        k.missed += 1
        if k.silent >= SILENT_MAX and k.samples > 0 and k.watch_header != NULL:
            k.holding = 1
    watch(k)
    k.awaited = 0
    k.sampled = 0
    return move


# ---- Python interface

cdef set_phase(phase_t *p, plan, int64_t period_ns):
    if not (0 < plan.bandwidth <= 0.25 and 0 <= plan.rate_limit_ns <= 0.1 * period_ns
            and 0 <= plan.drift_limit_ns <= plan.rate_limit_ns and 0 < plan.step_ns < period_ns):
        raise ValueError(f"clock: parameters of the phase controller are out of range: {plan}")
    p.period = period_ns
    p.bandwidth_end = plan.bandwidth
    p.rate_limit = plan.rate_limit_ns
    p.drift_limit = plan.drift_limit_ns
    p.step = plan.step_ns


cdef class PhaseController:
    """Controller that computes corrections of the cycle start from phase errors."""
    cdef phase_t c

    def __cinit__(self, plan, int64_t period_ns):
        set_phase(&self.c, plan, period_ns)

    def step(self, error_ns):
        """Advance the controller by one cycle. Return the shift of the next cycle start [ns].

        Args:
            error_ns: Phase error of the last cycle start [ns], at most half a period; positive if
                the start was late. None if the reference did not answer in this cycle.
        """
        return phase_coast(&self.c) if error_ns is None else phase_step(&self.c, error_ns)

    @property
    def drift(self):
        return self.c.drift

    @property
    def bandwidth(self):
        return self.c.bandwidth

    @property
    def jumps(self):
        return self.c.jumps


cdef class Clock:
    def __cinit__(self, plan, int64_t period_ns):
        set_phase(&self.c.phase, plan, period_ns)
        if plan.follow not in ("reference", "main"):
            raise ValueError(f"clock: follow {plan.follow!r}, must be 'reference' or 'main'")
        if len(plan.stations) > 0xFFFF or not 0 <= plan.phase_ns < period_ns:
            raise ValueError(
                f"clock: {len(plan.stations)} followers (at most 65535), phase {plan.phase_ns} ns"
                f" (must be 0 to {period_ns - 1})"
            )
        self.c.follows_main = plan.follow == "main"
        self.c.reference = plan.reference_station
        self.c.target = plan.phase_ns
        self.c.bound = plan.bound_ns
        self.c.bound_asked = plan.bound_ns
        self.c.follower_count = len(plan.stations)
        self.c.followers = <follower_t *>memory_take(
            &self.memory, len(plan.stations) + 1, sizeof(follower_t)
        )
        for number, station in enumerate(plan.stations):
            self.c.followers[<uint32_t>number].station = station
            self.c.followers[<uint32_t>number].outside = 1
        self.c.outside = self.c.follower_count

    def figures(self):
        """Return the figures of the clocks; all times in ns.

        - locked: True if clocks and phase error have been within the bound for a number of cycles.
        - bound: the bound in force.
        - following: True once the cycle starts were set in phase.
        - time: last system time of the reference clock.
        - time_sent: link time at which the frame that read it was sent.
        - error, mean_error, worst_error: phase error of the cycle starts. If the reference clock
          follows the MainDevice, this is the error of the reference clock.
        - rate: deviation of the reference clock's rate from the link clock's, as a ratio.
        - samples: number of times that the reference clock was read.
        - missed, silent: number of cycles without its answer, in total and in a row.
        - holding: True while the core continues the time of a lost reference clock.
        - ignored: number of samples rejected as outliers. jumps: number of jumps of the clock.
        """
        cdef clock_t *k = &self.c
        return {
            "locked": bool(k.locked),
            "bound": k.bound,
            "following": k.phase.state == FOLLOWING,
            "time": k.time,
            "error": k.error,
            "mean_error": k.phase.mean,
            "worst_error": k.worst_error,
            "rate": -k.phase.drift / k.phase.period,
            "samples": k.samples,
            "missed": k.missed,
            "silent": k.silent,
            "holding": bool(k.holding),
            "time_sent": k.time_sent,
            "ignored": k.phase.ignored,
            "jumps": k.phase.jumps,
        }

    def differences(self):
        """Return (mean, last, largest magnitude, number of reads) for each follower.

        The difference is 0x092C, local minus reference time [ns].
        """
        cdef uint32_t i
        return [
            (self.c.followers[i].mean, self.c.followers[i].last, self.c.followers[i].worst,
             self.c.followers[i].reads)
            for i in range(self.c.follower_count)
        ]

    def reset_figures(self):
        cdef uint32_t i
        self.c.worst_error = 0
        for i in range(self.c.follower_count):
            self.c.followers[i].worst = 0

    def keep_within(self, int64_t bound_ns):
        if bound_ns <= 0:
            raise ValueError(f"clock: bound {bound_ns} ns, must be positive")
        self.c.bound_asked = bound_ns

    def set_epoch(self, int64_t epoch_ns):
        self.c.epoch = epoch_ns

    @property
    def changes(self):
        """Number of times the clocks were locked or unlocked. Reading it clears CYCLE_CLOCKS."""
        self.c.acknowledged = self.c.changes
        return self.c.changes

    def __dealloc__(self):
        cat_memory_free(&self.memory)
