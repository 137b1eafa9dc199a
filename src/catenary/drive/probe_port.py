"""ProbePort: interface of a touch probe to one axis, and its values.

The bits of 0x60B8 and 0x60B9 are in `touch_probe.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from catenary.bus import Pending
from catenary.drive import touch_probe as bits
from catenary.drive.port import AxisPort, Failure
from catenary.drive.values import Array
from catenary.errors import MoveError

STAMP_SPAN = 1 << 32  # of a time stamp [ns]


@dataclass(frozen=True, slots=True)
class ProbeEvent:
    """One edge that a touch probe captured.

    Args:
        edge: "rising" or "falling".
        position: Position at the edge [rad or m].
        time: Time of the edge on the clock of the loop, as `cycle.time` [s]. None if the drive
            sends no time stamp (0x60D1 to 0x60D4), or if it has no `dc=`.
        cycle_time: `cycle.time` of the cycle that read the edge [s].
    """

    edge: str
    position: float
    time: float | None
    cycle_time: float


class ProbeRequest(NamedTuple):
    """Settings of a probe."""

    number: int
    edges: tuple[str, ...]
    source: str | int
    continuous: bool
    toggles: bool  # True if toggle bits of 0x60B9 show a new edge

    @property
    def function(self) -> int:
        """Byte of this probe in 0x60B8."""
        source = bits.SOURCE_OF_OBJECT
        if isinstance(self.source, str):
            source = bits.SOURCE_BITS[self.source]
        edges = sum(bits.EDGE_BITS[edge] for edge in self.edges)
        return bits.ENABLE | (bits.CONTINUOUS if self.continuous else 0) | source | edges


class ProbePort:
    """Owner of the byte of one probe in 0x60B8, with access to the values of the probe."""

    def __init__(
        self,
        axis: AxisPort,
        index: int,
        number: int,
        actual: Mapping[str, Array],
        function: Array,
        *,
        system_time: Callable[[], int | None],
        write_source: Callable[[int, int], Pending[None]],
    ) -> None:
        self._axis = axis
        self._index = index
        self._number = number
        self._actual = actual
        self._function = function
        self._system_time = system_time
        self._write_source = write_source
        self.now = 0.0  # [s] time of the cycle

    @property
    def name(self) -> str:
        """Name of the axis."""
        return self._axis.name

    @property
    def exchange(self) -> float:
        """Time between two exchanges of the drive [s]."""
        return self._axis.exchange

    @property
    def is_led(self) -> bool:
        """True if a law or a stream sets the outputs."""
        return self._axis.is_led

    @property
    def status(self) -> int:
        """Byte of this probe in 0x60B9."""
        return self._value(bits.STATUS_COLUMN) >> self._shift & 0xFF

    @property
    def _shift(self) -> int:
        return 8 * (self._number - 1)

    def _value(self, column: str) -> int:
        return int(self._actual[column][self._index])

    def write(self, function: int) -> None:
        """Write the byte of this probe in 0x60B8."""
        rest = int(self._function[self._index]) & ~(0xFF << self._shift)
        self._function[self._index] = rest | function << self._shift

    def write_source(self, source: int) -> Pending[None]:
        """Request 0x60D0 of this probe by SDO."""
        return self._write_source(self._number, source)

    def lacks(self, edge: str) -> bool:
        """Return True if the position of an edge is not in the process data."""
        return bits.position_column(self._number, edge) not in self._actual

    def counter(self, edge: str) -> int | None:
        """Return the counter of an edge; None if it is not in the process data."""
        name = bits.counter_column(self._number, edge)
        return self._value(name) if name in self._actual else None

    def stamp(self, edge: str) -> int | None:
        """Return the time stamp of an edge [ns]; None if it is not in the process data."""
        name = bits.time_column(self._number, edge)
        return self._value(name) if name in self._actual else None

    def raw_position(self, edge: str) -> float:
        """Return the stored position of an edge, with the wraps of its 32-bit counter."""
        return float(self._actual[bits.position_column(self._number, edge)][self._index])

    def event(self, edge: str) -> ProbeEvent:
        """Return the stored edge."""
        raw, actual = self.raw_position(edge), self._axis.position
        span = (1 << 32) * abs(self._axis.units.position_scale)
        turns = round((actual - raw) / span) if math.isfinite(actual) else 0
        return ProbeEvent(edge, raw + turns * span, self._time_of(edge), self.now)

    def _time_of(self, edge: str) -> float | None:
        stamp, present = self.stamp(edge), self._system_time()
        if stamp is None or present is None:
            return None
        half = STAMP_SPAN // 2
        age = (present - stamp + half) % STAMP_SPAN - half
        return self.now - age * 1e-9

    def error(self, what: str, hint: str) -> MoveError:
        """Return an error of this probe."""
        return self._axis.error(Failure(f"touch probe {self._number} {what}", hint))
