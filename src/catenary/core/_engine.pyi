"""Engine: owns everything a cyclic exchange needs, and is the only way in from Python."""

from collections.abc import Callable

from catenary.core._clocks import Clock
from catenary.core._law import Law
from catenary.core._stream import Stream

class Engine:
    """Owns one cyclic exchange: frames, buffers, lane, histograms and, where the plan's order is
    threaded or law, its native thread. The thread that iterates is the only one that may call
    `next`, `run`, `spend`, `run_until_stopped` and write the target buffers; the lane has one
    thread of its own.

    `plan` is a catenary.plan.CyclePlan (read by attribute; ValueError names a number that cannot
    be); `link` a capsule "catenary.link". The caller keeps the link object alive until `stop`.
    `image`: a capsule "catenary.image", of somebody else who exchanges the process images: then
    the link is asked for the time alone, the plan's frames do not matter, and the lane is dead.
    On a link in virtual time every order runs in the caller's thread.
    """

    def __init__(self, plan: object, link: object, image: object = None) -> None: ...
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

    def start(self, origin_ns: int = 0) -> None:
        """Flushes the link, sets the first instant, starts the native thread. Nothing was
        committed yet: drives stay disabled, outputs zero (or as the target buffers say after
        the first `run` or `next`). Again after `stop`: continues. OSError if no thread can be had."""

    def next(self, timeout_ns: int = 0) -> int:
        """One step of the application: commits the target buffers, lets the next cycle happen,
        swaps in the newest actual values. Returns CYCLE_* flags.

        inline: emit, tail, wait for the instant, collect. threaded, law: wait for the newest
        cycle at most `timeout_ns` (0: a second and four periods). OSError when the link fails,
        KeyboardInterrupt and the like from signal handlers at once.
        """

    def commit_targets(self) -> None:
        """Commits the target buffers for the next `next`, where that has a thread of its own to
        wait for: with several engines all commit before the first one is waited for."""

    @property
    def origin(self) -> int:
        """The first instant there was [ns]; 0: not started yet. `start(origin_ns)` keeps to the grid
        of another engine."""

    def take_turns(self) -> None:
        """Several engines in one thread: their cycles may begin late within the period."""

    def run(self, cycles: int) -> int:
        """`cycles` cycles without an application, for start-up and leaving: goals, requests, modes,
        control bits and columns are committed, set-points not: axes hold their position (or stay at
        zero velocity, torque), CSV and CST axes are not enabled. Nobody is late meanwhile. Returns
        the flags of the last cycle. The GIL is released; signal handlers run at least every 10 ms.
        Afterwards the target buffers hold what was commanded last."""

    def spend(self, duration_ns: int) -> None:
        """In virtual time: lets time pass as if the application computed that long. The instants
        that fall into it happen without it (threaded, law) or are missed (inline). On a link
        whose time passes by itself: computes that long, without the GIL."""

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

    @property
    def disturbed(self) -> bool:
        """Whether, at the last collect, somebody did not answer or was not in OP without an error.
        From any thread."""

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
        """The last cycles, at most the plan's log_cycles, oldest first: records of RECORD_FIELDS."""

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
        """Waits, without the GIL, until a frame can be popped: True; or `timeout_ns`: False. In
        virtual time the thread that iterates calls it, and lets time pass no further than the next
        instant; in an order that collects at the instant itself it passes none."""

    def set_rehearsal(self, rehearsal: Callable[[], object] | None) -> None:
        """inline with a lead (`lead_ns` of the plan): called between waking and the instant, when at
        least a third of the lead is left; what it raises comes out of `next`."""

    @property
    def clock(self) -> Clock | None:
        """The distributed clocks; None where the plan has none."""

    # Sinks.
    def set_sink(self, capsule: object) -> None:
        """A capsule "catenary.sink" (native/sink.h) that is given every cycle behind its frames;
        None: nobody. RuntimeError while the engine runs; ValueError for a table of another version
        or of other blocks."""

    @property
    def sink_sizes(self) -> tuple[int, int, int]:
        """Bytes of the blocks a sink is given: record (RECORD_FIELDS), actual, target."""

    def sink_fields(
        self,
    ) -> tuple[dict[str, tuple[int, str, int | None]], dict[str, tuple[int, str, int | None]]]:
        """What lies in the blocks, (actual, target): name → (offset, NumPy format, count; None for a
        single number). `reals`, `integers`, `bits`: the columns, by bank."""

    # Laws.
    def law_fields(
        self,
    ) -> tuple[dict[str, tuple[int, str, int | None]], dict[str, tuple[int, str, int | None]]]:
        """The blocks a law works on, (actual, target): name → (offset, NumPy format, count; None for
        a single number). actual: n, ok, dt [s], position, velocity, torque, enabled, reals,
        integers, bits; target: position, velocity, torque, reals, integers, bits."""

    def blocks(self) -> tuple[memoryview, memoryview]:
        """The private buffers as the whole blocks of `law_fields`; the second is writable."""

    def start_law(self, law: Law) -> None:
        """From the next cycle on the law says the set-points and the output columns, natively, in
        the order "law", from what is commanded now. Goals, modes and control bits stay with the
        application. A law that runs already is stopped. While it runs, `next` overwrites the target
        buffers with what is commanded."""

    def stop_law(self) -> None:
        """The axes hold; the application says the targets again."""

    def run_law(self, duration_ns: int, trouble: int) -> int:
        """Waits without the GIL while the law runs: until it has ended, for `duration_ns`, or (where
        the caller's thread does the cycles) until one of the flags of `trouble` comes. Returns the
        flags of the newest cycle."""

    def set_stream(self, stream: Stream | None) -> None:
        """One row of it a cycle becomes the set-points, before the law if one runs; None: the
        application says them again, from what is commanded. While it has run dry the axes hold.
        ValueError for another number of axes."""
