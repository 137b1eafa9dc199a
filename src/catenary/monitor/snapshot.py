"""Summary of a share at one time: the loop, the bus since the last summary, and all axes.

All texts are plain: control characters in the names of devices are replaced.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from catenary.core import AXIS_DROPPED, AXIS_FALLBACK, AXIS_LIMITED, AXIS_REFUSED, CYCLE_OK
from catenary.share import Reader, ShareLayout
from catenary.wire.cia402 import Mode, state_of

Rows = npt.NDArray[np.void]
REMARKS = {
    AXIS_DROPPED: "stopped",
    AXIS_REFUSED: "refused",
    AXIS_LIMITED: "limited",
    AXIS_FALLBACK: "fallback",
}
PHASES = ("receive_ns", "process_ns", "send_ns")


@dataclass(frozen=True, slots=True)
class AxisSummary:
    """Newest values of one axis. Values are SI: rad or m, and their derivatives; N·m or N."""

    name: str
    state: str  # state of CiA 402, in lower case
    mode: str
    enabled: bool
    fault: bool
    position: float
    velocity: float
    torque: float
    commanded_position: float
    remarks: str  # such as "stopped, limited"; "" without


@dataclass(frozen=True, slots=True)
class BusSummary:
    """Bus and timing in the cycles since the last summary; durations in seconds."""

    cycles: int
    lost: int  # cycles without an answer of every required sync unit
    skipped: int  # cycles that were not sent because the one before was late
    lost_in_row: int  # at the newest cycle
    lateness: float  # largest
    in_controller: float  # median of receive, process and send; NaN if unknown
    round_trip: float  # median; NaN if unknown


@dataclass(frozen=True, slots=True)
class Summary:
    """Loop, bus and axes at one time."""

    number: int  # newest cycle
    time: float  # of its start, on the clock of the loop [s]
    bus: BusSummary
    axes: tuple[AxisSummary, ...]


class Summaries:
    """Source of the summaries of one share; it keeps the number of the last cycle."""

    def __init__(self, reader: Reader) -> None:
        self._reader = reader
        self._number = reader.number

    def take(self) -> Summary | None:
        """Return a summary of the cycles since the last call; None without a new cycle."""
        rows, overwritten = self._reader.rows(self._number)
        if not len(rows):
            return None
        self._number = int(rows["number"][-1])
        bus = bus_summary(rows, overwritten)
        newest = rows[-1]
        time = float(newest["scheduled_ns"]) * 1e-9
        return Summary(self._number, time, bus, axis_summaries(self._reader.layout, newest))


def bus_summary(rows: Rows, overwritten: int = 0) -> BusSummary:
    """Return the summary of consecutive cycles.

    Args:
        rows: cycles, at least one.
        overwritten: number of further cycles that could not be read.
    """
    phases = np.array([rows[name] for name in PHASES], np.float64)
    return BusSummary(
        cycles=len(rows) + overwritten,
        lost=int((rows["flags"] & CYCLE_OK == 0).sum()),
        skipped=int(rows["skipped"].sum()),
        lost_in_row=int(rows["lost_in_row"][-1]),
        lateness=float(rows["lateness_ns"].max()) * 1e-9,
        in_controller=_median(np.where(phases < 0, np.nan, phases).sum(axis=0)),
        round_trip=_median(np.where(rows["round_trip_ns"] < 0, np.nan, rows["round_trip_ns"])),
    )


def axis_summaries(layout: ShareLayout, row: Any) -> tuple[AxisSummary, ...]:
    """Return the summaries of all axes.

    Args:
        layout: layout of the share.
        row: one cycle.
    """
    return tuple(_axis(plain(name), row, axis) for axis, name in enumerate(layout.axes))


def plain(text: str) -> str:
    """Return a text with control characters replaced by '?'."""
    return "".join(c if c.isprintable() else "?" for c in text)


def _axis(name: str, row: Any, axis: int) -> AxisSummary:
    state = state_of(int(row["statusword"][axis]))
    flags = int(row["axis_flags"][axis])
    return AxisSummary(
        name=name,
        state="unknown" if state is None else state.name.lower().replace("_", " "),
        mode=mode_text(int(row["mode"][axis])),
        enabled=bool(row["enabled"][axis]),
        fault=state is not None and state.name.startswith("FAULT"),
        position=float(row["position"][axis]),
        velocity=float(row["velocity"][axis]),
        torque=float(row["torque"][axis]),
        commanded_position=float(row["commanded_position"][axis]),
        remarks=", ".join(text for bit, text in REMARKS.items() if flags & bit),
    )


def mode_text(mode: int) -> str:
    """Return the name of a mode of operation, or its number."""
    try:
        return Mode(mode).name
    except ValueError:
        return str(mode)


def _median(values_ns: npt.NDArray[np.float64]) -> float:
    known = values_ns[np.isfinite(values_ns)]
    return float(np.median(known)) * 1e-9 if len(known) else float("nan")
