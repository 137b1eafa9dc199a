"""One minute of a soak test: an application on a segment with one incident after another.

The application performs the duties of applications in docs/explanation/safety.md. It waits until
faults are over, enables stopped axes again, restores held devices, and opens a new loop after an
error.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from dataclasses import dataclass, field
from math import inf
from random import Random

import catenary as cat
from benchmarks.soak.cell import PERIOD, Requests, make_segment
from benchmarks.soak.effects import may_end
from benchmarks.soak.faults import Incident, draw
from benchmarks.soak.objects import Objects
from benchmarks.soak.setting import Setting
from benchmarks.soak.witness import CLOCK_BOUND, OP, Phase, Violation, Witness
from catenary.bus.event_types import AxisStopped, DeviceHeld, DeviceReplaced
from catenary.bus.sub_device import SubDevice
from catenary.errors import CatenaryError
from catenary.model.device import Identity
from catenary.virtual import Segment

PRE_OP = 2
RECOVERY = 5.0  # [s] after the last fault of an incident, until all devices are back
CLOCK_RECOVERY = 10.0  # [s] until their clocks are within the bound, too
FAILURES_MAX = 4  # consecutive sessions that may fail
STEP = 0.01  # [s]
BOOT = 0.3  # [s] after the last fault, before a scan
ASK_AGAIN = 0.1  # [s] between two requests to enable
EFFECT = 0.02  # [s] after the end of a fault in which it may still have effects
SESSION = 10  # incidents after which the application leaves a loop
AT_START = 0.15  # fraction of the sessions with an incident at their start


@dataclass(slots=True)
class Figures:
    """Counts of a minute, or of many."""

    cycles: int = 0
    not_ok: int = 0
    loops: int = 0
    incidents: int = 0
    faults: Counter[str] = field(default_factory=Counter)
    losses: Counter[str] = field(default_factory=Counter)
    ended: Counter[str] = field(default_factory=Counter)  # number of loops, by reason of the end
    objects: int = 0  # objects read while a loop ran
    longest_return: float = 0.0  # [s] from the end of an incident until all devices are back
    longest_lock: float = 0.0  # [s] until their clocks are within the bound, too

    def add(self, other: Figures) -> None:
        for name in ("cycles", "not_ok", "loops", "incidents", "objects"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        for name in ("faults", "losses", "ended"):
            getattr(self, name).update(getattr(other, name))
        self.longest_return = max(self.longest_return, other.longest_return)
        self.longest_lock = max(self.longest_lock, other.longest_lock)


class Minute:
    """Owns a segment, the application of its MainDevice, and the random numbers."""

    def __init__(
        self,
        seed: int,
        seconds: float,
        setting: Setting = Setting(),  # noqa: B008
        segment: Segment | None = None,
    ) -> None:
        self._random = Random(seed)
        self._seconds = seconds
        self.setting = setting
        self.segment = segment or make_segment(setting, Random(seed))
        self.witness = Witness(self.segment, setting)
        self.figures = Figures()
        self.incidents: list[tuple[float, Incident]] = []
        self._incident: Incident | None = None
        self._over_at: float | None = None
        self._returned = inf  # [s] after the end of the incident
        self._next_at = 0.0
        self._asked_at = 0.0
        self._held: set[SubDevice] = set()
        self._trace = hashlib.blake2b(digest_size=8)

    @property
    def violations(self) -> list[Violation]:
        return self.witness.violations

    @property
    def digest(self) -> str:
        """Digest of the run; the same for the same run."""
        return self._trace.hexdigest()

    def run(self) -> None:
        failures = 0
        ends = (
            (self.segment.first, self.segment.second) if self.setting.is_ring else (self.segment,)
        )
        with cat.MainDevice(*ends) as main:
            self._main = main
            self._expected: list[Identity | tuple[int, int] | None] = [
                (sub.identity.vendor, sub.identity.product) for sub in main.scan()
            ]
            # A session that fails at the end of the time gets further attempts, as any other.
            while (self.segment.time < self._seconds or failures) and failures < FAILURES_MAX:
                failures = 0 if self._session() else failures + 1
                self._wait_until_over()
        if failures:
            self.witness.violate("all back", f"no loop could be opened in {failures} attempts")
        self.figures.losses = self.witness.losses

    def _note(self, *what: object) -> None:
        """Add to the digest."""
        self._trace.update(repr((round(self.segment.time, 9), *what)).encode())

    # Session: scan, loop, leave

    def _session(self) -> bool:
        """Run one session and return True if its loop ran cycles."""
        self._began = self._last = self.segment.time
        cycles = self.figures.cycles
        if self._random.random() < AT_START:
            self._inject(self._random.uniform(0.0, 0.3))
        self.witness.enter(Phase.STARTING)
        try:
            self._scan_and_run()
        except CatenaryError as error:
            self._judge_end(error, None if self.figures.cycles == cycles else self._cycled)
        self.witness.judge_left(self._last)
        self.witness.enter(Phase.LEFT)
        return self.figures.cycles > cycles

    def _scan_and_run(self) -> None:
        self._main.scan(expected=self._expected)
        if self._incident is None and any(device.state != PRE_OP for device in self.segment):
            states = [device.state for device in self.segment]
            self.witness.violate("in PRE-OP after a scan", f"the states are {states}")
        requests = Requests(self._main, self.setting)
        list(self._main.events)  # of the last loop
        for positions in requests.parts:
            self.witness.ask(positions)
        with cat.Loop(
            *requests.all, period=PERIOD, stop=cat.StopPolicy(on_axis_stopped="event")
        ) as loop:
            self.figures.loops += 1
            self.witness.enter(Phase.RUNNING)
            try:
                self._run(loop, requests)
            finally:
                self._last = self.segment.time
                self.witness.enter(Phase.STARTING)
        self._note("left")
        self.figures.ended["left unasked"] += 1

    def _judge_end(self, error: CatenaryError, running: float | None) -> None:
        """Judge an error. `running` is the time of the last cycle.

        If no cycle ran (None), any fault excuses the error.
        """
        kind = type(error).__name__
        self.figures.ended[kind] += 1
        self._note(kind, error.message)
        since = self._began if running is None else running
        self.witness.injected.update()  # a scan can fail before the next check of the witness
        faults = list(self.witness.injected.between(since - 0.1, self.segment.time))
        excused = faults if running is None else may_end(faults, ring=self.segment.ring)
        if not excused:
            self.witness.violate("no end without a reason", f"{kind}: {error.message}")

    def _wait_until_over(self) -> None:
        """Let time pass without a loop until all faults are over."""
        deadline = self.segment.time + RECOVERY
        while not self.segment.faults_done and self.segment.time < deadline:
            self._let_pass(STEP)
        self._let_pass(BOOT)
        self._incident = self._over_at = None
        self._held.clear()
        self.witness.give_up()

    def _let_pass(self, seconds: float) -> None:
        link = self._main.link
        link.wait_until(link.now() + round(seconds * 1e9), False)

    # While the loop runs

    def _run(self, loop: cat.Loop, requests: Requests) -> None:
        objects = Objects(self._main.subs, self.witness, self._random)
        incidents = 0
        # Not in the first cycle: axes that are enabled there hold until the first targets are set.
        self._next_at = self.segment.time + self._random.uniform(2 * PERIOD, 0.2)
        for cycle in loop:
            self._cycled = now = self.segment.time
            self.figures.cycles += 1
            self.figures.not_ok += not cycle.ok
            self.witness.judge_cycle(cycle.ok, requests.present)
            if cycle.number % 100 == 0:
                self._note(
                    [part.drives.actual.position.tolist() for part in requests.parts.values()]
                )
            requests.step(cycle.time)
            self._take_events(requests)
            self.figures.objects += objects.step(cycle.number)
            if self._incident is not None:
                if not self._is_over(loop, requests, now):
                    return
            elif now >= self._next_at:
                if incidents == SESSION or now > self._seconds:
                    return
                incidents += 1
                self._be_late(self._inject(), cycle, requests)

    def _inject(self, within: float = 0.0) -> Incident:
        incident = draw(self._random, self.segment.time + within, self.setting)
        self.witness.disturb()
        self._incident, self._over_at, self._returned = incident, None, inf
        self.incidents.append((self.segment.time, incident))
        self.figures.incidents += 1
        self.figures.faults.update(incident.kinds)
        self._note(str(incident))
        for fault in incident.faults:
            self.segment.inject(fault)
        return incident

    def _be_late(self, incident: Incident, cycle: cat.Cycle, requests: Requests) -> None:
        """Delay the application for a while."""
        if not incident.late:
            return
        self.witness.late_since = self.segment.time
        cycle.spend(incident.late)
        self.witness.late_since = float("inf")

    def _take_events(self, requests: Requests) -> None:
        for event in self._main.events:
            self._note(str(event))
            if isinstance(event, (DeviceHeld, DeviceReplaced)) and event.sub is not None:
                self._held.add(event.sub)
            if isinstance(event, AxisStopped) and event.sub is not None:
                self._take_stop(event.sub.position, requests)

    def _take_stop(self, position: int, requests: Requests) -> None:
        for positions, part in requests.parts.items():
            if position in positions:
                reason = part.drives.stopped[positions.index(position)]
                self.witness.take_stop(position, reason=reason is not None)

    # After an incident

    def _is_over(self, loop: cat.Loop, requests: Requests, now: float) -> bool:
        """Restore held devices and stopped axes. Return False if the recovery took too long."""
        if not self.segment.faults_done:
            return True
        if self._over_at is None:
            self._over_at = self._asked_at = now
        if now < self._over_at + EFFECT:
            return True
        for sub in self._held:
            loop.restore(sub)
        self._held.clear()
        wrong = self._wrong(requests)
        since = now - self._over_at
        if not wrong:
            self._returned = min(self._returned, since)
            wrong = self._wrong_clock(loop)
        if not wrong:
            self._end_incident(now, since)
            return True
        if since > (CLOCK_RECOVERY if self._returned < since else RECOVERY):
            self.witness.violate("all back", f"{since:.1f} s after the last fault: {wrong}")
            return False
        if now > self._asked_at + ASK_AGAIN:
            self._asked_at = now
            for positions, part in requests.parts.items():
                idle = part.idle
                self.witness.ask(tuple(positions[k] for k in idle))
                part.drives.enable(idle)
        return True

    def _end_incident(self, now: float, since: float) -> None:
        figures = self.figures
        figures.longest_return = max(figures.longest_return, self._returned)
        if self.setting.clocks:
            figures.longest_lock = max(figures.longest_lock, since)
        self._incident = None
        self._next_at = now + self._random.uniform(0.02, 0.3)
        self.witness.all_well()

    def _wrong_clock(self, loop: cat.Loop) -> str:
        """Return a text on the worst clock if it is not within the bound; otherwise empty."""
        if not self.setting.clocks:
            return ""
        position, difference = self.witness.worst_clock()
        if loop.clocks.locked and abs(difference) < CLOCK_BOUND / 2:
            return ""
        locked = "locked" if loop.clocks.locked else "not locked"
        return f"clocks {locked}, device {position} is {difference * 1e6:+.3f} us off"

    def _wrong(self, requests: Requests) -> str:
        """Return a text on devices that have not recovered; empty if all have."""
        states = [device.state for device in self.segment]
        if any(state != OP for state in states):
            return f"states {states}"
        gone = [position for position, there in requests.present.items() if not there]
        if gone:
            return f"devices {gone} are not present"
        idle = [positions[k] for positions, part in requests.parts.items() for k in part.idle]
        return f"devices {idle} are not enabled" if idle else ""
