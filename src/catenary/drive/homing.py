"""Homing by the drives themselves: mode 6, CiA 402-2 / IEC 61800-7-201 §13."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

from catenary.drive.port import AxisPort, Complaint, Steps, await_condition, mode_is
from catenary.drive.units import AxisUnits
from catenary.types import DINT, SINT, UDINT
from catenary.wire.cia402 import Control, Mode, Object, Status

START = int(Control.MODE_4)
HALT = int(Control.HALT)
ATTAINED = int(Status.MODE_12 | Status.TARGET_REACHED)
FAILED = int(Status.MODE_13)
ANSWER_CYCLES = 10  # until the statusword can reflect a controlword
MODE_TIMEOUT = 5.0  # [s] to change the mode


@dataclass(frozen=True, slots=True)
class HomingMethod:
    """Homing settings of an axis, written to the drive when the loop opens; None: unchanged.

    `method`: 0x6098 by the drive's manual. 37: the present position is home. 1 to 34: by switches
    and index pulses. Negative: specific to the manufacturer, for example hard stops. `speed`
    [rad/s] at the joint towards the switch or stop (0x6099:01), `slow` [rad/s] towards zero
    (0x6099:02), `acceleration` [rad/s²] (0x609A). `offset` [rad] from home to zero (0x607C): by
    the profile, the axis shows -offset at home; some drives show +offset.
    """

    method: int | None = None
    speed: float | None = None
    slow: float | None = None
    acceleration: float | None = None
    offset: float | None = None

    def __post_init__(self) -> None:
        if self.method is not None and not -128 <= self.method <= 127:
            raise ValueError(f"method={self.method}: -128 to 127")
        for name in ("speed", "slow", "acceleration"):
            value = getattr(self, name)
            if value is not None and not 0 < value < math.inf:
                raise ValueError(f"{name}={value}: must be positive")
        if self.offset is not None and not math.isfinite(self.offset):
            raise ValueError(f"offset={self.offset}: must be finite")

    def offset_counts(self, units: AxisUnits) -> int | None:
        """Return 0x607C [counts]; None if it is not given."""
        return None if self.offset is None else round(self.offset / units.position_scale)

    def downloads(self, units: AxisUnits, base: int) -> tuple[tuple[int, int, bytes], ...]:
        """Return (index, subindex, data) of the given settings; `base`: of the axis' slot."""
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
    """Search in mode 6, then return to the mode `before`.

    Raises:
        MoveError: The drive reports an error, or does not change its mode.
    """
    port.request_mode(Mode.HM)
    try:
        yield from _await_mode(port, Mode.HM)
        port.clear_bits(HALT)  # set by a failed move in PP
        port.set_bits(START)
        for count in itertools.count():
            yield
            if count < ANSWER_CYCLES:
                continue
            if port.status & FAILED:
                what = f"reports a homing error (statusword 0x{port.status:04X}, bit 13)"
                hint = "the method (0x6098) may be none of the drive's: see its manual"
                raise port.error(Complaint(what, hint))
            if port.has_bits(ATTAINED):
                break
    finally:
        leave_homing(port, before)
    yield from _await_mode(port, before)


def leave_homing(port: AxisPort, mode: int) -> None:
    """End a search and request another mode."""
    port.clear_bits(START)
    port.request_mode(mode)


def stop_homing(port: AxisPort, mode: int) -> Steps:
    """Wait until the drive works in its former mode."""
    leave_homing(port, mode)
    yield
    yield from _await_mode(port, mode)


def _await_mode(port: AxisPort, mode: int) -> Steps:
    complaint = Complaint(
        f"does not show mode {mode} (0x6061) within {MODE_TIMEOUT:g} s",
        "check that the drive supports it (0x6502, its manual)",
    )
    yield from await_condition(port, mode_is(port, mode), MODE_TIMEOUT, complaint)
