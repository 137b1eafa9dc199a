"""Invariants that hold despite all faults, checked against the true state of the virtual devices.

`Witness` checks every device once per millisecond of virtual time, even while no cycle runs. The
application reports its requests, the stops that it was notified of, and the result of each cycle.
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

LOOK = 1_000_000  # [ns] between two checks
OP, AL_STATE = 8, 0x0F
WATCHDOG, WATCHDOG_TORQUE = 0.1, 0.01  # [s] of the loop; the second in CST
MARGIN = 0.003  # [s] for the steps of device models and checks
BRAKING = 0.1  # [s] in which a drive must come to a standstill
STILL = 0.05  # [rad/s]
FASTEST = 3.0  # [rad/s] ten times the velocity of the application; a jump is faster
ANNOUNCED = 20  # cycles from a stop to its event and reason
CLOCK_BOUND = 2e-6  # [s] true difference from the reference clock: twice the reported bound
FLIGHT = 2.5 * PERIOD  # [s] from the sending of a frame to the end of its cycle
AFTERWARDS = 0.012  # [s] for late frames, and for controllers to detect dead cables
DETECTED = 0.002  # [s] in a ring, to detect dead cables; the other direction continues
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
        self.calm = False  # True if no fault is active, and all devices have recovered
        self.late_since = inf  # [s] last time at which the application ran
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
        self._announced: set[int] = set()  # stops reported since the last request
        self._reported: set[tuple[str, str]] = set()
        self._check()

    def violate(self, invariant: str, what: str, *, about: str = "") -> None:
        """Record a violation, once for each `about` until all devices have recovered.

        Args:
            invariant: Name of the invariant.
            what: Description of the violation.
            about: Device of the violation.
        """
        if (invariant, about) not in self._reported:
            self._reported.add((invariant, about))
            self.violations.append(Violation(self.segment.time, invariant, what))

    # Reports of the application

    def enter(self, phase: Phase) -> None:
        self.phase, self.calm = phase, False
        self._unannounced.clear()
        if phase is Phase.RUNNING:
            self._running_since = self.segment.time
        if phase is Phase.LEFT:
            self._left = self.segment.time
            self._asked &= (
                self._enabled
            )  # unreachable ones stay enabled until their watchdogs expire

    def ask(self, positions: tuple[int, ...]) -> None:
        """Record that the application has requested to enable drives."""
        self._asked.update(positions)
        self._announced.difference_update(positions)

    def take_stop(self, position: int, *, reason: bool) -> None:
        """Record that the application received the event of a stop.

        Args:
            position: Position of the drive.
            reason: True if `Drives.stopped` has a reason.
        """
        self._announced.add(position)
        self._unannounced.pop(position, None)
        if not reason:
            what = f"device {position}: an event, but no reason in `stopped`"
            self.violate("no silent stop", what, about=str(position))

    def all_well(self) -> None:
        """Record that all devices have recovered after an incident."""
        self.calm, self._quiet_since = True, self.segment.time
        self._reported.clear()

    def disturb(self) -> None:
        """Record the start of an incident."""
        self.calm, self._quiet_since = False, inf

    def give_up(self) -> None:
        """Record that the loop of an incident was left. The next loop starts without one."""
        self._quiet_since = self.segment.time

    def quiet_since(self, time: float) -> bool:
        """Return True if no incident was open at `time` [s] or later."""
        return self._quiet_since <= time

    # Checks of the devices

    def _check(self) -> None:
        self.segment.service.agenda.after(LOOK, self._check)
        self.injected.update()
        if self.setting.mode == "cst":
            apply_loads(self.segment)
        now = self.segment.time
        states = [device.state for device in self.segment]
        for position, state in enumerate(states):
            self._check_state(position, state, now)
            silent = now - self._silent_since(position)
            if silent > self._watchdogs.get(position, WATCHDOG) + MARGIN:
                self._check_safety(position, silent)
        for position in SERVOS:
            self._check_drive(position, states[position], now)
        if self.setting.clocks and self.calm and self.phase is Phase.RUNNING:
            self._check_clocks()

    def _check_clocks(self) -> None:
        position, difference = self.worst_clock()
        if abs(difference) > CLOCK_BOUND:
            what = f"device {position} is {difference * 1e6:+.3f} us off without a fault"
            self.violate("clocks within bound", what, about=str(position))

    def worst_clock(self) -> tuple[int, float]:
        """Return the drive with the largest clock difference, and the difference [s]."""
        core = self.segment.core
        reference = core.system_time(COUPLER)
        found = {p: (core.system_time(p) - reference) * 1e-9 for p in SERVOS}
        position = max(found, key=lambda p: abs(found[p]))
        return position, found[position]

    def _silent_since(self, position: int) -> float:
        """Return the time since which a device has no outputs; infinity if it has them."""
        since = self.injected.isolated_since(position)
        return min(since, self._left) if self.phase is Phase.LEFT else since

    def _check_state(self, position: int, state: int, now: float) -> None:
        if state != OP:
            self._op_since[position] = inf
            if self.calm and self.phase is Phase.RUNNING:
                what = f"device {position} is in state 0x{state:02X} without a fault"
                self.violate("in OP", what, about=str(position))
        elif self._op_since[position] == inf:
            self._op_since[position] = now

    def _check_safety(self, position: int, silent: float) -> None:
        device = self.segment[position]
        what = f"device {position}, {silent:.4f} s without outputs"
        if isinstance(device, DigitalOutputs) and device.outputs:
            self.violate("outputs safe", f"{what}: 0x{device.outputs:02X}", about=str(position))
        if isinstance(device, Servo) and self._is_enabled(device) and not self._is_frozen(position):
            self.violate("outputs safe", f"{what}: {device.drive_state()}", about=str(position))

    def _check_drive(self, position: int, state: int, now: float) -> None:
        servo = self.segment[position]
        if not isinstance(servo, Servo):
            return
        if state == 0:
            self._idle_since[position] = (
                now  # without power, the model stands still until it returns
            )
        moving = state != 0 and not self._is_frozen(position)
        velocity = abs(servo.velocity_rad_s) if moving else 0.0
        self._check_commands(position, servo, state, now)
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

    def _check_commands(self, position: int, servo: Servo, state: int, now: float) -> None:
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
        """Return True if the model of a device stands still, or is catching up."""
        now = self.segment.time
        return any(
            isinstance(fault, f.Freeze) and fault.device == position
            for fault in self.injected.between(now - 0.5, now)
        )

    def _is_garbled(self, now: float) -> bool:
        """Return True if undetectable wrong positions were received, which may be followed."""
        recent = self.injected.between(now - 0.5, now)
        return any(isinstance(fault, f.Garble) for fault in recent)

    # Checks of the application's view

    def judge_cycle(self, ok: bool, present: Mapping[int, bool]) -> None:
        """Judge one cycle of the loop from the view of the application.

        Args:
            ok: `ok` of the cycle.
            present: True for each device that answered, by position.
        """
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
                what = f"device {position} is out of reach, but its inputs are reported as valid"
                self.violate("no silent loss", what, about=str(position))

    def _judge_stops(self, present: Mapping[int, bool]) -> None:
        """Check that each stopped axis is announced while its device answers."""
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
            return self.segment.ring  # the ring is open while its delays are measured
        if cause == "injected":
            return any(isinstance(fault, f.LoseFrames) for fault in faults)
        if cause == "corrupt":
            return any(isinstance(fault, f.Corrupt) for fault in faults)
        return any(breaks_cable(fault) for fault in faults)

    def _detected(self, cause: str) -> float:
        """Return the longest time from the start of a fault to its loss [s]."""
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
