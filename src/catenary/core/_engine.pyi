"""Engine: owner of all parts of a cyclic exchange and their only interface to Python."""

from catenary.core._clocks import Clock
from catenary.core._law import Law
from catenary.core._stream import Stream
from catenary.core._trigger import TriggerBlock

class Engine:
    """Owner of one cyclic exchange: frames, buffers, acyclic queue, histograms, native thread.

    Only the thread that iterates may call `next`, `run`, `spend` and `run_until_stopped`, and write
    the target buffers. The acyclic queue has one thread of its own. The threaded mode has a native
    thread. On a link in virtual time both modes run in the caller's thread.

    Args:
        plan: A catenary.plan.CyclePlan, read by attribute.
        link: A capsule "catenary.link"; the caller keeps the link object alive until `stop`.
        image: A capsule "catenary.image" of another master that exchanges the process images. The
            link is then used only for the time; the plan's frames and the queue are not used.

    Raises:
        ValueError: A number of the plan is out of range.
    """

    def __init__(self, plan: object, link: object, image: object = None) -> None: ...
    @property
    def buffers(self) -> dict[str, memoryview]:
        """Private buffers, one per name of plan.request.Views.

        They are typed ("d", "q", "Q", "I", "H", "b", "B"), for `numpy.asarray`. Read-only:
        actual_position, actual_velocity, actual_torque, statusword, mode_actual, axis_state,
        axis_flags, stop_reason, stop_cycle, input_reals, input_integers, input_bits, input_bytes,
        and unit_valid ("B"), unit_counter ("H") per sync unit. Writable: target_position,
        target_velocity, target_torque, mode_target, requested_state, request, controlword_bits,
        output_reals, output_integers, output_bits, output_bytes.

        A quantity that is not mapped reads NaN; a velocity is then estimated from the position. A
        requested state takes effect when `request` of its axis changes: requested_state[i] = 1;
        request[i] += 1. Until an axis is followed, each `next` and `run` overwrites its targets
        with the values sent to it: position (held if powered, otherwise actual), velocity and
        torque.
        """

    def start(self, origin_ns: int = 0) -> None:
        """Start the cycles: flush the link, set the first cycle start, start the native thread.

        In real time, the memory of the cycle is locked if the system permits it. An inline loop
        then also gives the calling thread the plan's priority and CPU until `stop`. Until the first
        commit, drives stay disabled and outputs are zero. After `stop`, the grid of cycle starts
        continues.

        Args:
            origin_ns: First cycle start, which defines the grid [ns]; 0: one period from now.

        Raises:
            OSError: The native thread cannot be started.
            RuntimeError: The engine is already running, or this is a forked child.
        """

    def next(self, timeout_ns: int = 0) -> int:
        """Commit the target buffers, let the next cycle run, and swap in the newest actual values.

        inline: send, wait for the cycle start, collect. threaded: wait for the newest cycle for at
        most `timeout_ns` (0: one second and four periods).

        Returns:
            The CYCLE_* flags.

        Raises:
            OSError: The link has failed.
            RuntimeError: The engine is not running.
            KeyboardInterrupt: Raised at once, like other exceptions of signal handlers.
        """

    def commit_targets(self) -> None:
        """Commit the target buffers before `next`; a no-op in the inline mode.

        With several engines, commit all of them before waiting for the first one.
        """

    @property
    def led(self) -> bool:
        """True if a law that has begun, or a stream, sets the targets."""

    def keep_targets(self) -> None:
        """Skip the commit of the following `next`; a no-op in the inline mode."""

    background: bool
    """True if a thread repeats the targets of a program.

    CSP then has no late limit. After an update, set-points of CSV and CST are valid until the
    command timeout; then their targets are the commanded values. In the inline mode, setting it
    raises ValueError.
    """

    def begin_update(self) -> None:
        """Allow a thread other than the iterating one to write the target buffers.

        Until `end_update`, `next` does not change them. Only one thread at a time may make an
        update, and it must prevent the iterating thread from committing.
        """

    def end_update(self, commit: bool) -> None:
        """End an update; if `commit`, commit the target buffers as an update in the background."""

    @property
    def origin(self) -> int:
        """First cycle start [ns]; 0 before `start`.

        Pass it to `start` of another engine, to put both on the same grid.
        """

    def take_turns(self) -> None:
        """Allow a cycle to begin at any time in its period, for several engines in one thread.

        No effect if the engine has a native thread.
        """

    def run(self, cycles: int) -> int:
        """Run cycles without an application (a hand-over), for start-up and shutdown.

        Requests, modes, control bits and columns are committed; set-points are not. CSV and CST
        axes are not enabled. The GIL is released; signal handlers run at least every 10 ms.
        Afterwards the target buffers contain the last commanded values.

        Returns:
            The flags of the last cycle. With CYCLE_STOPPED or CYCLE_NONE, not all cycles have run.

        Raises:
            OSError: The link has failed.
            RuntimeError: The engine is not running.
        """

    def spend(self, duration_ns: int) -> None:
        """Let virtual time pass as if the application computed for this long.

        The cycles in this time run without it (threaded) or are missed (inline). In real time,
        compute for this long without the GIL.

        Raises:
            OSError: The link has failed.
            RuntimeError: The engine is not running.
            ValueError: The duration is negative.
        """

    def quick_stop_all(self) -> None:
        """Stop every axis with the next frames. Afterwards, each axis needs a new request.

        Any thread may call it.
        """

    def end_copies(self) -> None:
        """Send zeros instead of the copies between devices, from the next cycle on.

        Any thread may call it.
        """

    def run_until_stopped(self, timeout_ns: int) -> bool:
        """Run until every axis is disabled, in fault or lost.

        Returns:
            True if every axis is; False if `timeout_ns` passed or the cycles ended first.

        Raises:
            OSError: The link has failed.
            RuntimeError: The engine is not running.
        """

    def stop(self) -> None:
        """End the native thread and restore the scheduling of the calling thread (inline).

        A no-op if the engine is not running.
        """

    def forget(self) -> None:
        """Release the parent's cycle in a forked child, without an effect on the parent.

        The scheduling of the calling thread is restored. Every later call that needs cycles raises
        RuntimeError.
        """

    def now(self) -> int:
        """Return the link's time [ns]."""

    @property
    def scheduled_ns(self) -> int:
        """Cycle start of the newest cycle [ns], on the link's clock. Any thread may read it."""

    def steer(self, rate: float) -> None:
        """Lengthen every period by this relative rate until the next call. Any thread may call it.

        A reference clock that follows the MainDevice keeps its phase against the cycle starts.

        Args:
            rate: Relative change of the period, at most 1e-3 in magnitude; positive: longer.

        Raises:
            ValueError: The rate is out of range.
        """

    @property
    def zero_ns(self) -> int:
        """Cycle start of the first iteration [ns], on the link's clock: the zero of `Cycle.time`.

        0 before the first iteration. Engines of one loop share that of the first one.
        """

    @zero_ns.setter
    def zero_ns(self, zero: int) -> None: ...

    # Properties of the cycle of the current actual values.
    @property
    def number(self) -> int:
        """Number of the cycle; 1 for the first one."""
    @property
    def time_ns(self) -> int:
        """Cycle start [ns] since the first one of `start`, on the link's clock.

        A multiple of the period, unless the cycle starts follow the reference clock.
        """
    @property
    def flags(self) -> int: ...
    @property
    def lost_in_row(self) -> int:
        """Number of cycles in a row, up to this one, that were not ok."""
    @property
    def skipped(self) -> int:
        """Number of cycles skipped before this one."""
    @property
    def missing_frames(self) -> int: ...
    @property
    def al_status(self) -> int:
        """OR of the AL states in the last returned frame; bit 4: a device reports an error."""
    @property
    def al_counter(self) -> int:
        """Number of devices that answered the AL status datagram in this cycle."""

    @property
    def disturbed(self) -> bool:
        """True if a device did not answer in the last cycle, was not in OP, or reported an error.

        Any thread may read it.
        """

    # Figures. Exact after `stop`; while the native thread runs, they may differ by one cycle.
    @property
    def counters(self) -> dict[str, int]:
        """Counts since construction.

        - cycles; lost: cycles that were not ok; late: skipped cycles; uncommitted: cycles without
          new targets; underrun: cycles that found the stream empty.
        - missed_sync: cycles whose frames left later than the margin before SYNC0.
        - missed_triggers: cycles that began without the trigger of another process.
        - page_faults: page faults of the native thread, in runs that have ended.
        - stale, alien, corrupt, duplicate, repeated, unprocessed: frames that were received but not
          used (core/_frames.pxd).
        - acyclic_sent, acyclic_received, acyclic_dropped: frames of the acyclic queue.
        - send_errors, receive_errors.
        """

    def histograms(self) -> dict[str, dict[str, float]]:
        """Return count, mean, min, max, sd, p50, p99, p999 [s] of each phase (core/_cycle.pyx).

        An empty phase has only its count, 0.
        """

    def histogram_counts(self, phase: str) -> list[tuple[float, float, int]]:
        """Return (lower [s], upper [s], count) for every bucket of a phase that is not empty.

        Raises:
            ValueError: The phase is unknown.
        """

    def reset_histograms(self) -> None:
        """Clear the histograms, for example after the start-up."""

    def log(self) -> bytes:
        """Return the records (RECORD_FIELDS) of the last cycles, oldest first.

        With the plan's `log_axes`, each is followed by one record (AXIS_FIELDS) for each axis:
        measured values, the targets sent in the frames that read them (for a law, the targets
        computed from them) and the values sent.
        """

    @property
    def scheduling(self) -> str:
        """Scheduling and memory obtained; "virtual time" for a link in virtual time.

        "SCHED_FIFO 80, CPU 1, 1.7 MB locked", or "SCHED_OTHER: not permitted (EPERM), 1.6 MB
        locked, 10 MB touched only (ENOMEM, RLIMIT_MEMLOCK 8 MB: raise `ulimit -l`, or grant
        CAP_IPC_LOCK)". Cycle buffers are locked first, the log last. Memory that is only touched
        causes no page faults while the system has enough of it.
        """

    # The acyclic queue.
    def acyclic_push(self, frame: bytes) -> bool:
        """Queue one Ethernet frame, to be sent after the cyclic ones.

        The index of its first datagram must be 0x80 to 0xFF.

        Returns:
            False if the queue (64 frames) is full.

        Raises:
            ValueError: The frame is not EtherCAT, its size is not 60 to 1514 bytes, or its index
                belongs to the cycle.
        """

    def acyclic_pop(self) -> bytes | None:
        """Return the oldest acyclic frame that has returned, or None."""

    def acyclic_wait(self, timeout_ns: int) -> bool:
        """Wait, without the GIL, until an acyclic frame has returned.

        In virtual time, the thread that iterates calls it. Time then passes up to the next cycle
        start (threaded) or not at all (inline).

        Returns:
            True if a frame has returned. False after `timeout_ns`; earlier after a signal, or if
            virtual time does not pass any further.
        """

    @property
    def clock(self) -> Clock | None:
        """Distributed clocks; None if the plan does not use them."""

    # Sinks.
    def set_sink(self, capsule: object) -> None:
        """Pass every cycle, after its frames, to a sink: a capsule "catenary.sink" (native/sink.h).

        Args:
            capsule: The sink; None to remove it.

        Raises:
            RuntimeError: The engine is running.
            ValueError: The table has another version, other block sizes, or motion words of
                another number of axes.
        """

    @property
    def stopper(self) -> int:
        """Process that last requested a stop through the motion words of the sink; 0 if unknown."""

    @property
    def sink_sizes(self) -> tuple[int, int, int]:
        """Sizes of a sink's blocks [bytes]: record (RECORD_FIELDS), actual, target."""

    def sink_fields(
        self,
    ) -> tuple[dict[str, tuple[int, str, int | None]], dict[str, tuple[int, str, int | None]]]:
        """Return the layout of a sink's blocks, (actual, target).

        Each maps a name to (offset, NumPy format, count; None for a single number). `reals`,
        `integers` and `bits` are the columns, by bank.
        """

    # Laws.
    def law_fields(
        self,
    ) -> tuple[dict[str, tuple[int, str, int | None]], dict[str, tuple[int, str, int | None]]]:
        """Return the layout of a law's blocks, (actual, target).

        Each maps a name to (offset, NumPy format, count; None for a single number). actual: n, ok,
        dt [s], position, velocity, torque, enabled, reals, integers, bits; target: position,
        velocity, torque, reals, integers, bits.
        """

    def blocks(self) -> tuple[memoryview, memoryview]:
        """Return the private buffers as the blocks of `law_fields`; the second is writable."""

    def start_law(self, law: Law) -> None:
        """Start a compiled law, which computes the set-points in the cycle thread.

        From the next cycle on, it also computes the output columns. It begins with the commanded
        values and replaces a running law. The application still sets the requested states, modes
        and control bits. While the law runs, `next` overwrites the target buffers with the
        commanded values.

        Raises:
            OSError: The monitor thread cannot be started.
            RuntimeError: The engine is not running.
            ValueError: The budget leaves too little of the period for the frames.
        """

    def stop_law(self) -> None:
        """Stop the law; a hand-over follows until the application commits targets."""

    def run_law(self, duration_ns: int, trouble: int) -> int:
        """Wait without the GIL until the law has ended; a signal may end the wait early.

        Without a native thread, the cycles run in the caller's thread meanwhile.

        Args:
            duration_ns: Longest wait [ns].
            trouble: Flags that end the wait, if the caller's thread runs the cycles.

        Returns:
            The flags of the newest cycle.

        Raises:
            OSError: The link has failed.
            RuntimeError: The engine is not running, or no law runs.
        """

    def set_trigger(self, block: TriggerBlock, sends: bool) -> None:
        """Start the cycles of other processes, or start cycles with those of another process.

        Args:
            block: Shared memory of the trigger.
            sends: True: each cycle of this engine starts a cycle of the receivers.

        Raises:
            RuntimeError: The engine is running.
            ValueError: The cycle runs inline or in virtual time.
        """

    @property
    def following(self) -> bool:
        """True if the sender of the trigger starts the cycles of this engine."""

    def set_stream(self, stream: Stream | None) -> None:
        """Use one row of a stream per cycle as set-points.

        A running law receives the row in its targets. Once a row was taken, an empty stream is an
        underrun. The target buffers are set to the last commanded values.

        Args:
            stream: The stream; None starts a hand-over until the application commits targets.

        Raises:
            ValueError: The number of axes differs.
        """
