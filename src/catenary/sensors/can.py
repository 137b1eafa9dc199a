"""Sensors on a CAN bus, through python-can.

    force = CanMessage(0x1A0, "<hhh", [CanSignal(Channel("force", "N", (3,)), 0.01)])
    torque = CanMessage(0x1A1, "<hhh", [CanSignal(Channel("torque", "N·m", (3,)), 0.001)])
    sensor, source = Can([force, torque], rate=500.0), CanBus("can0", ids=[0x1A0, 0x1A1])

A message is described by a format of `struct`, or by a DBC file (`dbc_message`, which needs
cantools). Multiplexed messages and CANopen's SDO are not supported.
"""

from __future__ import annotations

import errno
import struct
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from catenary.errors import DecodeError
from catenary.sensors.can_frame import BUS_OFF, CanFrame, decode_frame, encode_frame
from catenary.sensors.extra import require
from catenary.sensors.missing_values import missing_values
from catenary.sensors.sensor import Channel, Clock, Counters, Sample, Value

NS = 1_000_000_000
CLASSIC_DATA_MAX = 8  # [bytes]; longer data needs CAN FD
DELAY_MAX = 1.0  # [s]; an older time stamp of the kernel is on another clock


class Message(Protocol):
    """Layout of the data of one identifier."""

    @property
    def identifier(self) -> int:
        """Identifier of the frames."""

    @property
    def extended(self) -> bool:
        """True for a 29-bit identifier."""

    @property
    def channels(self) -> Sequence[Channel]:
        """Quantities in the message."""

    def decode(self, data: bytes) -> dict[str, Value]:
        """Return the values of the channels. Raises DecodeError if the length differs."""


@dataclass(frozen=True, slots=True)
class CanSignal:
    """Consecutive numbers of a message that become one channel.

    Args:
        channel: quantity in the share.
        scale: unit of the channel per unit of the message.
        offset: value of the channel for the number 0, in its unit.
    """

    channel: Channel
    scale: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, slots=True)
class CanMessage:
    """Message with data in a format of `struct`.

    Args:
        identifier: identifier of the frames.
        layout: format of the data with its byte order, such as "<hhh"; `x` skips a byte.
        signals: channels, in the order of the numbers in the format.
        extended: True for a 29-bit identifier.

    Raises:
        ValueError: The signals have more or fewer numbers than the format.
    """

    identifier: int
    layout: str
    signals: Sequence[CanSignal]
    extended: bool = False

    def __post_init__(self) -> None:
        size = struct.calcsize(self.layout)
        numbers = struct.unpack(self.layout, bytes(size))
        needed = sum(each.shape[0] if each.shape else 1 for each in self.channels)
        if len(numbers) != needed or any(isinstance(each, bytes) for each in numbers):
            raise ValueError(
                f"layout {self.layout!r} has {len(numbers)} numbers; the signals have {needed}"
            )
        encode_frame(CanFrame(self.identifier, bytes(size), self.extended))

    @property
    def channels(self) -> Sequence[Channel]:
        """Quantities in the message."""
        return [each.channel for each in self.signals]

    def decode(self, data: bytes) -> dict[str, Value]:
        """Return the values of the channels. Raises DecodeError if the length differs."""
        if len(data) != struct.calcsize(self.layout):
            raise DecodeError(f"CAN message 0x{self.identifier:X} has {len(data)} bytes of data")
        numbers = list(struct.unpack(self.layout, data))
        values: dict[str, Value] = {}
        for signal in self.signals:
            shape = signal.channel.shape
            own, numbers = numbers[: (shape or (1,))[0]], numbers[(shape or (1,))[0] :]
            scaled = tuple(number * signal.scale + signal.offset for number in own)
            values[signal.channel.name] = scaled if shape else scaled[0]
        return values


class Can:
    """Decoder of frames, each of which arrives as one datagram (`can_frame`).

    One sample has one message of each identifier, in any order. If an identifier arrives twice, or
    the others do not arrive within one period, the incomplete sample is lost.

    Args:
        messages: messages of a sample.
        rate: samples per second [Hz].
        start: frames that start the device, such as CANopen's NMT command.
        stop: frames that stop the device.

    Raises:
        ValueError: An identifier or a channel occurs twice, or the rate is not positive.
    """

    clock: Clock = "device"  # frames have no time of the device: that of reception counts

    def __init__(
        self,
        messages: Sequence[Message],
        *,
        rate: float,
        start: Sequence[CanFrame] = (),
        stop: Sequence[CanFrame] = (),
    ) -> None:
        self._messages = {(each.identifier, each.extended): each for each in messages}
        self.channels: Sequence[Channel] = [
            channel for each in messages for channel in each.channels
        ]
        names = {channel.name for channel in self.channels}
        if not messages or len(self._messages) < len(messages) or len(names) < len(self.channels):
            raise ValueError("name each identifier and each channel once")
        if not rate > 0:
            raise ValueError(f"rate={rate} Hz: must be positive")
        self.rate, self.counters = rate, Counters()
        self._start = [encode_frame(each) for each in start]
        self._stop = [encode_frame(each) for each in stop]
        self._parts: dict[tuple[int, bool], dict[str, Value]] = {}
        self._since_ns = 0  # reception of the first part

    def start(self) -> Sequence[bytes]:
        """Discard incomplete data. Return the frames that start the device."""
        self._parts = {}
        return self._start

    def stop(self) -> Sequence[bytes]:
        """Return the frames that stop the device."""
        return self._stop

    def feed(self, data: bytes, received_ns: int) -> list[Sample]:
        """Decode one frame, and return the sample that it completes.

        Args:
            data: one frame.
            received_ns: time of reception on CLOCK_MONOTONIC.
        """
        try:
            frame = decode_frame(data)
            if frame.error:
                return self._failure(frame)
            key = (frame.identifier, frame.extended)
            if frame.remote or key not in self._messages:
                return []
            part = self._messages[key].decode(frame.data)
        except DecodeError:
            self.counters.bad_messages += 1
            return []
        self._add(key, part, received_ns)
        return self._complete()

    def _add(self, key: tuple[int, bool], part: dict[str, Value], received_ns: int) -> None:
        is_late = (received_ns - self._since_ns) * self.rate > NS
        if self._parts and (key in self._parts or is_late):
            self.counters.lost += 1
            self._parts = {}
        if not self._parts:
            self._since_ns = received_ns
        self._parts[key] = part

    def _complete(self) -> list[Sample]:
        if len(self._parts) < len(self._messages):
            return []
        values = {name: value for part in self._parts.values() for name, value in part.items()}
        self._parts = {}
        self.counters.samples += 1
        return [Sample(None, values)]

    def _failure(self, frame: CanFrame) -> list[Sample]:
        """Count an error of the controller. Report only the end of its communication."""
        self.counters.bad_messages += 1
        if not frame.identifier & BUS_OFF:
            return []
        self._parts = {}
        return [Sample(None, missing_values(self.channels), False, "the CAN controller is bus-off")]


class CanBus:
    """CAN interface as a source of a sensor.

    Args:
        channel: name of the interface, such as "can0".
        interface: interface of python-can: "socketcan", "virtual", "slcan", ...
        ids: identifiers that are received, both as 11-bit and as 29-bit; None: all.
        fd: True for CAN FD.
        bitrate: bits per second [1/s]; None: as set. SocketCAN takes it from `ip link`.
    """

    def __init__(
        self,
        channel: str,
        interface: str = "socketcan",
        *,
        ids: Sequence[int] | None = None,
        fd: bool = False,
        bitrate: int | None = None,
    ) -> None:
        self._channel, self._interface = channel, interface
        self._options: dict[str, Any] = {"fd": fd} if fd else {}
        if bitrate is not None:
            self._options["bitrate"] = bitrate
        if ids is not None:
            self._options["can_filters"] = [
                {"can_id": each, "can_mask": 0x1FFF_FFFF} for each in ids
            ]

    @property
    def name(self) -> str:
        """Interface and channel."""
        return f"{self._interface}:{self._channel}"

    def open(self) -> CanConnection:
        """Open the interface.

        Raises:
            ConfigurationError: python-can is not installed.
            OSError: The interface does not exist, is down, or its driver is missing.
        """
        library = require("can", "python-can")
        try:
            bus = library.Bus(interface=self._interface, channel=self._channel, **self._options)
        except library.CanError as error:
            raise OSError(errno.ENODEV, str(error)) from error
        return CanConnection(bus, library)


class CanConnection:
    """Owner of an open CAN interface."""

    def __init__(self, bus: Any, library: Any) -> None:
        self._bus, self._library = bus, library

    def read(self, timeout: float) -> tuple[bytes, int]:
        """Return the next frame and its time of reception [ns]; no bytes after `timeout` [s].

        Raises OSError if the interface is down or was removed.
        """
        try:
            message = self._bus.recv(timeout)
        except self._library.CanError as error:
            raise OSError(errno.EIO, str(error)) from error
        now_ns = time.monotonic_ns()
        if message is None:
            return b"", now_ns
        delay = time.time() - message.timestamp  # the kernel's time of reception, on UTC
        delay_ns = round(delay * NS) if 0 <= delay < DELAY_MAX else 0
        return encode_frame(frame_of(message)), now_ns - delay_ns

    def write(self, data: bytes) -> None:
        """Send one frame. Raises OSError if the interface does not take it."""
        frame = decode_frame(data)
        try:
            self._bus.send(
                self._library.Message(
                    arbitration_id=frame.identifier,
                    data=frame.data,
                    is_extended_id=frame.extended,
                    is_remote_frame=frame.remote,
                    is_fd=len(frame.data) > CLASSIC_DATA_MAX,
                )
            )
        except self._library.CanError as error:
            raise OSError(errno.EIO, str(error)) from error

    def close(self) -> None:
        """Close the interface."""
        self._bus.shutdown()


def frame_of(message: Any) -> CanFrame:
    """Return the frame in a message of python-can."""
    return CanFrame(
        message.arbitration_id,
        bytes(message.data),
        message.is_extended_id and not message.is_error_frame,
        message.is_remote_frame,
        message.is_error_frame,
    )
