"""Row of a sensor in a share: the fields of a cycle that viewers expect, and the channels."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

import numpy as np

from catenary.plan.sink import SinkField, SinkLayout
from catenary.sensors.sensor import Channel

INVALID = "SensorInvalid"  # kinds of events
VALID = "SensorValid"
# Fields that the row of a loop has, too. Recorders, pages and `catenary top` read them.
CYCLE_FIELDS = (
    ("number", "<u8", ""),
    ("time_ns", "<i8", "ns"),  # time of the sample since the first sample
    ("scheduled_ns", "<i8", "ns"),  # time of the sample on CLOCK_MONOTONIC
    ("lateness_ns", "<i8", "ns"),  # from the time of the sample to its reception
    ("receive_ns", "<i8", "ns"),  # -1: not known
    ("process_ns", "<i8", "ns"),
    ("send_ns", "<i8", "ns"),
    ("round_trip_ns", "<i8", "ns"),
    ("flags", "<u8", ""),  # CYCLE_OK in a valid sample
    ("lost_in_row", "<u8", ""),  # invalid samples since the last valid one
    ("skipped", "<u8", ""),
)
SENSOR_FIELDS = (
    ("received_ns", "<i8", "ns"),  # time of reception on CLOCK_MONOTONIC
    ("measured_rate", "<f8", "Hz"),  # of the last valid samples
    ("valid", "|u1", ""),  # 1: the values may be used
)
UNKNOWN = ("receive_ns", "process_ns", "send_ns", "round_trip_ns")


def row_dtype(channels: Sequence[Channel], rate: float) -> np.dtype[np.void]:
    """Return the type of a row.

    Args:
        channels: quantities of a sample.
        rate: nominal number of samples per second [Hz].

    Raises:
        ValueError: the rate is not positive and finite, a channel is not a scalar or vector of
            numbers, or two fields have the same name.
    """
    if not 0 < rate < math.inf:
        raise ValueError(f"rate={rate} Hz: must be positive and finite")
    own = [(name, kind) for name, kind, _ in (*CYCLE_FIELDS, *SENSOR_FIELDS)]
    names = [name for name, _ in own]
    for channel in channels:
        check_channel(channel)
        if channel.name in names:
            raise ValueError(f"the name {channel.name!r} is in use; choose another one")
        names.append(channel.name)
    return np.dtype([*own, *((each.name, each.dtype, each.shape) for each in channels)], align=True)


def check_channel(channel: Channel) -> None:
    """Raise ValueError unless a channel is a named scalar or vector of numbers."""
    kind = np.dtype(channel.dtype)
    if not isinstance(channel.shape, tuple):
        raise ValueError(f"{channel}: the shape of a vector of n numbers is (n,)")
    if not channel.name or len(channel.shape) > 1 or 0 in channel.shape:
        raise ValueError(f"{channel}: must have a name, and the shape () or (n,)")
    if kind.kind not in "iuf" or kind.newbyteorder("<") != kind:
        raise ValueError(f"{channel}: dtype must be a little-endian number, such as '<f8'")


def make_sink_layout(
    channels: Sequence[Channel], rate: float, dtype: np.dtype[np.void]
) -> SinkLayout:
    """Return the layout of the share of a sensor.

    Args:
        channels: quantities of a sample.
        rate: nominal number of samples per second [Hz].
        dtype: type of a row.
    """
    units = {name: unit for name, _, unit in (*CYCLE_FIELDS, *SENSOR_FIELDS)}
    units |= {channel.name: channel.unit for channel in channels}
    return SinkLayout(
        period=1.0 / rate,
        axes=(),
        fields=tuple(make_field(dtype, name, units[name]) for name in units),
        record_size=dtype.itemsize,
        actual_size=0,
        target_size=0,
        utc_offset_ns=time.time_ns() - time.monotonic_ns(),
        virtual_time=False,
    )


def make_field(dtype: np.dtype[np.void], name: str, unit: str) -> SinkField:
    """Return the description of a field of the row.

    Args:
        dtype: type of the row.
        name: name of the field.
        unit: unit of the field.
    """
    assert dtype.fields is not None
    kind, offset, *_ = dtype.fields[name]
    count = kind.shape[0] if kind.shape else None
    return SinkField(name, "record", offset, kind.base.str, count, unit)


def empty_row(dtype: np.dtype[np.void]) -> np.void:
    """Return a row without values: real numbers are NaN, whole numbers are 0."""
    row: np.void = np.zeros(1, dtype)[0]
    assert dtype.names is not None
    for name in dtype.names:
        if dtype[name].base.kind == "f":
            row[name] = np.nan
    for name in UNKNOWN:
        row[name] = -1
    return row
