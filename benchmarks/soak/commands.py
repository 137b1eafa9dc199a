"""Commands that a servo took from its frames, checked against the limits of the core.

The limits are in docs/explanation/safety.md. velocity_limit bounds every command. Acceleration and
deceleration bound fallback and return, but not the set-points of the application. A frame that
carries a stop keeps the torque.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from benchmarks.soak.cell import (
    ACCELERATION,
    AMPLITUDE,
    COUNTS_PER_TURN,
    FREQUENCY,
    LATE_LIMIT,
    PERIOD,
    TORQUE_LIMIT,
    VELOCITY_LIMIT,
)
from benchmarks.soak.setting import Mode
from catenary.virtual import Servo

COUNT = 2 * math.pi / COUNTS_PER_TURN  # [rad]
SETTLED = 8  # cycles after enabling: the core's view of the drive is some cycles old
ENABLE, QUICK_STOP, DISABLE_OPERATION = 0x0F, 0x02, 0x07
# While the application is late, its velocity changes. The core receives the change in one cycle.
# A return ends within one step of velocity and one of position. Three positions are rounded.
OWN = AMPLITUDE * FREQUENCY**2 * LATE_LIMIT / PERIOD
FASTEST_CHANGE = {
    "csp": 2 * ACCELERATION + OWN + 2 * COUNT / PERIOD**2,
    "csv": ACCELERATION + OWN + COUNT / PERIOD,
}
TOLERANCE = 1.001
NOTEWORTHY = 50  # per mille of the rated torque; less may reach zero in one cycle without a stop

Broken = tuple[str, str]  # invariant, description


class Taken(NamedTuple):
    """Outputs that a servo took at one time."""

    time_ns: int
    controlword: int
    command: float  # [rad] in CSP, [rad/s] in CSV, [N·m] in CST
    torque: int  # 0x6071, per mille


class Commands:
    """Owns the last commands that one servo took while it was enabled."""

    def __init__(self, mode: Mode) -> None:
        self._mode = mode
        self.reset()

    def reset(self) -> None:
        """Discard the commands, because the drive was not enabled or was excused."""
        self._last: Taken | None = None
        self._velocity: float | None = None  # of the command in the last cycle [rad/s]
        self._settled = 0

    def look(self, servo: Servo, drive_state: str) -> list[Broken]:
        """Return the violations of new commands. Called once a millisecond."""
        taken = self._take(servo)
        last = self._last
        if taken is None or (last is not None and taken.time_ns == last.time_ns):
            return []
        self._last = taken
        if last is None or drive_state not in ("OPERATION ENABLED", "QUICK STOP ACTIVE"):
            self._velocity = None
            return []
        cycles = max(1, round((taken.time_ns - last.time_ns) * 1e-9 / PERIOD))
        self._settled += 1
        found = self._stop(last, taken) if cycles == 1 else []
        if drive_state == "OPERATION ENABLED" and self._settled > SETTLED:
            found += self._limits(last, taken, cycles)
        return found

    def _take(self, servo: Servo) -> Taken | None:
        taken_ns = servo.outputs_taken_ns
        if taken_ns is None:
            return None
        received = servo.received()
        if self._mode == "csp":
            command = received.position * COUNT
        elif self._mode == "csv":
            command = received.velocity * COUNT
        else:
            command = received.torque * 1e-3 * servo.rated_torque
        return Taken(taken_ns, received.controlword & 0xFFFF, command, received.torque)

    def _stop(self, last: Taken, taken: Taken) -> list[Broken]:
        """Judge the frame that carries a stop."""
        stops = taken.controlword in (QUICK_STOP, DISABLE_OPERATION)
        begins = last.controlword & ENABLE == ENABLE and stops
        if self._mode != "cst" or not begins or abs(last.torque) < NOTEWORTHY or taken.torque:
            return []
        what = f"0x{taken.controlword:02X} with 0 per mille, {last.torque} in the cycle before"
        return [("a stop keeps the torque", what)]

    def _limits(self, last: Taken, taken: Taken, cycles: int) -> list[Broken]:
        if self._mode == "cst":
            return _above("torque_limit", abs(taken.command), TORQUE_LIMIT + 1e-3, "N·m")
        velocity = taken.command
        if self._mode == "csp":
            velocity = (taken.command - last.command) / (cycles * PERIOD)
        found = _above("velocity_limit", abs(velocity), VELOCITY_LIMIT + COUNT / PERIOD, "rad/s")
        if self._velocity is not None and cycles == 1:
            change = abs(velocity - self._velocity) / PERIOD
            found += _above("acceleration", change, FASTEST_CHANGE[self._mode], "rad/s²")
        self._velocity = velocity if cycles == 1 or self._mode == "csv" else None
        return found


def _above(name: str, value: float, limit: float, unit: str) -> list[Broken]:
    if value <= limit * TOLERANCE:
        return []
    return [("commands within limits", f"{name}: {value:.3f} {unit} is commanded, not {limit:.3f}")]
