"""Homing that the drive performs in mode 6, CiA 402-2 / IEC 61800-7-201 §13."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

from catenary.drive.port import AxisPort, Failure, Steps, await_condition, mode_is
from catenary.drive.units import AxisUnits
from catenary.types import DINT, SINT, UDINT
from catenary.wire.cia402 import Control, Mode, Object, Status

START = int(Control.MODE_4)
HALT = int(Control.HALT)
ATTAINED = int(Status.MODE_12 | Status.TARGET_REACHED)
FAILED = int(Status.MODE_13)
ANSWER_CYCLES = 10  # until the statusword reflects a new controlword
MODE_TIMEOUT = 5.0  # [s] to change the mode


@dataclass(frozen=True, slots=True)
class HomingMethod:
    """Homing settings of an axis, which the loop writes to the drive when it opens.

    None leaves a setting of the drive unchanged. All values are at the joint.

    Args:
        method: homing method (0x6098), see the manual of the drive. 37 makes the present position
            home. 1 to 34 use switches and index pulses. Negative methods are manufacturer-specific,
            for example against a hard stop.
        speed: speed during the search for the switch or stop (0x6099:01) [rad/s].
        slow: speed during the search for zero (0x6099:02) [rad/s].
        acceleration: acceleration and deceleration (0x609A) [rad/s²].
        offset: distance from home to zero (0x607C) [rad]. By the standard, the axis reads -offset
            at home. Some drives read +offset.

    Raises:
        ValueError: A value is out of range.
    """

    method: int | None = None
    speed: float | None = None
    slow: float | None = None
    acceleration: float | None = None
    offset: float | None = None

    def __post_init__(self) -> None:
        if self.method is not None and not -128 <= self.method <= 127:
            raise ValueError(f"method={self.method} must be from -128 to 127")
        for name in ("speed", "slow", "acceleration"):
            value = getattr(self, name)
            if value is not None and not 0 < value < math.inf:
                raise ValueError(f"{name}={value} must be positive and finite")
        if self.offset is not None and not math.isfinite(self.offset):
            raise ValueError(f"offset={self.offset} must be finite")

    def offset_counts(self, units: AxisUnits) -> int | None:
        """Return 0x607C [counts]; None if no offset is given."""
        return None if self.offset is None else round(self.offset / units.position_scale)

    def downloads(self, units: AxisUnits, base: int) -> tuple[tuple[int, int, bytes], ...]:
        """Return (index, subindex, data) of the given settings.

        Args:
            units: units of the axis.
            base: index offset of the slot.
        """
        found: list[tuple[int, int, bytes]] = []
        if self.method is not None:
            found.append((Object.HOMING_METHOD + base, 0, SINT.encode(self.method)))
        counts = self.offset_counts(units)
        if counts is not None:
            found.append((Object.HOME_OFFSET + base, 0, DINT.encode(counts)))
        for index, subindex, value in (
            (Object.HOMING_SPEEDS, 1, self.speed),
            (Object.HOMING_SPEEDS, 2, self.slow),
            (Object.HOMING_ACCELERATION, 0, self.acceleration),
        ):
            if value is not None:
                speed = max(1, round(value / abs(units.velocity_scale)))
                found.append((index + base, subindex, UDINT.encode(speed)))
        return tuple(found)


def home_axis(port: AxisPort, before: int) -> Steps:
    """Run a homing in mode 6, then return to the previous mode.

    Args:
        port: the axis.
        before: previous mode.

    Raises:
        MoveError: The drive reports an error, or does not change its mode.
    """
    port.request_mode(Mode.HM)
    try:
        yield from _await_mode(port, Mode.HM)
        port.clear_bits(HALT)  # a failed move in PP leaves it set
        port.set_bits(START)
        for count in itertools.count():
            yield
            if count < ANSWER_CYCLES:
                continue
            if port.status & FAILED:
                what = f"reports a homing error (statusword 0x{port.status:04X}, bit 13)"
                hint = "check in the manual that the drive supports the method (0x6098)"
                raise port.error(Failure(what, hint))
            if port.has_bits(ATTAINED):
                break
    finally:
        leave_homing(port, before)
    yield from _await_mode(port, before)


def leave_homing(port: AxisPort, mode: int) -> None:
    """End the homing and request another mode."""
    port.clear_bits(START)
    port.request_mode(mode)


def stop_homing(port: AxisPort, mode: int) -> Steps:
    """End the homing, and wait until the drive is in another mode and follows its targets.

    Raises:
        MoveError: The drive does not change its mode in time.
    """
    leave_homing(port, mode)
    yield
    yield from _await_mode(port, mode)


def _await_mode(port: AxisPort, mode: int) -> Steps:
    failure = Failure(
        f"does not report mode {mode} (0x6061) within {MODE_TIMEOUT:g} s",
        "check that the drive supports this mode (0x6502, manual)",
    )
    yield from await_condition(port, mode_is(port, mode), MODE_TIMEOUT, failure)
