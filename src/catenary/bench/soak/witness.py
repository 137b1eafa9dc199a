"""What must hold whatever happens, judged by the virtual devices' own truth.

`Witness` looks at every device once a millisecond of virtual time, whoever spends the time; the
application tells it what it asks for and what every cycle of its loop looked like to it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from enum import Enum
from math import inf
from typing import NamedTuple

from catenary.bench.soak.cell import DEVICES, OPTIONAL, PERIOD, SERVOS
from catenary.bench.soak.effects import breaks_cable, disturbs
from catenary.bench.soak.injected import Injected
from catenary.virtual import DigitalOutputs, Segment, Servo
from catenary.virtual import faults as f

LOOK = 1_000_000  # [ns] between two looks
OP, AL_STATE = 8, 0x0F
WATCHDOG = 0.1  # [s], of the loop
LATE_LIMIT = 0.05  # [s], of the loop, in CSP
MARGIN = 0.003  # [s]: steps of device models and looks
BRAKING = 0.1  # [s] that a drive may take to stand
STILL = 0.05  # [rad/s]
FASTEST = 3.0  # [rad/s]: ten times what is commanded; a jump is faster
FLIGHT = 2.5 * PERIOD  # [s] from the sending of a frame to the end of its cycle
AFTERWARDS = 0.012  # [s]: frames that were late come in, cables are seen to be dark
REQUIRED = frozenset(range(DEVICES)) - frozenset(OPTIONAL)


class Violation(NamedTuple):
    """Something that must not be."""

    time: float  # of the segment [s]
    invariant: str
    what: str

    def __str__(self) -> str:
        return f"{self.time:9.4f} s  {self.invariant}: {self.what}"


class Phase(Enum):
    """What the MainDevice is about."""

    STARTING = "starting"  # scanning, entering the loop, leaving it
    RUNNING = "running"
    LEFT = "left"


class Witness:
    """Owns what was seen of the devices of one segment, and what was wrong with it."""

    def __init__(self, segment: Segment) -> None:
        self.segment = segment
        self.injected = Injected(segment)
        self.violations: list[Violation] = []
        self.phase = Phase.LEFT
        self.calm = False  # no fault is on, and all have been led back
        self.late_since = inf  # [s]: when the application was there last
        self.losses: Counter[str] = Counter()
        self._left = 0.0
        self._spoiled = -inf  # when a frame was lost last
        self._asked: set[int] = set()
        self._enabled: set[int] = set()
        self._idle_since = dict.fromkeys(SERVOS, 0.0)
        self._op_since = dict.fromkeys(range(DEVICES), inf)
        self._told: set[tuple[str, str]] = set()
        self._look()

    def tell(self, invariant: str, what: str, *, about: str = "") -> None:
        """Notes a violation, once for each `about` until the devices are all well again."""
        if (invariant, about) not in self._told:
            self._told.add((invariant, about))
            self.violations.append(Violation(self.segment.time, invariant, what))

    # What the application tells

    def enter(self, phase: Phase) -> None:
        self.phase, self.calm = phase, False
        if phase is Phase.LEFT:
            self._left = self.segment.time
            self._asked &= self._enabled  # those out of reach go on until their watchdogs bite

    def ask(self, positions: tuple[int, ...]) -> None:
        """The application asks for drives to be enabled."""
        self._asked.update(positions)

    def all_well(self) -> None:
        self.calm = True
        self._told.clear()

    # Looks at the devices

    def _look(self) -> None:
        self.segment.service.agenda.after(LOOK, self._look)
        self.injected.update()
        now = self.segment.time
        states = [device.state for device in self.segment]
        for position, state in enumerate(states):
            self._look_at_state(position, state, now)
            silent = now - self._silent_since(position)
            if silent > WATCHDOG + MARGIN:
                self._look_for_safety(position, silent)
        for position in SERVOS:
            self._look_at_drive(position, states[position], now)

    def _silent_since(self, position: int) -> float:
        """Since when a device has had no outputs; infinity: it has them."""
        since = self.injected.isolated_since(position)
        return min(since, self._left) if self.phase is Phase.LEFT else since

    def _look_at_state(self, position: int, state: int, now: float) -> None:
        if state != OP:
            self._op_since[position] = inf
            if self.calm and self.phase is Phase.RUNNING:
                what = f"device {position} is in state 0x{state:02X} without a fault"
                self.tell("in OP", what, about=str(position))
        elif self._op_since[position] == inf:
            self._op_since[position] = now

    def _look_for_safety(self, position: int, silent: float) -> None:
        device = self.segment[position]
        what = f"device {position}, {silent:.4f} s without outputs"
        if isinstance(device, DigitalOutputs) and device.outputs:
            self.tell("outputs safe", f"{what}: 0x{device.outputs:02X}", about=str(position))
        if isinstance(device, Servo) and self._is_enabled(device) and not self._is_frozen(position):
            self.tell("outputs safe", f"{what}: {device.drive_state()}", about=str(position))

    def _look_at_drive(self, position: int, state: int, now: float) -> None:
        servo = self.segment[position]
        if not isinstance(servo, Servo):
            return
        moving = state != 0 and not self._is_frozen(position)
        velocity = abs(servo.velocity_rad_s) if moving else 0.0
        if not self._is_enabled(servo):
            if position in self._enabled:
                self._enabled.discard(position)
                self._asked.discard(position)
                self._idle_since[position] = now
            if velocity > STILL and now - self._idle_since[position] > BRAKING:
                what = f"device {position} turns at {velocity:.3f} rad/s, {servo.drive_state()}"
                self.tell("nothing moves unasked", what, about=str(position))
            return
        self._enabled.add(position)
        if position not in self._asked:
            what = f"device {position} is enabled and nobody has asked"
            self.tell("nothing moves unasked", what, about=str(position))
        if velocity > FASTEST and not self._is_garbled(now):
            what = f"device {position} jumps at {velocity:.3f} rad/s"
            self.tell("nothing moves unasked", what, about=str(position))
        if now - self.late_since > LATE_LIMIT + BRAKING:
            what = f"device {position} is enabled {now - self.late_since:.3f} s after Python's last"
            self.tell("outputs safe", what, about=str(position))

    def _is_enabled(self, servo: Servo) -> bool:
        return servo.state != 0 and servo.drive_state() == "OPERATION ENABLED"

    def _is_frozen(self, position: int) -> bool:
        """Its model stands still as it was, or has to catch up."""
        now = self.segment.time
        return any(
            isinstance(fault, f.Freeze) and fault.device == position
            for fault in self.injected.between(now - 0.5, now)
        )

    def _is_garbled(self, now: float) -> bool:
        """Wrong positions came, and nobody could tell: a drive may have been sent to one."""
        recent = self.injected.between(now - 0.5, now)
        return any(isinstance(fault, f.Garble) for fault in recent)

    # Judges what the application sees

    def judge_cycle(self, ok: bool, present: Mapping[int, bool]) -> None:
        """One cycle of the loop as the application saw it."""
        self.injected.update()
        now = self.segment.time
        self._take_losses(now)
        spoiled = self._spoiled > now - FLIGHT
        recent = list(self.injected.between(now - AFTERWARDS, now))
        garbled = any(isinstance(fault, f.Garble) for fault in recent)  # counters as well
        excused = frozenset[int]().union(*map(disturbs, recent))
        if excused & REQUIRED:
            excused |= REQUIRED  # they share a sync unit
        if not ok and not spoiled and not excused & REQUIRED:
            self.tell("no undeclared loss", "a cycle was not ok, and nothing was injected")
        for position, there in present.items():
            steady = now - self._op_since[position] > FLIGHT
            if not there and steady and not spoiled and position not in excused:
                what = f"device {position} is in OP, and its answer is missing"
                self.tell("no undeclared loss", what, about=str(position))
            gone = now - self.injected.isolated_since(position) > FLIGHT
            if gone and not garbled and (there or (ok and position in REQUIRED)):
                what = f"device {position} is out of reach, and its inputs are given for good"
                self.tell("no silent loss", what, about=str(position))

    def _take_losses(self, now: float) -> None:
        for loss in self.segment.take_losses():
            self.losses[loss.cause] += 1
            self._spoiled = max(self._spoiled, loss.time)
            if not self._declared(loss.time, loss.cause):
                self.tell("no undeclared loss", f"a frame sent at {loss.time:.6f} s: {loss.cause}")

    def _declared(self, sent: float, cause: str) -> bool:
        faults = list(self.injected.between(sent - AFTERWARDS, sent + FLIGHT))
        if cause == "injected":
            return any(isinstance(fault, f.LoseFrames) for fault in faults)
        if cause == "corrupt":
            return any(isinstance(fault, f.Corrupt) for fault in faults)
        return any(breaks_cable(fault) for fault in faults)

    def judge_left(self, since: float) -> None:
        """The loop has been left: nobody is in OP who could be told."""
        self.injected.update()
        now = self.segment.time
        out_of_reach: set[int] = set()
        for fault in self.injected.between(since, now):
            out_of_reach |= disturbs(fault)
        for position, device in enumerate(self.segment):
            if device.state & AL_STATE == OP and position not in out_of_reach:
                self.tell("nobody left in OP", f"device {position} is", about=str(position))
