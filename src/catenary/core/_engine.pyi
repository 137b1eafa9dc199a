"""Engine: owns everything a cyclic exchange needs, and is the only way in from Python."""

from typing import Final

# Flags that `next` and `run` return, and that `flags` keeps.
CYCLE_OK: Final[int]  # every needed sync unit answered in this cycle
CYCLE_LATE: Final[int]  # instants were skipped before this cycle (or Python missed cycles)
CYCLE_LIMITED: Final[int]  # the set-points sent last were limited on some axis
CYCLE_WORKING_COUNTER: Final[int]  # lost_limit cycles in a row were not ok: time to raise
CYCLE_DROPPED: Final[int]  # some axis' goal dropped to disabled in this cycle
CYCLE_REFUSED: Final[int]  # some target was NaN or infinite: the axis held instead
CYCLE_UNCOMMITTED: Final[int]  # threaded: no new targets were there at this instant
CYCLE_LAW_DONE: Final[int]  # the law returned "finished"
CYCLE_STOPPED: Final[int]  # the native thread has ended (stop, or an error of the link)
CYCLE_NONE: Final[int]  # timeout_ns passed without a new cycle: actual is unchanged

# Bits of axis_flags; bits 6 and 7 hold the goal in force (0 disabled, 1 enabled, 2 quick stop,
# 3 reset).
AXIS_FOLLOWED: Final[int]  # set-points are followed: enabled, in the asked mode, bit 12
AXIS_LIMITED: Final[int]  # the set-point sent last was limited
AXIS_DROPPED: Final[int]  # the goal dropped to disabled by itself since the last request
AXIS_REFUSED: Final[int]  # the committed target was NaN or infinite
AXIS_FALLBACK: Final[int]  # no fresh target: holding (position) or ramping to zero

RECORD_FIELDS: Final[list[tuple[str, str]]]
"""The fields of one record of `log()`, for `numpy.dtype(RECORD_FIELDS)`; no padding.

number u8 · scheduled_ns, wake_ns i8 (the link's clock) · period_ns, lateness_ns, receive_ns,
process_ns, send_ns, tail_ns, round_trip_ns i4 · flags u4 · lost_in_row, skipped u4 ·
missing_frames, al_counter u2 · al_status u1 ..."""

class Engine:
    """Owns one cyclic exchange: frames, buffers, lane, histograms and, where the plan's order is
    threaded or law, its native thread. The thread that iterates is the only one that may call
    `next`, `run`, `spend`, `run_until_stopped` and write the target buffers; the lane has one
    thread of its own.

    `plan` is a catenary.plan.CyclePlan (read by attribute; ValueError names a number that cannot
    be); `link` a capsule "catenary.link". The caller keeps the link object alive until `stop`.
    On a link in virtual time every order runs in the caller's thread.
    """

    def __init__(self, plan: object, link: object) -> None: ...
    @property
    def buffers(self) -> dict[str, memoryview]:
        """The private buffers, one per name of plan.wish.Views, typed ("d", "q", "I", "H", "b",
        "B"), for `numpy.asarray`. Read-only: actual_position, actual_velocity, actual_torque,
        statusword, mode_actual, axis_state, axis_flags, input_reals, input_integers, input_bits,
        and unit_valid ("B"), unit_counter ("H") per sync unit. Writable: target_position,
        target_velocity, target_torque, mode_target, goal, request, controlword_bits,
        output_reals, output_integers, output_bits.

        A quantity no object is mapped for reads NaN (velocity: estimated from the position).
        A goal is taken over when `request` of its axis has changed: goal[i] = 1; request[i] += 1.
        Until an axis is followed its targets are overwritten by each `next`/`run`: position by
        the actual one, velocity and torque by zero.
        """

    def start(self) -> None:
        """Flushes the link, sets the first instant, starts the native thread. Nothing was
        committed yet: drives stay disabled, outputs zero (or as the target buffers say after
        the first `run` or `next`). Again after `stop`: continues. OSError if no thread can be had."""

    def next(self, timeout_ns: int = 1_000_000_000) -> int:
        """One step of the application: commits the target buffers, lets the next cycle happen,
        swaps in the newest actual values. Returns CYCLE_* flags.

        inline: emit, tail, wait for the instant, collect. threaded, law: wait for the newest
        cycle at most `timeout_ns`. OSError when the link fails, KeyboardInterrupt and the like
        from signal handlers at once.
        """

    def run(self, cycles: int) -> int:
        """`cycles` cycles without an application, for start-up and leaving: goals, requests, modes,
        control bits and columns are committed, set-points not: axes hold their position (or stay at
        zero velocity, torque), CSV and CST axes are not enabled. Nobody is late meanwhile. Returns
        the flags of the last cycle. The GIL is released; signal handlers run at least every 10 ms.
        Afterwards the target buffers hold what was commanded last."""

    def spend(self, duration_ns: int) -> None:
        """In virtual time: lets time pass as if the application computed that long. The instants
        that fall into it happen without it (threaded, law) or are missed (inline). RuntimeError
        on a link whose time passes by itself."""

    def quick_stop_all(self) -> None:
        """Every axis' goal becomes quick stop, then disabled, from the next emit on; what follows
        needs a new request. From any thread."""

    def run_until_stopped(self, timeout_ns: int) -> bool:
        """`run` until no axis moves under power (each is disabled, in fault, or its unit lost):
        True; or until `timeout_ns` have passed: False."""

    def stop(self) -> None:
        """Ends the native thread and gives the link back. Harmless when not running."""

    def now(self) -> int:
        """The link's clock [ns]."""

    # The cycle that `actual` belongs to.
    @property
    def number(self) -> int:
        """Cycles done, from 1 for the first; 0 before."""
    @property
    def time_ns(self) -> int:
        """Its instant, counted from the first one of `start`: a multiple of the period."""
    @property
    def flags(self) -> int: ...
    @property
    def lost_in_row(self) -> int:
        """Cycles in a row, up to this one, that were not ok."""
    @property
    def skipped(self) -> int:
        """Instants skipped before this cycle."""
    @property
    def missing_frames(self) -> int: ...
    @property
    def al_status(self) -> int:
        """OR of all AL states, bit 4: some device signals an error; last one that came back."""
    @property
    def al_counter(self) -> int:
        """How many devices answered the AL status datagram in this cycle."""

    # Figures. Exact after `stop`; while the native thread runs they may be one cycle apart.
    @property
    def counters(self) -> dict[str, int]:
        """Since construction: cycles, lost (cycles not ok), late (instants skipped), uncommitted
        (instants without new targets), stale, alien, corrupt, duplicate, unprocessed (frames),
        lane_sent, lane_received, lane_dropped, send_errors, receive_errors."""

    def histograms(self) -> dict[str, dict[str, float]]:
        """Per phase (period, lateness, receive, process, send, tail, round_trip, in_controller):
        count and mean, min, max, sd, p50, p99, p999 in us (empty phases: count 0 only)."""

    def histogram_counts(self, phase: str) -> list[tuple[float, float, int]]:
        """(lower, upper, count) of every bucket that is not empty, in us, for plotting."""

    def reset_histograms(self) -> None:
        """Forgets the figures so far (start-up, say)."""

    def log(self) -> bytes:
        """The last cycles, at most 1000, oldest first: records of RECORD_FIELDS."""

    @property
    def scheduling(self) -> str:
        """What was obtained: "SCHED_FIFO 80, CPU 1", "SCHED_OTHER: not permitted (EPERM)",
        "virtual time"."""

    # The acyclic lane.
    def lane_push(self, frame: bytes) -> bool:
        """Queues one whole Ethernet frame (index of its first datagram 0x80 to 0xFF) to be sent
        after a cyclic one; False when the queue (64) is full. ValueError for a frame that is no
        EtherCAT frame or has an index of the cycle."""

    def lane_pop(self) -> bytes | None:
        """The oldest acyclic frame that came back, or None."""

    def lane_wait(self, timeout_ns: int) -> bool:
        """Waits, without the GIL, until a frame can be popped: True; or `timeout_ns`: False."""

    # For the law order; step 2 compiles laws, the place is here.
    def set_law(self, law: object) -> None:
        """A capsule "catenary.law" (native/law.h), called natively between collect and emit in the
        order "law"; None: hold. Only while stopped."""
