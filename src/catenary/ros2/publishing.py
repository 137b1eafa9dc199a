"""Topics that the bridge publishes, each at its own rate."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import msgspec
import numpy as np

from catenary.errors import ConfigurationError
from catenary.ros2 import diagnostics, messages, readings
from catenary.ros2.backend import CLOCK, STATE, Backend, Publisher
from catenary.ros2.config import Config
from catenary.ros2.diagnostics import LoopTiming, Reports
from catenary.ros2.requests import Requests
from catenary.ros2.source import Source, stamp_ns
from catenary.share import Reader

Make = Callable[[Reader, np.void], msgspec.Struct]
WITHOUT_DATA = "topics without data"


class Topic:
    """Publisher of one topic: one message per period at most, and none without a new cycle.

    Args:
        name: name of the topic, for reports.
        publisher: publisher of the backend.
        source: attachment to the share with the data.
        rate: largest rate [Hz].
        make: makes a message from a cycle.
        reports: receives the reason when the topic stops.
    """

    def __init__(
        self,
        name: str,
        publisher: Publisher,
        source: Source,
        rate: float,
        make: Make,
        reports: Reports,
    ) -> None:
        self.source = source
        self.reason = ""  # why the newest cycle is not published; "" if it is
        self.next_time = 0.0
        self._name, self._publisher, self._make = name, publisher, make
        self._reports = reports
        self._period = 1.0 / rate
        self._last: np.void | None = None

    def step(self, now: float, row: np.void | None) -> None:
        """Publish a cycle if it is new and the topic is due.

        Args:
            now: monotonic time [s].
            row: newest cycle of the share; None without one.
        """
        if now < self.next_time:
            return
        self.next_time = max(self.next_time + self._period, now)
        reader = self.source.reader
        if reader is None or row is None or row is self._last:
            return
        self._last = row
        try:
            self._publisher.publish(self._make(reader, row))
            self.reason = ""
        except (readings.InvalidReading, ValueError) as error:
            if not self.reason:
                self._reports.add(WITHOUT_DATA, f"{self._name}: {error}")
            self.reason = str(error)


class Publishing:
    """Owner of the published topics, and of the attachments to the shares of sensors.

    Args:
        config: configuration of the bridge.
        backend: connection to the ROS 2 graph.
        source: attachment to the share of the loop.
        requests: connection to the program of the loop.
        reports: incidents of the bridge.

    Raises:
        ConfigurationError: Two topics have one name.
    """

    def __init__(
        self,
        config: Config,
        backend: Backend,
        source: Source,
        requests: Requests,
        reports: Reports,
    ) -> None:
        self._config, self._backend, self._source = config, backend, source
        self._requests, self._reports = requests, reports
        self._sensors: dict[str, Source] = {}
        self._rows: dict[str, np.void | None] = {}
        self._names: set[str] = set()
        self._topics: list[Topic] = []
        self._timing: LoopTiming | None = None
        self._run = ""
        self._diagnostics_at = 0.0
        self._diagnostics: Publisher | None = None
        self._add_loop()
        self._add_sensors()

    @property
    def next_time(self) -> float:
        """Monotonic time at which the next topic is due [s]."""
        return min((each.next_time for each in self._topics), default=self._diagnostics_at)

    def step(self, row: np.void | None) -> None:
        """Publish what is due.

        Args:
            row: newest cycle of the loop; None without a loop.
        """
        now = time.monotonic()
        for name, source in self._sensors.items():
            found = source.row()
            self._rows[name] = found if found is not None else self._rows.get(name)
        for topic in self._topics:
            own = topic.source is self._source
            topic.step(now, row if own else self._rows[topic.source.name])
        if self._diagnostics is not None and now >= self._diagnostics_at:
            self._diagnostics_at = now + 1.0 / self._config.diagnostics.rate
            self._diagnostics.publish(self._diagnosis(row))

    def close(self) -> None:
        """Detach from the shares of the sensors."""
        for source in self._sensors.values():
            source.close()

    def _add_loop(self) -> None:
        config = self._config
        if config.joint_states.on:
            make: Make = partial(joint_state, config)
            states = config.joint_states
            self._add(states.topic, messages.JointState, self._source, states.rate, make)
        for each in config.process_data:
            kind, make = readings.TYPES[each.type], partial(process_value, each)
            self._add(each.topic, kind, self._source, each.rate, make)
        reader = self._source.reader
        if config.clock.on and reader is not None and reader.layout.clock == "virtual":
            clock = config.clock
            self._add(clock.topic, messages.Clock, self._source, clock.rate, make_clock)
        if config.diagnostics.on:
            self._check_name(config.diagnostics.topic)
            array = messages.DiagnosticArray
            self._diagnostics = self._backend.publisher(config.diagnostics.topic, array, STATE)

    def _add_sensors(self) -> None:
        for wrench in self._config.wrench:
            make: Make = partial(readings.wrench, wrench)
            source = self._sensor(wrench.share)
            self._add(wrench.topic, messages.WrenchStamped, source, wrench.rate, make)
        for imu in self._config.imu:
            make = partial(readings.imu, imu)
            self._add(imu.topic, messages.Imu, self._sensor(imu.share), imu.rate, make)

    def _sensor(self, name: str) -> Source:
        """Return the attachment to a share; that of the loop for its own name."""
        if name == self._source.name:
            return self._source
        return self._sensors.setdefault(name, Source(name, self._source.uid))

    def _add(
        self, name: str, kind: type[msgspec.Struct], source: Source, rate: float, make: Make
    ) -> None:
        self._check_name(name)
        # A reliable publisher also serves subscribers with `best_effort`.
        qos = CLOCK if kind is messages.Clock else STATE
        publisher = self._backend.publisher(name, kind, qos)
        self._topics.append(Topic(name, publisher, source, rate, make, self._reports))

    def _check_name(self, name: str) -> None:
        if name in self._names:
            raise ConfigurationError(
                f"the topic {name!r} is published twice", hint="choose another topic= for one"
            )
        self._names.add(name)

    def _diagnosis(self, row: np.void | None) -> messages.DiagnosticArray:
        """Return the statuses of all components."""
        name, reader = self._source.name, self._source.reader
        incompatible = self._backend.incompatible
        found = [diagnostics.bridge_status(name, self._reports, incompatible)]
        if reader is None or row is None:
            found.append(diagnostics.missing_status(name, self._source.reason))
            time_ns = time.time_ns()
        else:
            time_ns = stamp_ns(reader, row)
            found += self._loop_statuses(reader, row)
        found += [self._topic_status(each) for each in self._topics if each.reason]
        found += [self._sensor_status(each) for each in self._sensors.values()]
        return messages.DiagnosticArray(readings.make_header(time_ns, ""), found)

    def _loop_statuses(self, reader: Reader, row: np.void) -> list[messages.DiagnosticStatus]:
        if self._timing is None or self._run != self._source.run:
            self._timing, self._run = LoopTiming(reader), self._source.run
        found = [self._timing.status(), *diagnostics.axis_statuses(reader, row)]
        found += diagnostics.device_statuses(self._source.name, self._requests.devices())
        if self._requests.problem:
            found.append(diagnostics.devices_unknown(self._source.name, self._requests.problem))
        return found

    def _topic_status(self, topic: Topic) -> messages.DiagnosticStatus:
        return diagnostics.sensor_status(topic.source.name, topic.reason)

    def _sensor_status(self, source: Source) -> messages.DiagnosticStatus:
        return diagnostics.sensor_status(source.name, source.reason)


def joint_state(config: Config, reader: Reader, row: np.void) -> msgspec.Struct:
    """Return the actual values of all axes; see `readings.joint_state`.

    Args:
        config: configuration of the bridge.
        reader: reader of the share.
        row: a cycle.
    """
    names = readings.joint_names(reader.layout, config.joints)
    return readings.joint_state(config.joint_states, reader, row, names)


def process_value(config: Any, _: Reader, row: np.void) -> msgspec.Struct:
    """Return a field of a cycle; see `readings.process_value`.

    Args:
        config: configuration of the topic.
        row: a cycle.
    """
    message: msgspec.Struct = readings.process_value(config, row)
    return message


def make_clock(reader: Reader, row: np.void) -> msgspec.Struct:
    """Return the virtual time.

    Args:
        reader: reader of the share.
        row: a cycle.

    Raises:
        InvalidReading: The loop has returned without virtual time.
    """
    if reader.layout.clock != "virtual":
        raise readings.InvalidReading("/clock needs a loop in virtual time; start the bridge again")
    return messages.Clock(messages.Time.from_ns(stamp_ns(reader, row)))
