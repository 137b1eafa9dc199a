"""Reader of the newest sample of a sensor, with its age and validity."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import Self

import numpy as np
import numpy.typing as npt

from catenary.errors import ShareError
from catenary.sensors.row import CYCLE_FIELDS, INVALID, SENSOR_FIELDS, empty_row
from catenary.share import Reader, ShareLayout
from catenary.share import attach as attach_share

PERIODS = 3.0  # default of `max_age`, in periods of the sensor
ALIVE_AGE = 0.25  # [s]; with an older sample, the program of the sensor is checked
ATTACH_INTERVAL_NS = 500_000_000  # between two attempts to attach again
ENDINGS = {"running": "returned", "ended": "ended", "dead": "died"}
OWN = {name for name, *_ in (*CYCLE_FIELDS, *SENSOR_FIELDS)}


@dataclass(frozen=True, slots=True)
class Reading:
    """Newest sample of a sensor. The values of an invalid reading are NaN; whole numbers are 0."""

    values: Mapping[str, npt.NDArray[np.generic]]  # by channel, in the units of the channels
    time_ns: int  # time of the sample on CLOCK_MONOTONIC; 0 before the first sample
    age: float  # from the time of the sample until now [s]; inf before the first sample
    rate: float  # measured rate [Hz]; 0 if the reading is invalid
    valid: bool  # False: do not use the values
    reason: str  # why the reading is invalid; empty if it is valid

    def __getitem__(self, channel: str) -> npt.NDArray[np.generic]:
        return self.values[channel]


def attach(name: str, max_age: float | None = None, *, uid: int | None = None) -> SensorReader:
    """Open the share of a sensor for reading. Use the result in a `with` block.

    Args:
        name: name of the share.
        max_age: age at which a sample becomes invalid [s]; None: three periods of the sensor.
        uid: owner of the share, as for `cat.attach`.

    Raises:
        ShareError: the share cannot be opened, or does not belong to a sensor.
        ValueError: `max_age` is not positive.
    """
    return SensorReader(name, max_age, uid=uid)


class SensorReader:
    """Reader of one sensor. `sensors.attach` creates it.

        with sensors.attach("arm.wrist") as wrist:
            now = wrist.read()
            if now.valid:
                print(now["force"], now.age)

    If the program of the sensor ends, readings are invalid. When it returns, the reader attaches
    again.
    """

    def __init__(self, name: str, max_age: float | None, *, uid: int | None = None) -> None:
        if max_age is not None and not max_age > 0:
            raise ValueError(f"max_age={max_age} s: must be positive")
        self.name = name
        self._max_age, self._uid = max_age, uid
        self._next_attach_ns = 0
        self._connect(open_sensor(name, uid))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    @property
    def layout(self) -> ShareLayout:
        """Layout of the share."""
        return self._reader.layout

    @property
    def max_age(self) -> float:
        """Age at which a sample becomes invalid [s]."""
        return PERIODS * self.layout.period if self._max_age is None else self._max_age

    def read(self, now_ns: int | None = None) -> Reading:
        """Return the newest sample. Never waits, and never raises because of the sensor.

        Args:
            now_ns: time for the age on CLOCK_MONOTONIC; None: now.
        """
        if not self._reader.number:
            reason = "no sample yet" if self._reader.alive else self._end()
            return self._reading(self._empty, None, now_ns, reason)
        row = self._reader.read()
        now = time.monotonic_ns() if now_ns is None else now_ns
        age = (now - int(row["scheduled_ns"])) * 1e-9
        if not row["valid"]:
            reason = self._invalid_reason()
        elif age > min(self.max_age, ALIVE_AGE) and not self._reader.alive:
            reason = self._end()
        elif age > self.max_age:
            reason = "the sample is too old"
        else:
            return self._reading(row, row, now, "")
        return self._reading(self._empty, row, now, reason)

    def wait(self, timeout: float | None = None) -> bool:
        """Wait for a sample after the last one that was read.

        Return False after `timeout` [s], or if the program of the sensor has ended. None sets no
        limit.
        """
        return self._reader.wait(timeout)

    def close(self) -> None:
        """Detach from the share."""
        self._reader.close()

    def _connect(self, reader: Reader) -> None:
        self._reader = reader
        self._channels = [each.name for each in reader.layout.fields if each.name not in OWN]
        self._empty = empty_row(reader.dtype)
        self._serial, self._invalid = 0, "the sensor reports invalid data"

    def _reading(
        self, values: np.void, row: np.void | None, now_ns: int | None, reason: str
    ) -> Reading:
        """Return a reading with the values of one row and the time of another one.

        Args:
            values: row with the values.
            row: row with the time; None before the first sample.
            now_ns: time for the age.
            reason: why the reading is invalid.
        """
        channels = {name: np.asarray(values[name]) for name in self._channels}
        if row is None or now_ns is None:
            return Reading(channels, 0, np.inf, 0.0, False, reason)
        time_ns = int(row["scheduled_ns"])
        rate = 0.0 if reason else float(row["measured_rate"])
        return Reading(channels, time_ns, (now_ns - time_ns) * 1e-9, rate, not reason, reason)

    def _invalid_reason(self) -> str:
        """Return the newest reason that the writer has reported."""
        events, _ = self._reader.events(self._serial)
        for event in events:
            self._serial = event.serial
            if event.kind == INVALID:
                self._invalid = event.message
        return self._invalid

    def _end(self) -> str:
        """Try to attach again after the end of the writer. Return the reason of the end."""
        reason = f"the program of the sensor has {ENDINGS[self._reader.state]}"
        now = time.monotonic_ns()
        if now < self._next_attach_ns:
            return reason
        self._next_attach_ns = now + ATTACH_INTERVAL_NS
        try:
            reader = open_sensor(self.name, self._uid)
        except ShareError:
            return reason
        if reader.layout.fields != self.layout.fields:
            reader.close()
            return "the sensor now has other channels: attach again"
        self._reader.close()
        self._connect(reader)
        return reason


def open_sensor(name: str, uid: int | None) -> Reader:
    """Open a share, and check that it belongs to a sensor.

    Args:
        name: name of the share.
        uid: owner of the share, as for `cat.attach`.

    Raises:
        ShareError: the share cannot be opened, or does not belong to a sensor.
    """
    reader = attach_share(name, uid=uid)
    names = {field.name for field in reader.layout.fields}
    if not names >= OWN:
        reader.close()
        raise ShareError(
            f"the share {name!r} does not belong to a sensor",
            hint="read the share of a loop with cat.attach",
        )
    return reader
