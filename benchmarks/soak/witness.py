"""Invariants that hold in spite of all faults, judged by the virtual devices' own truth.

`Witness` checks every device once a millisecond of virtual time, even while no cycle runs. The
application reports its requests, the stops it was told of, and the result of each cycle.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from enum import Enum
from math import inf
from typing import NamedTuple

from benchmarks.soak.cell import (
    COUPLER,
    DEVICES,
    LATE_LIMIT,
    LATE_LIMIT_TORQUE,
    OPTIONAL,
    PERIOD,
    POWERED,
    SERVOS,
    apply_loads,
)
from benchmarks.soak.commands import Commands
from benchmarks.soak.effects import breaks_cable, disturbed
from benchmarks.soak.injected import Injected
from benchmarks.soak.setting import Setting
from catenary.virtual import DigitalOutputs, Segment, Servo
from catenary.virtual import faults as f

LOOK = 1_000_000  # [ns] between two looks
OP, AL_STATE = 8, 0x0F
WATCHDOG, WATCHDOG_TORQUE = 0.1, 0.01  # [s], of the loop; the second one in CST
MARGIN = 0.003  # [s]: steps of device models and looks
BRAKING = 0.1  # [s] that a drive may take to stand
STILL = 0.05  # [rad/s]
FASTEST = 3.0  # [rad/s]: ten times the application's own velocity; a jump is faster
ANNOUNCED = 20  # cycles from a stop to its event and reason
CLOCK_BOUND = 2e-6  # [s], true difference from the reference clock: twice what the loop reports
FLIGHT = 2.5 * PERIOD  # [s] from the sending of a frame to the end of its cycle
AFTERWARDS = 0.012  # [s]: late frames arrive, controllers detect dark cables
DETECTED = 0.002  # [s], in a ring: dark cables are detected; the other way round carries on
REQUIRED = frozenset(range(DEVICES)) - frozenset(OPTIONAL)


class Violation(NamedTuple):
    """An invariant that did not hold."""

    time: float  # of the segment [s]
    invariant: str
    what: str

    def __str__(self) -> str:
        return f"{self.time:9.4f} s  {self.invariant}: {self.what}"


class Phase(Enum):
    """Activity of the MainDevice."""

    STARTING = "starting"  # scanning, entering the loop, leaving it
    RUNNING = "running"
    LEFT = "left"


class Witness:
    """Owns the observations of the devices of one segment, and the violations."""

    def __init__(self, segment: Segment, setting: Setting) -> None:
        self.segment = segment
        self.setting = setting
        self.injected = Injected(segment)
        self.violations: list[Violation] = []
        self.phase = Phase.LEFT
        self.calm = False  # no fault is on, and all devices are back
        self.late_since = inf  # [s]: the last time the application ran
        self.losses: Counter[str] = Counter()
        torque = setting.mode == "cst"
        self._late_limit = LATE_LIMIT_TORQUE if torque else LATE_LIMIT
        self._watchdogs = {p: WATCHDOG_TORQUE if torque else WATCHDOG for p in SERVOS}
        self._commands = {p: Commands(setting.mode) for p in SERVOS}
        self._left = 0.0
        self._running_since = inf
        self._quiet_since = 0.0  # end of the last incident; infinity during one
        self._spoiled = -inf  # time of the last frame that was lost
        self._asked: set[int] = set()
        self._enabled: set[int] = set()
        self._idle_since = dict.fromkeys(SERVOS, 0.0)
        self._op_since = dict.fromkeys(range(DEVICES), inf)
        self._unannounced: dict[int, int] = {}  # stopped axis → cycles without event and reason
        self._announced: set[int] = set()  # since their last request
        self._told: set[tuple[str, str]] = set()
        self._look()

    def violate(self, invariant: str, what: str, *, about: str = "") -> None:
        """Note a violation, once for each `about` until all devices are back."""
        if (invariant, about) not in self._told:
            self._told.add((invariant, about))
            self.violations.append(Violation(self.segment.time, invariant, what))

    # Reports of the application

    def enter(self, phase: Phase) -> None:
        self.phase, self.calm = phase, False
        self._unannounced.clear()
        if phase is Phase.RUNNING:
            self._running_since = self.segment.time
        if phase is Phase.LEFT:
            self._left = self.segment.time
            self._asked &= self._enabled  # those out of reach go on until their watchdogs expire

    def ask(self, positions: tuple[int, ...]) -> None:
        """The application requests that drives be enabled."""
        self._asked.update(positions)
        self._announced.difference_update(positions)

    def take_stop(self, position: int, *, reason: bool) -> None:
        """The application received the event of a stop; `reason`: `Drives.stopped` has one."""
        self._announced.add(position)
        self._unannounced.pop(position, None)
        if not reason:
            what = f"device {position}: an event, but no reason in `stopped`"
            self.violate("no silent stop", what, about=str(position))

    def all_well(self) -> None:
        """All devices are back after an incident."""
        self.calm, self._quiet_since = True, self.segment.time
        self._told.clear()

    def disturb(self) -> None:
        """An incident begins."""
        self.calm, self._quiet_since = False, inf

    def give_up(self) -> None:
        """The loop of an incident was left; the next one begins anew."""
        self._quiet_since = self.segment.time

    def quiet_since(self, time: float) -> bool:
        """Return True if no incident was open at `time` [s] or later."""
        return self._quiet_since <= time

    # Checks of the devices

    def _look(self) -> None:
        self.segment.service.agenda.after(LOOK, self._look)
        self.injected.update()
        if self.setting.mode == "cst":
            apply_loads(self.segment)
        now = self.segment.time
        states = [device.state for device in self.segment]
        for position, state in enumerate(states):
            self._look_at_state(position, state, now)
            silent = now - self._silent_since(position)
            if silent > self._watchdogs.get(position, WATCHDOG) + MARGIN:
                self._look_for_safety(position, silent)
        for position in SERVOS:
            self._look_at_drive(position, states[position], now)
        if self.setting.clocks and self.calm and self.phase is Phase.RUNNING:
            self._look_at_clocks()

    def _look_at_clocks(self) -> None:
        position, difference = self.worst_clock()
        if abs(difference) > CLOCK_BOUND:
            what = f"device {position} is {difference * 1e6:+.3f} us off without a fault"
            self.violate("clocks within bound", what, about=str(position))

    def worst_clock(self) -> tuple[int, float]:
        """Return the drive whose clock is furthest off the reference's, and its difference [s]."""
        core = self.segment.core
        reference = core.system_time(COUPLER)
        found = {p: (core.system_time(p) - reference) * 1e-9 for p in SERVOS}
        position = max(found, key=lambda p: abs(found[p]))
        return position, found[position]

    def _silent_since(self, position: int) -> float:
        """Return since when a device has had no outputs; infinity if it has them."""
        since = self.injected.isolated_since(position)
        return min(since, self._left) if self.phase is Phase.LEFT else since

    def _look_at_state(self, position: int, state: int, now: float) -> None:
        if state != OP:
            self._op_since[position] = inf
            if self.calm and self.phase is Phase.RUNNING:
                what = f"device {position} is in state 0x{state:02X} without a fault"
                self.violate("in OP", what, about=str(position))
        elif self._op_since[position] == inf:
            self._op_since[position] = now

    def _look_for_safety(self, position: int, silent: float) -> None:
        device = self.segment[position]
        what = f"device {position}, {silent:.4f} s without outputs"
        if isinstance(device, DigitalOutputs) and device.outputs:
            self.violate("outputs safe", f"{what}: 0x{device.outputs:02X}", about=str(position))
        if isinstance(device, Servo) and self._is_enabled(device) and not self._is_frozen(position):
            self.violate("outputs safe", f"{what}: {device.drive_state()}", about=str(position))

    def _look_at_drive(self, position: int, state: int, now: float) -> None:
        servo = self.segment[position]
        if not isinstance(servo, Servo):
            return
        if state == 0:
            self._idle_since[position] = now  # the model stands still, and goes on when it returns
        moving = state != 0 and not self._is_frozen(position)
        velocity = abs(servo.velocity_rad_s) if moving else 0.0
        self._look_at_commands(position, servo, state, now)
        if not self._is_enabled(servo):
            if position in self._enabled:
                self._enabled.discard(position)
                self._asked.discard(position)
                self._idle_since[position] = now
                if self.phase is Phase.RUNNING and position not in self._announced:
                    self._unannounced[position] = 0
            if velocity > STILL and now - self._idle_since[position] > BRAKING:
                what = f"device {position} turns at {velocity:.3f} rad/s, {servo.drive_state()}"
                self.violate("nothing moves unasked", what, about=str(position))
            return
        self._enabled.add(position)
        if position not in self._asked:
            what = f"device {position} is enabled without a request"
            self.violate("nothing moves unasked", what, about=str(position))
        if velocity > FASTEST and not self._is_garbled(now):
            what = f"device {position} jumps at {velocity:.3f} rad/s"
            self.violate("nothing moves unasked", what, about=str(position))
        if now - self.late_since > self._late_limit + BRAKING:
            late = now - self.late_since
            what = f"device {position} is enabled {late:.3f} s after the last set-points"
            self.violate("outputs safe", what, about=str(position))

    def _look_at_commands(self, position: int, servo: Servo, state: int, now: float) -> None:
        commands, drive = self._commands[position], servo.drive_state() if state else ""
        excused = self._is_frozen(position) or self._is_garbled(now)
        if state & AL_STATE != OP or drive not in POWERED or excused:
            commands.reset()
            return
        for invariant, what in commands.look(servo, drive):
            self.violate(invariant, f"device {position}: {what}", about=str(position))

    def _is_enabled(self, servo: Servo) -> bool:
        return servo.state != 0 and servo.drive_state() == "OPERATION ENABLED"

    def _is_frozen(self, position: int) -> bool:
        """Return True if its model stands still, or has to catch up."""
        now = self.segment.time
        return any(
            isinstance(fault, f.Freeze) and fault.device == position
            for fault in self.injected.between(now - 0.5, now)
        )

    def _is_garbled(self, now: float) -> bool:
        """Return True if wrong positions came that cannot be detected: they may be followed."""
        recent = self.injected.between(now - 0.5, now)
        return any(isinstance(fault, f.Garble) for fault in recent)

    # Judging what the application sees

    def judge_cycle(self, ok: bool, present: Mapping[int, bool]) -> None:
        """Judge one cycle of the loop as the application saw it."""
        self.injected.update()
        now = self.segment.time
        self._take_losses(now)
        spoiled = self._spoiled > now - FLIGHT
        recent = list(self.injected.between(now - AFTERWARDS, now))
        garbled = any(isinstance(fault, f.Garble) for fault in recent)  # counters as well
        excused = disturbed(recent, ring=self.segment.ring)
        if excused & REQUIRED:
            excused |= REQUIRED  # they share a sync unit
        if not ok and not spoiled and not excused & REQUIRED:
            self.violate("no undeclared loss", "a cycle was not ok, and nothing was injected")
        self._judge_stops(present)
        for position, there in present.items():
            steady = now - self._op_since[position] > FLIGHT
            if not there and steady and not spoiled and position not in excused:
                what = f"device {position} is in OP, and its answer is missing"
                self.violate("no undeclared loss", what, about=str(position))
            gone = now - self.injected.isolated_since(position) > FLIGHT
            if gone and not garbled and (there or (ok and position in REQUIRED)):
                what = f"device {position} is out of reach, and its inputs are given for good"
                self.violate("no silent loss", what, about=str(position))

    def _judge_stops(self, present: Mapping[int, bool]) -> None:
        """An axis that was stopped is announced while its device answers."""
        for position in list(self._unannounced):
            self._unannounced[position] += present[position]
            if self._unannounced[position] > ANNOUNCED:
                del self._unannounced[position]
                what = f"device {position} left OPERATION ENABLED: no event in {ANNOUNCED} cycles"
                self.violate("no silent stop", what, about=str(position))

    def _take_losses(self, now: float) -> None:
        for loss in self.segment.take_losses():
            self.losses[loss.cause] += 1
            self._spoiled = max(self._spoiled, loss.time)
            if not self._declared(loss.time, loss.cause):
                self.violate(
                    "no undeclared loss", f"a frame sent at {loss.time:.6f} s: {loss.cause}"
                )

    def _declared(self, sent: float, cause: str) -> bool:
        faults = list(self.injected.between(sent - self._detected(cause), sent + FLIGHT))
        if cause == "closed port" and self.setting.clocks and sent < self._running_since:
            return self.segment.ring  # it is a line while the delays of its cables are measured
        if cause == "injected":
            return any(isinstance(fault, f.LoseFrames) for fault in faults)
        if cause == "corrupt":
            return any(isinstance(fault, f.Corrupt) for fault in faults)
        return any(breaks_cable(fault) for fault in faults)

    def _detected(self, cause: str) -> float:
        """Return how long before a loss its fault may have begun [s]."""
        is_cable = cause not in ("injected", "corrupt")
        return DETECTED if self.segment.ring and is_cable else AFTERWARDS

    def judge_left(self, since: float) -> None:
        """Judge that no device within reach is in OP after the loop was left."""
        self.injected.update()
        now = self.segment.time
        out_of_reach = disturbed(self.injected.between(since, now), ring=self.segment.ring)
        for position, device in enumerate(self.segment):
            if device.state & AL_STATE == OP and position not in out_of_reach:
                self.violate("no device left in OP", f"device {position} is", about=str(position))
