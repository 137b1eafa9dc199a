"""Interfaces of a sensor: channels, samples, decoders, sources of bytes, and their counters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt

Value = float | Sequence[float] | npt.NDArray[np.float64]
Clock = Literal["device", "monotonic"]


@dataclass(frozen=True, slots=True)
class Channel:
    """Named quantity of a sensor, a scalar or a vector.

    Args:
        name: name of the field in the share, such as "force".
        unit: SI unit, such as "N"; empty for a count, a code or a ratio.
        shape: () for a scalar, (n,) for a vector.
        dtype: NumPy type of one number in the share.
    """

    name: str
    unit: str = ""
    shape: tuple[()] | tuple[int] = ()
    dtype: str = "<f8"


@dataclass(frozen=True, slots=True)
class Sample:
    """Values of all channels at one time.

    Args:
        time_ns: time of the measurement on the clock of the sensor; None: the device sends no
            time, and the time of reception counts.
        values: value of each channel by name, in the unit of the channel.
        valid: False if the device reports that the values must not be used.
        reason: why `valid` is False, without numbers that change in every sample.
    """

    time_ns: int | None
    values: Mapping[str, Value]
    valid: bool = True
    reason: str = ""


@dataclass(slots=True)
class Counters:
    """Counts of the events in the data of a sensor. A decoder and its runner increment them."""

    samples: int = 0  # complete samples, valid or not
    garbage: int = 0  # bytes outside of any message
    bad_checksums: int = 0  # messages with a wrong check sum
    bad_messages: int = 0  # complete messages that cannot be decoded
    lost: int = 0  # samples that are missing in the numbers of the device
    reordered: int = 0  # samples that arrived after a later one, or twice
    time_jumps: int = 0  # times that went back or jumped
    restarts: int = 0  # restarts of the device
    silences: int = 0  # times without a sample that were too long
    reconnects: int = 0  # attempts to open the source again

    def as_dict(self) -> dict[str, int]:
        """Return the counts by name."""
        return asdict(self)


class Sensor(Protocol):
    """Decoder of the data of one device. It has no I/O and no clock.

    Bytes may arrive in pieces of any length, and may contain garbage.
    """

    @property
    def channels(self) -> Sequence[Channel]:
        """Quantities of each sample."""

    @property
    def rate(self) -> float:
        """Nominal number of samples per second [Hz]."""

    @property
    def clock(self) -> Clock:
        """Clock of `Sample.time_ns`: "device" has any zero and drifts; or CLOCK_MONOTONIC."""

    @property
    def counters(self) -> Counters:
        """Counts since the decoder was made."""

    def start(self) -> Sequence[bytes]:
        """Discard incomplete data. Return the messages that start the device, one per write."""

    def feed(self, data: bytes, received_ns: int) -> list[Sample]:
        """Decode data, and return the complete samples, oldest first.

        Args:
            data: bytes of a stream, or exactly one datagram.
            received_ns: time of reception on CLOCK_MONOTONIC.
        """

    def stop(self) -> Sequence[bytes]:
        """Return the messages that stop the device, one per write."""


class Connection(Protocol):
    """Open connection to a device."""

    def read(self, timeout: float) -> tuple[bytes, int]:
        """Wait for data for at most `timeout` [s].

        Return the data and its time of reception on CLOCK_MONOTONIC [ns]; no data after `timeout`.
        A stream returns at least one byte, a datagram source exactly one datagram.

        Raises OSError if the connection is lost.
        """

    def write(self, data: bytes) -> None:
        """Send one message to the device. Raises OSError if the connection is lost."""

    def close(self) -> None:
        """Close the connection. A second call does nothing."""


class DataSource(Protocol):
    """Place from which the data of a device comes: a serial port, a UDP address, a CAN bus."""

    @property
    def name(self) -> str:
        """Name for messages, such as "/dev/ttyACM0"."""

    def open(self) -> Connection:
        """Open a new connection. Raises OSError if that is not possible at present."""
