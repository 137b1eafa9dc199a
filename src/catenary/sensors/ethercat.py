"""Sensors on the EtherCAT segment: values from the share of a loop.

The fields are those of `Drives`, `Inputs` and `ProcessData`, by the names that `cat.attach` shows.
"""

from __future__ import annotations

import errno
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from catenary.errors import ShareError
from catenary.sensors.processing import size
from catenary.sensors.sensor import Channel, Clock, Counters, Sample, Value
from catenary.share import Reader, ShareLayout, attach

NO_ANSWER = "the device did not answer in this cycle"


@dataclass(frozen=True, slots=True)
class Field:
    """Number in the share of a loop: value = scale · number.

    Args:
        name: name of the field.
        index: element of an array; for bytes of `ProcessData`, the first byte.
        dtype: NumPy type of a number in bytes, such as "<i2"; empty: the field contains numbers.
        scale: factor.
    """

    name: str
    index: int | None = None
    dtype: str = ""
    scale: float = 1.0


class LoopSource:
    """Source with the cycles of a loop that has a share.

    Args:
        name: name of the share.
        uid: owner of the share, as for `cat.attach`.

    Raises:
        ShareError: the share cannot be opened.
    """

    def __init__(self, name: str, *, uid: int | None = None) -> None:
        self._share, self._uid = name, uid
        with attach(name, uid=uid) as reader:
            self.layout: ShareLayout = reader.layout

    @property
    def name(self) -> str:
        """Name for messages."""
        return f"the share {self._share!r}"

    def open(self) -> LoopConnection:
        """Attach to the loop. Raises OSError if it does not run, or has other fields."""
        try:
            reader = attach(self._share, uid=self._uid)
        except ShareError as error:
            raise OSError(errno.ENOENT, error.message) from error
        if reader.layout.fields != self.layout.fields:
            reader.close()
            raise OSError(errno.ESTALE, "the loop now has other fields: start the sensor again")
        return LoopConnection(reader)


class LoopConnection:
    """Owner of the attachment to one run of a loop."""

    def __init__(self, reader: Reader) -> None:
        self._reader = reader
        self._number = reader.number

    def read(self, timeout: float) -> tuple[bytes, int]:
        """Return the rows of the new cycles, and the time [ns]; no data after `timeout` [s].

        Raises OSError if the loop has ended.
        """
        is_new = self._reader.wait(timeout)
        rows, _ = self._reader.rows(self._number)
        if len(rows):
            self._number = int(rows["number"][-1])
        elif not is_new and not self._reader.alive:
            raise OSError(errno.EPIPE, "the loop has ended")
        return rows.tobytes(), time.monotonic_ns()

    def write(self, data: bytes) -> None:
        """Raise OSError: a share of a loop receives no messages."""
        raise OSError(errno.EOPNOTSUPP, "the share of a loop receives no messages")

    def close(self) -> None:
        """Detach from the share."""
        self._reader.close()


class EtherCat:
    """Sensor that reads fields of the share of a loop as its channels.

        loop = LoopSource("arm")
        ft = EtherCat(loop, {Channel("force", "N", (3,)): ["Fx", "Fy", "Fz"]})

    A sample is invalid if a device of the loop did not answer in its cycle. Its time is that of
    the cycle start; in virtual time, the time of reception counts.

    Args:
        loop: source with the share of the loop.
        channels: fields of each channel, one for each number.
        errors: fields that are not 0 while the values must not be used, such as "Overrange".
        every: n to use every n-th cycle.
        unit: number of the sync unit of the device in `unit_valid`; None: all must be valid.

    Raises:
        ValueError: a field is missing or does not fit, or a number is out of range.
    """

    def __init__(
        self,
        loop: LoopSource,
        channels: Mapping[Channel, Sequence[str | Field]],
        *,
        errors: Sequence[str | Field] = (),
        every: int = 1,
        unit: int | None = None,
    ) -> None:
        if every < 1:
            raise ValueError(f"every={every}: must be at least 1")
        self._dtype = loop.layout.dtype
        self._fields = {channel: as_fields(fields) for channel, fields in channels.items()}
        self._errors = as_fields(errors)
        check_exist(self._errors, self._dtype)
        for channel, fields in self._fields.items():
            check_fields(channel, fields, self._dtype)
        self.channels: Sequence[Channel] = tuple(channels)
        self.rate = 1.0 / (loop.layout.period * every)
        self.clock: Clock = "monotonic"
        self._is_virtual = loop.layout.clock == "virtual"
        self.counters = Counters()
        self._every, self._unit = every, unit
        self._number = 0  # of the last cycle

    def start(self) -> Sequence[bytes]:
        """Begin with the next cycle."""
        self._number = 0
        return ()

    def stop(self) -> Sequence[bytes]:
        """Return no messages."""
        return ()

    def feed(self, data: bytes, received_ns: int) -> list[Sample]:
        """Return the samples of complete rows.

        Args:
            data: rows of the share.
            received_ns: time of reception on CLOCK_MONOTONIC.
        """
        samples = []
        for row in np.frombuffer(data, self._dtype):
            number = int(row["number"])
            if self._number:
                self.counters.lost += number - self._number - 1
            self._number = number
            if number % self._every == 0:
                samples.append(self._sample(row))
        self.counters.samples += len(samples)
        return samples

    def _sample(self, row: np.void) -> Sample:
        values: dict[str, Value] = {}
        for channel, fields in self._fields.items():
            numbers = [number_of(row, field) for field in fields]
            values[channel.name] = numbers if channel.shape else numbers[0]
        reason = self._objection(row)
        time_ns = None if self._is_virtual else int(row["scheduled_ns"])
        return Sample(time_ns, values, not reason, reason)

    def _objection(self, row: np.void) -> str:
        """Return why the values of a row must not be used; empty if they may be used."""
        units = row["unit_valid"]
        if not (units.all() if self._unit is None else units[self._unit]):
            return NO_ANSWER
        bad = next((field for field in self._errors if number_of(row, field)), None)
        return "" if bad is None else f"{bad.name!r} is set"


def as_fields(fields: Sequence[str | Field]) -> list[Field]:
    """Return fields; a name stands for the field with this name."""
    return [Field(each) if isinstance(each, str) else each for each in fields]


def number_of(row: np.void, field: Field) -> float:
    """Return the number of a field.

    Args:
        row: row of the share.
        field: place of the number.
    """
    value: npt.NDArray[np.generic] = np.asarray(row[field.name])
    if field.dtype:
        number = np.frombuffer(value.tobytes(), field.dtype, 1, field.index or 0)[0]
    else:
        number = value if field.index is None else value[field.index]
    return float(number) * field.scale


def check_fields(channel: Channel, fields: Sequence[Field], dtype: np.dtype[np.void]) -> None:
    """Raise ValueError unless the fields exist and have one number for each of the channel.

    Args:
        channel: channel of the sensor.
        fields: fields of its numbers.
        dtype: type of the rows of the share.
    """
    if len(fields) != size(channel):
        raise ValueError(f"{channel.name!r} needs {size(channel)} fields, not {len(fields)}")
    check_exist(fields, dtype)


def check_exist(fields: Sequence[Field], dtype: np.dtype[np.void]) -> None:
    """Raise ValueError unless each field is one number of the rows.

    Args:
        fields: the fields.
        dtype: type of the rows of the share.
    """
    empty = np.zeros(1, dtype)[0]
    for field in fields:
        if field.name not in (dtype.names or ()):
            raise ValueError(f"unknown field {field.name!r}; the loop has {dtype.names}")
        try:
            number_of(empty, field)
        except (TypeError, ValueError, IndexError) as error:
            raise ValueError(f"{field} is not one number: {error}") from error
