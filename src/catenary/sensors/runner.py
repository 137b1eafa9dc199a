"""Runner of a sensor: from a source of bytes to samples in a share.

It opens the source, starts the device, decodes its data, maps its clock to CLOCK_MONOTONIC and
publishes the samples. Silence, garbage and lost connections make the sensor invalid. The runner
then opens the source again, with pauses that double up to `Options.pause_max`.
"""

from __future__ import annotations

import math
import threading
import time
from dataclasses import dataclass
from types import TracebackType
from typing import Self

from catenary.sensors.clock_map import ClockMap
from catenary.sensors.publisher import SensorShare
from catenary.sensors.sensor import Connection, DataSource, Sample, Sensor

POLL = 0.1  # [s] longest wait, so that a stop request is seen
SILENCE_PERIODS, SILENCE_MIN = 10.0, 0.02  # default of `Options.silence`
FOREVER = 1e9  # [s]
NS = 1_000_000_000
DEVICE_TIME = "the time of the device went back or jumped"
NO_DATA = "no data"
GARBAGE = "data without a valid sample: check the protocol and the baud rate"


@dataclass(frozen=True, slots=True)
class Options:
    """Limits of a runner [s].

    Args:
        silence: time without a sample that makes the sensor invalid; None: ten periods, at least
            20 ms; inf for a device that sends only changes.
        reopen: time without a sample after which the source is opened again, at least `silence`.
        pause: pause before the first attempt to open the source again.
        pause_max: longest pause between two attempts.
        latency: known delay from the measurement to the reception; it is subtracted from times
            that the runner takes from the reception.

    Raises:
        ValueError: a limit is not positive, `latency` is negative, or `pause_max` is less than
            `pause`.
    """

    silence: float | None = None
    reopen: float = 1.0
    pause: float = 0.1
    pause_max: float = 5.0
    latency: float = 0.0

    def __post_init__(self) -> None:
        if self.silence is not None and not self.silence > 0:
            raise ValueError(f"silence={self.silence} s: must be positive")
        for name in ("reopen", "pause", "pause_max"):
            if not 0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name}={getattr(self, name)} s: must be positive and finite")
        if not 0 <= self.latency < math.inf:
            raise ValueError(f"latency={self.latency} s: must not be negative")
        if self.pause_max < self.pause:
            raise ValueError(f"pause_max={self.pause_max} s: must be at least pause={self.pause} s")


def run(
    sensor: Sensor,
    source: DataSource,
    share: SensorShare,
    *,
    stop: threading.Event | None = None,
    options: Options | None = None,
) -> None:
    """Publish the samples of a sensor until `stop` is set.

    Args:
        sensor: decoder of the device.
        source: source of its data.
        share: entered share with the channels of the sensor.
        stop: event that ends the run; None: run until an exception such as KeyboardInterrupt.
        options: time limits.

    Raises:
        ValueError: a sample does not match the channels of the share.
    """
    runner = Runner(sensor, source, share, options or Options())
    runner.run(stop or threading.Event())


class Runner:
    """Owner of the connection to a sensor, one at a time."""

    def __init__(
        self, sensor: Sensor, source: DataSource, share: SensorShare, options: Options
    ) -> None:
        self._sensor, self._source, self._share = sensor, source, share
        self._options = options
        silence = max(SILENCE_PERIODS / sensor.rate, SILENCE_MIN)
        self._silence_ns = round(min(options.silence or silence, FOREVER) * NS)
        self._reopen_ns = max(round(options.reopen * NS), self._silence_ns)
        self._latency_ns = round(options.latency * NS)
        self._clock = ClockMap()
        self._pause = options.pause
        self._sample_ns = 0  # time of the last sample, or of the opening
        self._data = False  # True if data came after the last sample
        self._silent = False

    def run(self, stop: threading.Event) -> None:
        """Open the source and publish samples until `stop` is set."""
        first = True
        while not stop.is_set():
            if not first:
                self._sensor.counters.reconnects += 1
                stop.wait(self._pause)
                self._pause = min(2.0 * self._pause, self._options.pause_max)
            first = False
            self._try_once(stop)

    def _try_once(self, stop: threading.Event) -> None:
        """Use one connection until it is lost or silent, or `stop` is set."""
        try:
            connection = self._source.open()
        except OSError as error:
            self._lost(f"cannot open {self._source.name}: {error.strerror or error}")
            return
        try:
            self._receive(connection, stop)
        except OSError as error:
            self._lost(f"lost the connection to {self._source.name}: {error.strerror or error}")
        finally:
            self._close(connection)

    def _receive(self, connection: Connection, stop: threading.Event) -> None:
        self._clock.restart()
        self._sample_ns = time.monotonic_ns()
        self._data = self._silent = False
        for message in self._sensor.start():
            connection.write(message)
        while not stop.is_set():
            data, received_ns = connection.read(min(POLL, self._silence_ns / NS))
            samples = self._sensor.feed(data, received_ns) if data else []
            for sample in samples:
                self._publish(sample, received_ns)
            self._note(bool(data), bool(samples), received_ns)
            if received_ns - self._sample_ns > self._reopen_ns:
                return

    def _close(self, connection: Connection) -> None:
        """Stop the device if it is still connected, and close the connection."""
        try:
            for message in self._sensor.stop():
                connection.write(message)
        except OSError:
            pass  # the connection is lost
        finally:
            connection.close()

    def _note(self, data: bool, samples: bool, now_ns: int) -> None:
        """Keep the time of the last sample, and invalidate the sensor when it is silent.

        Args:
            data: True if data arrived.
            samples: True if a sample arrived.
            now_ns: current time.
        """
        if samples:
            self._sample_ns, self._data, self._silent = now_ns, False, False
            self._pause = self._options.pause
            return
        self._data = self._data or data
        if not self._silent and now_ns - self._sample_ns > self._silence_ns:
            self._lost(GARBAGE if self._data else NO_DATA, now_ns)
            self._sensor.counters.silences += 1
            if not data:  # the wait has timed out, so the kernel has no old data either
                self._clock.restart()

    def _publish(self, sample: Sample, received_ns: int) -> None:
        time_ns, valid, reason = received_ns - self._latency_ns, sample.valid, sample.reason
        if sample.time_ns is not None and self._sensor.clock == "monotonic":
            time_ns = sample.time_ns
        elif sample.time_ns is not None:
            mapped = self._clock.map(sample.time_ns, received_ns - self._latency_ns)
            if mapped is None:
                self._sensor.counters.time_jumps += 1
                valid, reason = False, DEVICE_TIME
            time_ns = time_ns if mapped is None else mapped
        self._share.publish(sample.values, time_ns, valid, received_ns, reason)

    def _lost(self, reason: str, now_ns: int | None = None) -> None:
        self._silent = True
        self._share.invalidate(reason, now_ns)


class Task:
    """Thread that runs a sensor while the `with` block is active.

        with SensorShare("arm.wrist", ft.channels, ft.rate) as share, Task(ft, source, share):
            ...

    For a real-time program, run the sensor in a process of its own instead.

    Args:
        sensor: decoder of the device.
        source: source of its data.
        share: entered share with the channels of the sensor.
        options: time limits.
    """

    def __init__(
        self,
        sensor: Sensor,
        source: DataSource,
        share: SensorShare,
        *,
        options: Options | None = None,
    ) -> None:
        self._runner = Runner(sensor, source, share, options or Options())
        self._share = share
        self._stop = threading.Event()
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name=f"sensor {share.name}", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._stop.set()
        self._thread.join()
        if self._error is not None and error is None:
            raise self._error

    @property
    def error(self) -> BaseException | None:
        """Exception that has ended the thread; None while it runs. The `with` block raises it."""
        return self._error

    def _run(self) -> None:
        try:
            self._runner.run(self._stop)
        except BaseException as error:  # the `with` block raises it
            self._error = error
            self._share.invalidate(f"the sensor's thread has failed: {error}")
