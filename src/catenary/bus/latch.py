"""Latch: times of the edges at a latch input of a device's clock."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Literal, Protocol

from catenary.bus.pending import Pending
from catenary.bus.sdo import Conversations
from catenary.errors import ConfigurationError
from catenary.model.device import DeviceDescription
from catenary.procedure.exchange import Procedure
from catenary.procedure.latch import Latched, read, set_up
from catenary.procedure.station import Station
from catenary.wire.latch import EDGES, INPUTS, LatchControl

LatchEdge = Literal["rising", "falling", "both"]

EVENTS_MAX = 1000  # edges that a handle keeps


@dataclass(frozen=True, slots=True)
class LatchEvent:
    """One edge at a latch input.

    Args:
        edge: "rising" or "falling".
        time_ns: System time of the distributed clocks at the edge [ns]; its low 32 bits if the
            clock of the device has 32 bits. `loop.clocks.loop_time` converts it to `cycle.time`.
    """

    edge: str
    time_ns: int


class LatchOwner(Protocol):
    """Interface to the device; `SubDevice` implements it."""

    @property
    def main(self) -> Conversations: ...

    @property
    def station(self) -> Station: ...

    @property
    def description(self) -> DeviceDescription: ...


class Latch:
    """Latch input of a device's clock: `latch = sub.latch(0, edge="rising")`.

    `read` waits for the answer. While a loop runs, any thread except the iterating one may call it.
    The iterating thread uses `request`.
    """

    def __init__(self, sub: LatchOwner, number: int, edge: LatchEdge, continuous: bool) -> None:
        """Initialise the handle. No traffic.

        Args:
            sub: The device.
            number: Number of the input, 0 or 1.
            edge: "rising", "falling" or "both".
            continuous: True to keep the last edge instead of the first since the last reading.

        Raises:
            ValueError: The input or the edge does not exist.
            ConfigurationError: The device has no distributed clock.
        """
        if number not in range(INPUTS):
            raise ValueError(f"latch input {number!r}: must be 0 or 1")
        if edge not in (*EDGES, "both"):
            raise ValueError(f"edge={edge!r}: must be 'rising', 'falling' or 'both'")
        if not sub.description.clock_bits:
            raise ConfigurationError(
                f"{sub.station} has no distributed clock, and therefore no latch inputs",
                hint="use a device whose ESI or manual lists latch inputs",
            )
        self._sub = sub
        self._number = number
        self._edges = EDGES if edge == "both" else (edge,)
        self._continuous = continuous
        self._last: Latched | None = None  # None: not set up
        self._events: deque[LatchEvent] = deque(maxlen=EVENTS_MAX)

    @property
    def events(self) -> tuple[LatchEvent, ...]:
        """Edges that were read, oldest first; at most the last 1000."""
        return tuple(self._events)

    @property
    def active(self) -> bool | None:
        """Level of the input at the last reading; None before the first one."""
        return None if self._last is None else self._last.active

    def read(self) -> tuple[LatchEvent, ...]:
        """Read the input, and return the new edges. The first call sets it up.

        Raises:
            ConfigurationError: The application of the device controls the input (0x0980).
            RegisterError: The device refuses an access, or does not answer.
            RuntimeError: The caller is the iterating thread of a loop.
        """
        return self._sub.main.converse(self._read())

    def request(self) -> Pending[tuple[LatchEvent, ...]]:
        """Read the input while a loop runs, without waiting: poll `done`, then call `result()`.

        `result()` returns the new edges, or raises the error. Without a loop, the call waits.
        """
        return self._sub.main.request(self._read())

    def _read(self) -> Procedure[tuple[LatchEvent, ...]]:
        sub, number = self._sub, self._number
        bits = sub.description.clock_bits
        if self._last is None:
            single = LatchControl.SINGLE_RISING | LatchControl.SINGLE_FALLING
            control = LatchControl(0) if self._continuous else single
            self._last = yield from set_up(sub.station, number, control, bits)
            return ()
        found = yield from read(sub.station, number, bits)
        new = [
            LatchEvent(edge, time)
            for edge, time, before in (
                ("rising", found.rising_ns, self._last.rising_ns),
                ("falling", found.falling_ns, self._last.falling_ns),
            )
            # The times show new edges in both modes. The status bits would miss an edge if the
            # answer to the first reading was lost, because that reading has cleared them.
            if edge in self._edges and time != before
        ]
        self._last = found
        if len(new) == 2 and _is_later(new[0].time_ns, new[1].time_ns, bits):
            new.reverse()
        self._events.extend(new)
        return tuple(new)

    def __repr__(self) -> str:
        return f"<Latch {self._number} of {self._sub.station}: {len(self._events)} edges>"


def _is_later(one: int, two: int, bits: int) -> bool:
    """Return True if time `one` is later than `two`. Times of 32 bits wrap every 4.3 s."""
    return 0 < (one - two) % (1 << bits) < 1 << bits - 1
