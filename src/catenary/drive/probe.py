"""Probe: handle of an armed touch probe, and the exchange that arms it and reads its edges.

A probe is first disabled, so that the drive forgets old edges, and then enabled. Each bit keeps its
level until 0x60B9 has replied.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Literal, TypeAlias

from catenary.drive import touch_probe as bits
from catenary.drive.port import Steps
from catenary.drive.probe_port import ProbeEvent, ProbePort, ProbeRequest
from catenary.errors import CatenaryError, MoveError
from catenary.plan.request import Mover

Edge: TypeAlias = Literal["rising", "falling", "both"]
ProbeOutcome: TypeAlias = Literal["captured", "stopped", "failed"]

ANSWER_TIMEOUT = 1.0  # [s] until 0x60B9 reflects 0x60B8
ANSWER_EXCHANGES = 1.5  # that the drive needs at least to receive 0x60B8
PATIENCE = 60.0  # [s] default of `loop.wait(probe)`
EVENTS_MAX = 1000  # edges that a handle keeps
COUNTER_SPAN = 1 << 16


class Probe:
    """Handle of a touch probe from `arm.probe(...)`.

    The loop must be iterated while the probe is armed: call `loop.wait(probe)`, or use a `for`
    statement.
    """

    def __init__(self, port: ProbePort, request: ProbeRequest) -> None:
        self._port = port
        self._request = request
        self._events: deque[ProbeEvent] = deque(maxlen=EVENTS_MAX)
        self._steps = self._run()
        self._counters: dict[str, int | None] = {}  # of the last edge of each kind
        self._armed = False
        self._stop_requested = False
        self._outcome: ProbeOutcome | None = None
        self._error: CatenaryError | None = None
        self.missed = 0  # edges that were replaced before the loop read them (0x60D5 to 0x60D8)
        self.dropped = 0  # oldest events that were dropped, because the handle keeps 1000
        self.patience = PATIENCE  # [s] default timeout of `loop.wait(probe)`

    @property
    def axis(self) -> str:
        """Name of the axis."""
        return self._port.name

    @property
    def number(self) -> int:
        """Number of the probe, 1 or 2."""
        return self._request.number

    @property
    def continuous(self) -> bool:
        """True if the probe captures edges until `stop`."""
        return self._request.continuous

    @property
    def armed(self) -> bool:
        """True while the drive waits for an edge, as 0x60B9 confirms."""
        return self._armed and self._outcome is None

    @property
    def done(self) -> bool:
        """True after the end of the measurement: see `outcome`. `stop` ends a continuous one."""
        return self._outcome is not None

    @property
    def outcome(self) -> ProbeOutcome | None:
        """Result: "captured", "stopped" or "failed" (see `error`); None while it is not done."""
        return self._outcome

    @property
    def error(self) -> CatenaryError | None:
        """Error of a probe that failed; otherwise None."""
        return self._error

    @property
    def events(self) -> tuple[ProbeEvent, ...]:
        """Captured edges, oldest first; at most the last 1000."""
        return tuple(self._events)

    @property
    def position(self) -> float | None:
        """Position of the last captured edge [rad or m]; None without an edge."""
        return self._events[-1].position if self._events else None

    @property
    def time(self) -> float | None:
        """Time of the last captured edge, as `cycle.time` [s]; see `ProbeEvent`."""
        return self._events[-1].time if self._events else None

    def stop(self) -> None:
        """Disable the probe in the next cycle. The captured edges are kept."""
        self._stop_requested = True  # without a lock, so that a signal handler can call it

    def timeout_error(self, timeout: float) -> MoveError:
        """Return the error of a probe without its edge after `timeout` [s]."""
        edges = " and ".join(self._request.edges)
        source = self._request.source
        what = "was not armed" if not self._armed else f"captured no {edges} edge"
        return self._port.error(
            f"{what} within {timeout:g} s (source {source!r}, 0x60B9 = 0x{self._port.status:02X})",
            "check the wiring and the edge; increase loop.wait(timeout=)",
        )

    def __repr__(self) -> str:
        state = self._outcome or ("armed" if self._armed else "arming")
        return f"<Probe {self.number} of {self.axis}: {state}, {len(self._events)} edges>"

    # For Probes

    def step(self, now: float) -> None:
        """Run one step.

        Args:
            now: Time of the cycle [s].
        """
        self._port.now = now
        if self._stop_requested:
            self.finish("stopped", None)
            return
        try:
            next(self._steps)
        except StopIteration:
            self.finish("captured", None)
        except CatenaryError as error:
            self.finish("failed", error)
        except BaseException:  # an interrupt has ended the generator
            self.finish("failed", self._port.error("was interrupted", "arm the probe again"))
            raise

    def end(self) -> None:
        """End the probe because the loop ends."""
        hint = "wait for the probe before you leave the loop: loop.wait(probe)"
        error = self._port.error("was armed when the loop ended", hint)
        self.finish("stopped" if self.continuous else "failed", error)

    def finish(self, outcome: ProbeOutcome, error: CatenaryError | None) -> None:
        """Disable the probe and set its result."""
        self._steps.close()
        self._port.write(0)
        self._error = error if outcome == "failed" else None
        self._outcome = outcome

    # Steps

    def _run(self) -> Steps:
        port, request = self._port, self._request
        port.write(0)
        disabled = f"is still enabled {ANSWER_TIMEOUT:g} s after 0x60B8 requested the opposite"
        yield from self._await(lambda: not port.status & bits.ENABLED, disabled, "see its manual")
        stale = {edge: self._marks(edge) for edge in request.edges if self._stored(edge)}
        if isinstance(request.source, int):
            yield from self._write_source(request.source)
        port.write(request.function)
        yield from self._await(
            lambda: bool(port.status & bits.ENABLED),
            f"was not enabled within {ANSWER_TIMEOUT:g} s: 0x60B8 = 0x{request.function:02X} "
            f"({' and '.join(request.edges)} edge, source {request.source!r})",
            "the drive may not support this edge, both edges at a time, this source, or touch "
            "probes in the present mode: see its manual",
        )
        self._armed = True
        yield from self._capture(stale)

    def _capture(self, last: dict[str, tuple[object, ...]]) -> Steps:
        """Read edges. `last` has the marks of edges that 0x60B9 already showed before."""
        request = self._request
        missing = set(request.edges)
        while True:
            for edge in request.edges:
                if edge not in missing and not request.continuous:
                    continue
                if not self._stored(edge):
                    last.pop(edge, None)
                    self._counters[edge] = self._port.counter(edge)
                elif last.get(edge) != self._marks(edge):
                    self._add(edge)
                    last[edge] = self._marks(edge)
                    missing.discard(edge)
            if not missing and not request.continuous:
                return
            yield

    def _add(self, edge: str) -> None:
        """Keep the stored edge, and count the edges that it has replaced."""
        counter, before = self._port.counter(edge), self._counters.get(edge)
        if self.continuous and counter is not None and before is not None:
            self.missed += max((counter - before) % COUNTER_SPAN - 1, 0)
        self._counters[edge] = counter
        self.dropped += len(self._events) == EVENTS_MAX
        self._events.append(self._port.event(edge))

    def _stored(self, edge: str) -> bool:
        return bool(self._port.status & bits.STORED_BITS[edge])

    def _marks(self, edge: str) -> tuple[object, ...]:
        """Return the values that change with each edge."""
        port = self._port
        toggle = port.status & bits.TOGGLE_BITS[edge] if self._request.toggles else 0
        return port.counter(edge), port.stamp(edge), port.raw_position(edge), toggle

    def _write_source(self, source: int) -> Steps:
        pending = self._port.write_source(source)
        while not pending.done:
            yield
        try:
            pending.result()
        except CatenaryError as error:
            raise self._port.error(
                f"refuses the source {source} (0x60D0): {error}",
                "use a source from its manual, or source='input'",
            ) from error

    def _await(self, met: Callable[[], bool], what: str, hint: str) -> Steps:
        begun = self._port.now
        while True:
            yield
            waited = self._port.now - begun
            if met() and waited > ANSWER_EXCHANGES * self._port.exchange:
                return
            if waited > ANSWER_TIMEOUT:
                raise self._port.error(f"{what} (0x60B9 = 0x{self._port.status:02X})", hint)


class Probes:
    """Owner of the probes in use, at most one handle per probe. It is a `Mover` of the loop."""

    def __init__(self, movers: list[Mover]) -> None:
        self._movers = movers
        self._lock = threading.Lock()
        self._active: dict[tuple[int, int], Probe] = {}

    def begin(self, axis: int, probe: Probe) -> Probe:
        """Start to arm a probe, and return it.

        Raises:
            ValueError: The probe of the axis is already in use.
        """
        with self._lock:
            old = self._active.get((axis, probe.number))
            if old is not None and not old.done:
                raise ValueError(
                    f"touch probe {probe.number} of {probe.axis} is already in use: {old!r}; wait "
                    "for it with loop.wait(probe), or call its stop() and iterate once"
                )
            self._active[axis, probe.number] = probe
            if self not in self._movers:
                self._movers.append(self)
        return probe

    # plan.request.Mover

    def step(self, now: float) -> None:
        """Run one step of each probe.

        Args:
            now: Time of the cycle [s].
        """
        with self._lock:
            for key, probe in list(self._active.items()):
                probe.step(now)
                if probe.done:
                    del self._active[key]
            if not self._active and self in self._movers:
                self._movers.remove(self)

    def check(self) -> None:
        """Keep the probes armed. They do not depend on the state of an axis."""

    def end(self) -> None:
        """End all probes, because the loop ends."""
        with self._lock:
            for probe in self._active.values():
                probe.end()
            self._active.clear()
            if self in self._movers:
                self._movers.remove(self)
