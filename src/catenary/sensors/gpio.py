"""Lines of a GPIO chip: edges with the time stamps of the kernel as samples, and an output.

    edges = GpioEdges({"limit": 17, "index": 27})
    source = GpioLines("/dev/gpiochip0", edges.lines, bias="pull_up")

The kernel stamps each edge in its interrupt handler. gpiod requests the lines; then the kernel's
file delivers `struct gpio_v2_line_event` (include/uapi/linux/gpio.h):

0   u64  time on CLOCK_MONOTONIC [ns]
8   u32  1 for a rising edge, 2 for a falling edge
12  u32  number of the line
16  u32  number of the event of all requested lines
20  u32  number of the event of this line
24  24 bytes of padding
"""

from __future__ import annotations

import errno
import os
import select
import struct
import time
from collections.abc import Mapping, Sequence
from datetime import timedelta
from types import TracebackType
from typing import Any, Literal, Self, get_args

from catenary.sensors.extra import require
from catenary.sensors.sensor import Channel, Clock, Counters, Sample, Value

EVENT = struct.Struct("=QIIII24x")  # in the byte order of the machine
EVENTS_MAX = 16  # of one read
RISING, FALLING = 1, 2
NUMBER_MASK = 0xFFFF_FFFF

Bias = Literal["as_is", "disabled", "pull_up", "pull_down"]


class GpioEdges:
    """Decoder of the edges of some lines. Each edge is one sample.

    The channel of a line is 1 after a rising edge, 0 after a falling edge, and -1 before the first
    edge. If the queue of the kernel was full, the dropped edges are counted as lost. The channels
    are then -1 until the next edge of their line.
    Edges have no fixed rate: `silence` of the runner and `max_age` of the reader must be longer
    than the longest pause between two edges.

    Args:
        lines: number of the line of each channel.
        rate: expected number of edges per second [Hz]; the least one, for the age of a sample.

    Raises:
        ValueError: There is no line, a line occurs twice, or the rate is not positive.
    """

    clock: Clock = "monotonic"

    def __init__(self, lines: Mapping[str, int], *, rate: float = 1.0) -> None:
        if not lines or len(set(lines.values())) < len(lines) or not rate > 0:
            raise ValueError(f"lines={lines}, rate={rate}: name each line once, at a positive rate")
        self.lines = tuple(lines.values())
        self.rate, self.counters = rate, Counters()
        self.channels: Sequence[Channel] = [Channel(name, dtype="|i1") for name in lines]
        self._names = {line: name for name, line in lines.items()}
        self.start()

    def start(self) -> list[bytes]:
        """Forget the levels of the lines. No message is sent."""
        self._levels = self._unknown()
        self._last: int | None = None
        return []

    def stop(self) -> list[bytes]:
        """Send no message."""
        return []

    def feed(self, data: bytes, received_ns: int) -> list[Sample]:
        """Return a sample for each edge, oldest first.

        Args:
            data: whole events of the kernel.
            received_ns: time of reception on CLOCK_MONOTONIC.
        """
        whole = len(data) - len(data) % EVENT.size
        self.counters.garbage += len(data) - whole
        samples = (self._sample(*event) for event in EVENT.iter_unpack(data[:whole]))
        return [each for each in samples if each is not None]

    def _unknown(self) -> dict[str, Value]:
        return dict.fromkeys(self._names.values(), -1)

    def _sample(self, time_ns: int, kind: int, line: int, number: int, _own: int) -> Sample | None:
        if kind not in (RISING, FALLING) or line not in self._names:
            self.counters.bad_messages += 1
            return None
        lost = 0 if self._last is None else (number - self._last - 1) & NUMBER_MASK
        if lost:
            self.counters.lost += lost
            self._levels = self._unknown()
        self._last = number
        self._levels[self._names[line]] = 1 if kind == RISING else 0
        self.counters.samples += 1
        return Sample(time_ns, dict(self._levels))


class GpioLines:
    """Lines of a chip as a source of `GpioEdges`.

    Args:
        chip: path of the chip, such as "/dev/gpiochip0".
        lines: numbers of the lines.
        bias: resistor of the lines.
        active_low: True if a low voltage is level 1.
        debounce: shortest time between two edges of a line [s]; 0: each edge counts.

    Raises:
        ValueError: `bias` is unknown.
    """

    def __init__(
        self,
        chip: str,
        lines: Sequence[int],
        *,
        bias: Bias = "as_is",
        active_low: bool = False,
        debounce: float = 0.0,
    ) -> None:
        if bias not in get_args(Bias):
            raise ValueError(f"bias={bias!r}: must be one of {get_args(Bias)}")
        self._chip, self._lines, self._bias = chip, tuple(lines), bias
        self._active_low, self._debounce = active_low, debounce

    @property
    def name(self) -> str:
        """Path of the chip, and its lines."""
        return f"{self._chip} lines {', '.join(map(str, self._lines))}"

    def open(self) -> GpioConnection:
        """Request the lines.

        Raises:
            ConfigurationError: gpiod is not installed.
            OSError: The chip does not exist, or a line is in use or cannot detect edges.
        """
        library = require("gpiod", "gpiod")
        settings = library.LineSettings(
            edge_detection=library.line.Edge.BOTH,
            bias=library.line.Bias[self._bias.upper()],
            active_low=self._active_low,
            debounce_period=timedelta(seconds=self._debounce),
        )
        return GpioConnection(requested(library, self._chip, {self._lines: settings}))


class GpioConnection:
    """Owner of requested lines."""

    def __init__(self, request: Any) -> None:
        self._request = request
        self._poll = select.poll()
        self._poll.register(request.fd, select.POLLIN)

    def read(self, timeout: float) -> tuple[bytes, int]:
        """Return whole events and the time of reception [ns]; no bytes after `timeout` [s].

        Raises OSError if the chip was removed.
        """
        ready = self._poll.poll(timeout * 1e3)
        data = os.read(self._request.fd, EVENTS_MAX * EVENT.size) if ready else b""
        return data, time.monotonic_ns()

    def write(self, data: bytes) -> None:
        """Raise OSError: inputs take no messages."""
        raise OSError(errno.EOPNOTSUPP, "inputs take no messages")

    def close(self) -> None:
        """Release the lines."""
        self._request.release()


class GpioOutput:
    """Owner of one output line. The kernel does not define its level after the block.

        with GpioOutput("/dev/gpiochip0", 22) as lamp:
            lamp.write(True)

    Args:
        chip: path of the chip, such as "/dev/gpiochip0".
        line: number of the line.
        initial: level from the start of the block.
        active_low: True if a low voltage is level 1.

    Raises:
        ConfigurationError: on entry, if gpiod is not installed.
        OSError: on entry, if the chip does not exist, or the line is in use.
    """

    def __init__(
        self, chip: str, line: int, *, initial: bool = False, active_low: bool = False
    ) -> None:
        self._chip, self._line = chip, line
        self._initial, self._active_low = initial, active_low
        self._request: Any = None

    def __enter__(self) -> Self:
        self._library = require("gpiod", "gpiod")
        settings = self._library.LineSettings(
            direction=self._library.line.Direction.OUTPUT,
            active_low=self._active_low,
            output_value=self._level(self._initial),
        )
        self._request = requested(self._library, self._chip, {self._line: settings})
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._request.release()

    def write(self, level: bool) -> None:
        """Set the level of the line. Raises OSError if the chip was removed."""
        self._request.set_value(self._line, self._level(level))

    def _level(self, level: bool) -> Any:
        value = self._library.line.Value
        return value.ACTIVE if level else value.INACTIVE


def requested(library: Any, chip: str, config: Mapping[Any, Any]) -> Any:
    """Return a request of lines.

    Args:
        library: module gpiod.
        chip: path of the chip.
        config: settings of the lines.

    Raises:
        OSError: The chip does not exist, or a line is in use.
    """
    try:
        return library.request_lines(chip, config=config, consumer="catenary")
    except (ValueError, library.exception.ChipClosedError) as error:
        raise OSError(errno.EINVAL, f"{chip}: {error}") from error
