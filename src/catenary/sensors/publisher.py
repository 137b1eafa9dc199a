"""Publication of the samples of a sensor, in the format of the share of a loop."""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import Self

import numpy as np

from catenary.core import CYCLE_OK
from catenary.plan.sink import Incident
from catenary.sensors.row import INVALID, VALID, empty_row, make_sink_layout, row_dtype
from catenary.sensors.sensor import Channel, Value
from catenary.share.share import Share

HISTORY = 2.0  # [s]
RATE_SAMPLES = 64  # largest number of samples for the measured rate
EVENT_PAUSE_NS = 1_000_000_000  # the same reason is not reported again earlier
INVALID_DATA = "the sensor reports invalid data"
NOT_FINITE = "a value is not finite"
TIME_BACK = "the time of the samples went back"
FUTURE = "the time of a sample is in the future: it must be on CLOCK_MONOTONIC"

log = logging.getLogger(__name__)


class SensorShare:
    """Owner of a share with the samples of one sensor.

        channels = [Channel("force", "N", (3,)), Channel("torque", "N·m", (3,))]
        with SensorShare("arm.wrist", channels, rate=500.0) as share:
            share.publish({"force": [0, 0, 1.5], "torque": [0, 0, 0]}, time.monotonic_ns())

    Any process of this user reads it with `sensors.attach("arm.wrist")` or `cat.attach`. Only one
    thread may publish. Changes of the validity are events, and warnings of `logging`.

    Args:
        name: name of the share.
        channels: quantities of a sample.
        rate: nominal number of samples per second [Hz].
        history: time span of the samples that readers can access [s].
        mode: permissions as for chmod.

    Raises:
        ShareError: on entry, if the name belongs to a running process or another user.
        ValueError: an argument is out of range, or two fields have the same name.
    """

    def __init__(
        self,
        name: str,
        channels: Sequence[Channel],
        rate: float,
        *,
        history: float = HISTORY,
        mode: int = 0o600,
    ) -> None:
        self.name, self.channels, self.rate = name, tuple(channels), rate
        self._dtype = row_dtype(self.channels, rate)
        self._share = Share(name, history=history, mode=mode)
        self._number = 0
        self._first_ns = self._last_ns = 0
        self._times: deque[int] = deque(maxlen=RATE_SAMPLES)
        self._invalid = 0  # samples without a valid one
        self._reason, self._reported_ns, self._announced = "", 0, False

    def __enter__(self) -> Self:
        self._share.__enter__()
        try:
            self._share.open(make_sink_layout(self.channels, self.rate, self._dtype))
        except BaseException as error:
            self._share.__exit__(type(error), error, error.__traceback__)
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._share.__exit__(kind, error, traceback)

    def publish(
        self,
        values: Mapping[str, Value],
        time_ns: int,
        valid: bool = True,
        received_ns: int | None = None,
        reason: str = "",
    ) -> None:
        """Publish one sample.

        A sample with a value that is not finite, with a time before that of the previous sample,
        or with a time in the future is published as invalid.

        Args:
            values: value of each channel by name.
            time_ns: time of the measurement on CLOCK_MONOTONIC.
            valid: False if the values must not be used.
            received_ns: time of reception on CLOCK_MONOTONIC; None: now.
            reason: why the sample is invalid. Do not put changing numbers into it.

        Raises:
            RuntimeError: the share is not entered.
            ValueError: a channel is missing or unknown, or has another shape.
        """
        received = time.monotonic_ns() if received_ns is None else received_ns
        row = self._row_of(values)
        wrong_time = self._wrong_time(time_ns, received)
        if not wrong_time:
            self._last_ns = time_ns
        at = received if wrong_time else time_ns
        found = wrong_time or self._wrong_value(row)
        if not valid:
            found = reason or INVALID_DATA
        if found:
            self._write_invalid(row, at, received, found)
        else:
            self._write(row, at, received)

    def invalidate(self, reason: str, now_ns: int | None = None) -> None:
        """Publish a sample without values: readers get NaN, and 0 for whole numbers.

        Args:
            reason: why there are no values. Do not put changing numbers into it.
            now_ns: time on CLOCK_MONOTONIC; None: now.

        Raises:
            RuntimeError: the share is not entered.
        """
        now = time.monotonic_ns() if now_ns is None else now_ns
        self._times.clear()
        self._write_invalid(empty_row(self._dtype), now, now, reason)

    def report(self, kind: str, message: str, now_ns: int | None = None) -> None:
        """Append an event that readers, recorders and the dashboard receive.

        Args:
            kind: kind of the event, in CamelCase.
            message: sentence without a full stop.
            now_ns: time on CLOCK_MONOTONIC; None: now.
        """
        now = time.monotonic_ns() if now_ns is None else now_ns
        self._share.report(Incident(kind, message, now * 1e-9))

    def _row_of(self, values: Mapping[str, Value]) -> np.void:
        row = empty_row(self._dtype)
        names = {channel.name for channel in self.channels}
        if values.keys() != names:
            raise ValueError(f"values of {sorted(values)}; the channels are {sorted(names)}")
        for channel in self.channels:
            value = np.asarray(values[channel.name])
            if value.shape != channel.shape:
                raise ValueError(
                    f"{channel.name!r} has shape {value.shape}; the channel has {channel.shape}"
                )
            row[channel.name] = value
        return row

    def _wrong_time(self, time_ns: int, received_ns: int) -> str:
        """Return why a time is wrong; empty if it is right."""
        if time_ns < self._last_ns:
            return TIME_BACK
        return FUTURE if time_ns > received_ns else ""

    def _wrong_value(self, row: np.void) -> str:
        """Return why the values of a row are wrong; empty if they are right."""
        finite = all(np.isfinite(row[channel.name]).all() for channel in self.channels)
        return "" if finite else NOT_FINITE

    def _write_invalid(self, row: np.void, time_ns: int, received_ns: int, reason: str) -> None:
        is_again = not self._invalid and received_ns - self._reported_ns >= EVENT_PAUSE_NS
        if reason != self._reason or is_again:
            self._announce(INVALID, reason, received_ns)
            self._reason, self._reported_ns, self._announced = reason, received_ns, True
        self._invalid += 1
        row["valid"] = 0
        self._append(row, time_ns, received_ns)

    def _write(self, row: np.void, time_ns: int, received_ns: int) -> None:
        if self._announced:
            self._announce(VALID, f"valid again after {self._invalid} invalid samples", received_ns)
        self._invalid, self._announced = 0, False
        self._times.append(time_ns)
        row["valid"], row["flags"] = 1, CYCLE_OK
        self._append(row, time_ns, received_ns)

    def _announce(self, kind: str, message: str, now_ns: int) -> None:
        self.report(kind, message, now_ns)
        log.warning("%s: %s", self.name, message)

    def _append(self, row: np.void, time_ns: int, received_ns: int) -> None:
        self._number += 1
        self._first_ns = self._first_ns or time_ns
        row["number"] = self._number
        row["time_ns"], row["scheduled_ns"] = time_ns - self._first_ns, time_ns
        row["received_ns"], row["lateness_ns"] = received_ns, received_ns - time_ns
        row["lost_in_row"], row["measured_rate"] = self._invalid, self._measured_rate()
        self._share.append(row.tobytes())

    def _measured_rate(self) -> float:
        """Return the rate of the last valid samples [Hz]; 0 for less than two samples."""
        if len(self._times) < 2 or self._times[-1] == self._times[0]:
            return 0.0
        return (len(self._times) - 1) * 1e9 / (self._times[-1] - self._times[0])
