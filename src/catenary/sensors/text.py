"""Sensors that send lines of text: CSV, and sentences in the style of NMEA 0183.

    columns = [Column(Channel("angular_velocity", "rad/s", (3,)), (1, 2, 3), scale=pi / 180)]
    gyro = Text(columns, rate=100.0, count=4)                      # 12,0.1,0.2,0.3
    imu = Text(columns, rate=100.0, count=4, prefix="$PIMU")       # $PIMU,0.1,0.2,0.3*5C

A sentence begins with `$` or `!`. After a `*` follow two hexadecimal digits: the exclusive or of
all characters between (NMEA 0183, section 5.2; the same in VectorNav's ASCII protocol).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from operator import xor

from catenary.errors import DecodeError
from catenary.sensors.sensor import Channel, Clock, Counters, Sample, Value

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
PRINTABLE = re.compile(rb"[\x20-\x7e\t]*")
NUMBER_MAX = 1e200  # larger ones could overflow with a scale
LINE_MAX = 1024  # [bytes] a longer line is garbage


@dataclass(frozen=True, slots=True)
class Column:
    """Columns of a line that become one channel.

    Args:
        channel: quantity in the share.
        places: number of each column, from 0. The prefix of a sentence is column 0.
        scale: unit of the channel per unit of the device.
    """

    channel: Channel
    places: tuple[int, ...]
    scale: float = 1.0

    def __post_init__(self) -> None:
        size = self.channel.shape[0] if self.channel.shape else 1
        if len(self.places) != size or min(self.places) < 0:
            raise ValueError(f"channel {self.channel.name!r} needs {size} places from 0 up")


class Text:
    """Decoder of lines with a fixed number of columns.

    The first line after the start is discarded unless it has a checksum: it may be incomplete.

    Args:
        columns: columns that become channels.
        rate: lines per second [Hz].
        count: number of columns of a line. Other lines are counted as bad messages.
        prefix: text of column 0, such as "$PIMU"; lines with another text are ignored. Empty: all
            lines are samples.
        separator: text between two columns.
        checksum: True if lines without a checksum are refused. A checksum is always checked.
        time: column with the time of the sample; None: the device sends no time.

    Raises:
        ValueError: A place is not in the line, or an argument is out of range.
    """

    def __init__(
        self,
        columns: Sequence[Column],
        *,
        rate: float,
        count: int,
        prefix: str = "",
        separator: str = ",",
        checksum: bool = False,
        time: TimeColumn | None = None,
    ) -> None:
        self._columns = tuple(columns)
        self._count, self._prefix, self._separator = count, prefix, separator
        self._needs_checksum, self._time = checksum, time
        self.rate = rate
        self.channels: Sequence[Channel] = [each.channel for each in columns]
        self.clock: Clock = "device"
        self.counters = Counters()
        self._rest, self._complete = b"", False
        self._check()

    def _check(self) -> None:
        places = [place for each in self._columns for place in each.places]
        places += [self._time.place] if self._time else []
        if not places or max(places) >= self._count:
            raise ValueError(f"places {sorted(places)}: a line has {self._count} columns, from 0")
        if not self._separator or not self.rate > 0:
            raise ValueError("the separator must not be empty, and the rate must be positive")

    def start(self) -> list[bytes]:
        """Discard incomplete data. No message is sent."""
        self._rest, self._complete = b"", False
        return []

    def stop(self) -> list[bytes]:
        """Send no message."""
        return []

    def feed(self, data: bytes, received_ns: int) -> list[Sample]:
        """Decode bytes, and return the complete samples, oldest first.

        Args:
            data: bytes of the stream.
            received_ns: time of reception on CLOCK_MONOTONIC.
        """
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > LINE_MAX:
            self.counters.garbage += len(self._rest)
            self._rest, self._complete = b"", False
        samples = (self._line(line.rstrip(b"\r")) for line in lines)
        return [each for each in samples if each is not None]

    def _line(self, line: bytes) -> Sample | None:
        """Return the sample of a line; None if there is none."""
        is_first, self._complete = not self._complete, True
        if not PRINTABLE.fullmatch(line) or len(line) > LINE_MAX:
            self.counters.garbage += len(line) + 1
            return None
        text = line.decode("ascii").strip()
        body, star, digits = text.rpartition("*")
        if is_first and not star:
            self.counters.garbage += len(line) + 1
            return None
        if star and digits.upper() != checksum_of(body):
            self.counters.bad_checksums += 1
            return None
        return self._columns_of(body if star else text, bool(star))

    def _columns_of(self, text: str, is_checked: bool) -> Sample | None:
        parts = text.split(self._separator)
        if not text or (self._prefix and parts[0].strip() != self._prefix):
            return None
        try:
            if self._needs_checksum and not is_checked:
                raise DecodeError("the line has no checksum")
            sample = self._sample(parts)
        except DecodeError:
            self.counters.bad_messages += 1
            return None
        self.counters.samples += 1
        return sample

    def _sample(self, parts: list[str]) -> Sample:
        if len(parts) != self._count:
            raise DecodeError(f"the line has {len(parts)} columns instead of {self._count}")
        values: dict[str, Value] = {}
        for each in self._columns:
            numbers = tuple(number_of(parts[place]) * each.scale for place in each.places)
            values[each.channel.name] = numbers if each.channel.shape else numbers[0]
        return Sample(self._time.time_ns(parts) if self._time else None, values)


@dataclass(frozen=True, slots=True)
class TimeColumn:
    """Column with the time of a sample.

    Args:
        place: number of the column, from 0.
        unit_ns: unit of the column [ns], such as 1000 for microseconds.
    """

    place: int
    unit_ns: float

    def time_ns(self, parts: Sequence[str]) -> int:
        """Return the time [ns]. Raises DecodeError if the column is not a number."""
        return round(number_of(parts[self.place]) * self.unit_ns)


def number_of(text: str) -> float:
    """Return the number in a column. Raises DecodeError for any other text, and for nan and inf."""
    stripped = text.strip()
    if not NUMBER.fullmatch(stripped) or not abs(float(stripped)) <= NUMBER_MAX:
        raise DecodeError(f"{stripped!r} is not a number")
    return float(stripped)


def checksum_of(body: str) -> str:
    """Return the checksum of a sentence, without its first `$` or `!`, as two digits."""
    covered = body[1:] if body[:1] in ("$", "!") else body
    return f"{reduce(xor, covered.encode('ascii'), 0):02X}"
