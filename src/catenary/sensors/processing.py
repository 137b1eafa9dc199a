"""Processing of the samples of a sensor before they are published: calibration, filter, frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from catenary.sensors.calibration import Calibration
from catenary.sensors.frame import Frame
from catenary.sensors.low_pass import LowPass
from catenary.sensors.sensor import Channel, Clock, Counters, Sample, Sensor, Value

Values = Mapping[str, Value]
WRENCH = (Channel("force", "N", (3,)), Channel("torque", "N·m", (3,)))


class Step(Protocol):
    """Step of a processing chain."""

    def channels(self, channels: Sequence[Channel]) -> Sequence[Channel]:
        """Return the channels after the step. Raises ValueError for unsuitable channels."""

    def apply(self, values: Values) -> tuple[Values, str]:
        """Return the values after the step, and why they are invalid; empty if they are valid."""

    def reset(self) -> None:
        """Forget earlier samples. It is called after each invalid sample."""


class Processed:
    """Sensor with steps that process each sample, in their order.

        ft = Processed(Rdt(500.0), [Filter(["force", "torque"], 50.0, 500.0), Transform(frame)])

    An invalid sample resets the steps, so that a filter does not mix values across a gap.

    Args:
        sensor: the sensor.
        steps: the steps.

    Raises:
        ValueError: a step does not suit the channels.
    """

    def __init__(self, sensor: Sensor, steps: Sequence[Step]) -> None:
        self._sensor, self._steps = sensor, tuple(steps)
        channels = sensor.channels
        for step in self._steps:
            channels = step.channels(channels)
        self._channels = channels

    @property
    def channels(self) -> Sequence[Channel]:
        """Channels after the last step."""
        return self._channels

    @property
    def rate(self) -> float:
        """Nominal number of samples per second [Hz]."""
        return self._sensor.rate

    @property
    def clock(self) -> Clock:
        """Clock of the sensor."""
        return self._sensor.clock

    @property
    def counters(self) -> Counters:
        """Counts of the sensor."""
        return self._sensor.counters

    def start(self) -> Sequence[bytes]:
        """Reset the steps, and return the messages that start the device."""
        self._reset()
        return self._sensor.start()

    def feed(self, data: bytes, received_ns: int) -> list[Sample]:
        """Decode data and process the samples.

        Args:
            data: bytes of a stream, or one datagram.
            received_ns: time of reception on CLOCK_MONOTONIC.
        """
        return [self._processed(sample) for sample in self._sensor.feed(data, received_ns)]

    def stop(self) -> Sequence[bytes]:
        """Return the messages that stop the device."""
        return self._sensor.stop()

    def _processed(self, sample: Sample) -> Sample:
        values, reason = sample.values, sample.reason
        for step in self._steps:
            values, objection = step.apply(values)
            reason = reason or objection
        valid = sample.valid and not reason
        if not valid:
            self._reset()
        return replace(sample, values=values, valid=valid, reason=reason)

    def _reset(self) -> None:
        for step in self._steps:
            step.reset()


class Calibrate:
    """Step that replaces a channel of raw values by calibrated channels.

    Args:
        raw: name of the channel.
        calibration: calibration with one value for each number of the new channels.
        outputs: new channels; the default is a wrench of six values.
        limit: largest valid amount of a raw value; a larger one is saturated. None: no limit.
    """

    def __init__(
        self,
        raw: str,
        calibration: Calibration,
        *,
        outputs: Sequence[Channel] = WRENCH,
        limit: float | None = None,
    ) -> None:
        self._raw, self._calibration, self._limit = raw, calibration, limit
        self._outputs = tuple(outputs)

    def channels(self, channels: Sequence[Channel]) -> Sequence[Channel]:
        """Replace the raw channel. Raises ValueError if a size does not match the matrix."""
        raw = channel_of(channels, self._raw)
        inside = size(raw)
        outside = sum(size(channel) for channel in self._outputs)
        if self._calibration.matrix.shape != (outside, inside):
            raise ValueError(
                f"the matrix has shape {self._calibration.matrix.shape}; the channels need "
                f"{(outside, inside)}"
            )
        return (*(each for each in channels if each is not raw), *self._outputs)

    def apply(self, values: Values) -> tuple[Values, str]:
        """Calibrate one sample."""
        raw = np.atleast_1d(np.asarray(values[self._raw], np.float64))
        result, at = self._calibration.apply(raw), 0
        calibrated = {name: value for name, value in values.items() if name != self._raw}
        for channel in self._outputs:
            part = result[at : at + size(channel)]
            calibrated[channel.name] = part if channel.shape else float(part[0])
            at += size(channel)
        is_saturated = self._limit is not None and bool((np.abs(raw) > self._limit).any())
        return calibrated, f"{self._raw!r} is saturated" if is_saturated else ""

    def reset(self) -> None:
        """Do nothing: the step has no state."""


class Bias:
    """Step that subtracts constants, such as the values of a sensor without load.

    Args:
        values: value of each channel that is subtracted, by name.
    """

    def __init__(self, values: Values) -> None:
        self._values = {name: np.array(value, np.float64) for name, value in values.items()}

    def channels(self, channels: Sequence[Channel]) -> Sequence[Channel]:
        """Return the channels. Raises ValueError if one is missing or has another shape."""
        for name, value in self._values.items():
            shape = channel_of(channels, name).shape
            if value.shape != shape or not np.isfinite(value).all():
                raise ValueError(f"the bias of {name!r} must be finite, with the shape {shape}")
        return channels

    def apply(self, values: Values) -> tuple[Values, str]:
        """Subtract the constants."""
        less = {name: np.asarray(values[name]) - bias for name, bias in self._values.items()}
        return {**values, **less}, ""

    def reset(self) -> None:
        """Do nothing: the step has no state."""


class Filter:
    """Step that filters channels by a low-pass filter.

    Args:
        names: names of the channels.
        cutoff: frequency at which the gain is -3 dB [Hz].
        rate: samples per second of the sensor [Hz].
        order: 1 or 2.

    Raises:
        ValueError: a number is out of range.
    """

    def __init__(self, names: Sequence[str], cutoff: float, rate: float, *, order: int = 2) -> None:
        self._filters = {name: LowPass(cutoff, rate, order=order) for name in names}

    def channels(self, channels: Sequence[Channel]) -> Sequence[Channel]:
        """Return the channels. Raises ValueError if one is missing."""
        for name in self._filters:
            channel_of(channels, name)
        return channels

    def apply(self, values: Values) -> tuple[Values, str]:
        """Filter one sample."""
        filtered = {name: each.step(values[name]) for name, each in self._filters.items()}
        return {**values, **filtered}, ""

    def reset(self) -> None:
        """Begin again with the next sample."""
        for each in self._filters.values():
            each.reset()


class Transform:
    """Step that transforms a wrench, or vectors, into another frame.

    Args:
        frame: pose of the sensor in the other frame.
        vectors: channels that are free vectors, such as "acceleration".
        wrench: channels of force and torque; None: the sensor has no wrench.
    """

    def __init__(
        self,
        frame: Frame,
        *,
        vectors: Sequence[str] = (),
        wrench: tuple[str, str] | None = ("force", "torque"),
    ) -> None:
        self._frame, self._vectors, self._wrench = frame, tuple(vectors), wrench

    def channels(self, channels: Sequence[Channel]) -> Sequence[Channel]:
        """Return the channels. Raises ValueError if one is missing or has not three numbers."""
        for name in (*self._vectors, *(self._wrench or ())):
            if channel_of(channels, name).shape != (3,):
                raise ValueError(f"{name!r} must have the shape (3,)")
        return channels

    def apply(self, values: Values) -> tuple[Values, str]:
        """Transform one sample."""
        moved: dict[str, Value] = dict(values)
        for name in self._vectors:
            moved[name] = self._frame.vector(values[name])
        if self._wrench is not None:
            force, torque = self._wrench
            moved[force], moved[torque] = self._frame.wrench(values[force], values[torque])
        return moved, ""

    def reset(self) -> None:
        """Do nothing: the step has no state."""


def channel_of(channels: Sequence[Channel], name: str) -> Channel:
    """Return the channel with this name. Raises ValueError if there is none."""
    for channel in channels:
        if channel.name == name:
            return channel
    raise ValueError(f"unknown channel {name!r}; the channels are {[c.name for c in channels]}")


def size(channel: Channel) -> int:
    """Return the number of values of a channel."""
    return channel.shape[0] if channel.shape else 1
