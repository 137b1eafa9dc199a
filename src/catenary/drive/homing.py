"""Homing by the drives themselves: mode 6, CiA 402-2 / IEC 61800-7-201 §13."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from catenary.drive.units import AxisUnits
from catenary.errors import DriveError
from catenary.plan.wish import Views
from catenary.types import DINT, SINT, UDINT
from catenary.wire.cia402 import Control, Mode, Object, Status

START = int(Control.MODE_4)
ATTAINED = int(Status.MODE_12 | Status.TARGET_REACHED)
FAILED = int(Status.MODE_13)
ANSWER_CYCLES = 10  # until the statusword can be the answer to a controlword


class Timed(Protocol):
    """A cycle of a loop."""

    @property
    def time(self) -> float: ...


@dataclass(frozen=True, slots=True)
class HomingMethod:
    """How an axis finds its home, written to the drive when the loop opens; None: as the drive has
    it.

    `method`: 0x6098 as the drive's manual says: 37, the present position is home; 1 to 34, by
    switches and index pulses; negative ones are the manufacturer's, hard stops among them. `speed`
    [rad/s] at the joint towards the switch or stop (0x6099:01), `slow` [rad/s] towards zero
    (0x6099:02), `acceleration` [rad/s²] (0x609A). `offset` [rad] from home to zero (0x607C): the
    profile has it that the axis shows -offset at home; some drives show +offset.
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
        """(index, subindex, data) of what is given; `base`: of the axis' slot."""
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


def run_homing(
    views: Views,
    names: Sequence[str],
    loop: Iterable[Timed],
    axes: npt.NDArray[np.intp],
    timeout: float,
) -> None:
    """Mode 6, start, wait for the answer, back to the modes before. DriveError names the axis."""
    before = views.mode_target[axes].copy()
    cycles = iter(loop)
    try:
        views.mode_target[axes] = Mode.HM
        for _ in _until(cycles, timeout, views, names, axes, "does not show mode 6"):
            if (views.mode_actual[axes] == Mode.HM).all() and _followed(views, axes).all():
                break
        views.controlword_bits[axes] |= START
        _await_answer(cycles, views, names, axes, timeout)
    finally:
        views.controlword_bits[axes] &= ~START & 0xFFFF
        views.mode_target[axes] = before
    for _ in _until(cycles, timeout, views, names, axes, "does not leave mode 6"):
        if (views.mode_actual[axes] == before).all() and _followed(views, axes).all():
            return


def _await_answer(
    cycles: Iterator[Timed],
    views: Views,
    names: Sequence[str],
    axes: npt.NDArray[np.intp],
    timeout: float,
) -> None:
    waiting = _until(cycles, timeout, views, names, axes, "has not found its home")
    for count, _ in enumerate(waiting):
        if count < ANSWER_CYCLES:
            continue
        status = views.statusword[axes]
        for axis in axes[(status & FAILED) != 0].tolist():
            raise DriveError(
                f"{names[axis]} reports a homing error (statusword "
                f"0x{views.statusword.item(axis):04X}, bit 13)",
                hint="the method (0x6098) may be none of the drive's: see its manual",
            )
        if ((status & ATTAINED) == ATTAINED).all():
            return


def _until(
    cycles: Iterator[Timed],
    timeout: float,
    views: Views,
    names: Sequence[str],
    axes: npt.NDArray[np.intp],
    what: str,
) -> Iterator[Timed]:
    """Cycles; DriveError when an axis drops out, or after `timeout` [s]."""
    start: float | None = None
    for cycle in cycles:
        start = cycle.time if start is None else start
        for axis in axes[(views.axis_flags[axes] >> 6) != 1].tolist():
            raise DriveError(
                f"{names[axis]} was enabled no longer while it was homing",
                hint="see Drives.state and its error code (0x603F)",
            )
        yield cycle
        if cycle.time - start > timeout:
            axis = int(axes[(views.statusword[axes] & ATTAINED) != ATTAINED][:1].sum())
            raise DriveError(
                f"{names[axis]} {what} within {timeout:g} s",
                hint="a longer timeout=, a higher speed (0x6099), or nothing is there to be found",
            )


def _followed(views: Views, axes: npt.NDArray[np.intp]) -> npt.NDArray[np.bool_]:
    return (views.axis_flags[axes] & 1).astype(np.bool_)
