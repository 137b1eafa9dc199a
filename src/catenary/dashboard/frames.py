"""Binary frames with the values of signals, for the WebSocket.

The header has 32 bytes, little endian: u8 kind, u8 version, u16 id of the subscription, u32 rows,
u32 signals, u32 lost rows before this frame, f64 number of the first cycle, f64 period [s].
Kind 1: f64 time[rows] [s], then for each signal f64 value[rows].
Kind 2: f64 time[rows], then for each signal f32 minimum[rows], f32 maximum[rows].
"""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from catenary.record.layout import Layout
from catenary.share import ShareLayout

HEADER = struct.Struct("<BBHIIIdd")
VERSION = 1
FULL, DECIMATED = 1, 2
SIGNAL = re.compile(r"(?P<name>.+?)(?:\[(?P<index>\d{1,6})\])?\Z", re.DOTALL)

Rows = npt.NDArray[np.void]
Column = tuple[str, int | None]


@dataclass(frozen=True, slots=True)
class Frame:
    """Encoded values of a set of signals; the header is made for each subscription."""

    kind: int
    rows: int
    signals: int
    lost: int
    first: int  # number of the first cycle
    period: float  # [s]
    body: bytes

    def for_subscription(self, id: int, dropped: int = 0) -> bytes:
        """Return the frame with its header.

        Args:
            id: number of the subscription.
            dropped: number of further rows that this client has not received.
        """
        lost = min(self.lost + dropped, 0xFFFFFFFF)
        head = (self.kind, VERSION, id, self.rows, self.signals, lost)
        return HEADER.pack(*head, float(self.first), self.period) + self.body


def find_columns(layout: ShareLayout | Layout, signals: Sequence[str]) -> list[Column]:
    """Return field and index of each signal, such as "position[0]" or "number".

    Raises ValueError if the layout has no such signal.
    """
    shapes = {field.name: field.shape for field in layout.fields}
    return [_find_column(layout.name, shapes, signal) for signal in signals]


def _find_column(share: str, shapes: Mapping[str, tuple[int, ...]], signal: str) -> Column:
    if shapes.get(signal) == ():
        return signal, None
    found = SIGNAL.match(signal)
    name, index = (found["name"], found["index"]) if found is not None else (signal, None)
    shape = shapes.get(name)
    if shape and index is not None and len(shape) == 1 and int(index) < shape[0]:
        return name, int(index)
    raise ValueError(f"the share {share!r} has no signal {signal!r}")


def encode_full(rows: Rows, columns: Sequence[Column], lost: int, period: float) -> Frame:
    """Encode every row.

    Args:
        rows: rows of a share, shape (rows,).
        columns: the signals.
        lost: number of rows lost before.
        period: period of the loop [s].
    """
    values = np.empty((1 + len(columns), len(rows)))
    values[0] = rows["scheduled_ns"] * 1e-9
    for line, column in zip(values[1:], columns, strict=True):
        line[:] = column_of(rows, column)
    first = int(rows["number"][0])
    return Frame(FULL, len(rows), len(columns), lost, first, period, values.tobytes())


def encode_decimated(rows: Rows, columns: Sequence[Column], lost: int, period: float) -> Frame:
    """Encode the minimum and the maximum of all rows: a frame with one row.

    NaN values are ignored, unless all values of a signal are NaN.

    Args:
        rows: rows of a share, shape (rows,).
        columns: the signals.
        lost: number of rows lost before.
        period: period of the loop [s].
    """
    bounds = np.empty((len(columns), 2), np.float32)
    for pair, column in zip(bounds, columns, strict=True):
        pair[:] = extremes(column_of(rows, column))
    time = struct.pack("<d", float(rows["scheduled_ns"][0]) * 1e-9)
    first = int(rows["number"][0])
    return Frame(DECIMATED, 1, len(columns), lost, first, period, time + bounds.tobytes())


def extremes(values: npt.NDArray[np.generic]) -> tuple[float, float]:
    """Return the minimum and the maximum; NaN only if all values are NaN."""
    if values.dtype.kind != "f":
        return float(values.min()), float(values.max())
    return float(np.fmin.reduce(values)), float(np.fmax.reduce(values))


def column_of(rows: Rows, column: Column) -> npt.NDArray[np.generic]:
    """Return the values of a signal, shape (rows,)."""
    name, index = column
    return rows[name] if index is None else rows[name][:, index]
