"""Sink: interface to a receiver of every cycle of a loop.

`loop` and `share` have this interface in common. A Loop does not depend on the use of the data.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, Protocol, runtime_checkable

Block = Literal["record", "actual", "target"]


@dataclass(frozen=True, slots=True)
class SinkField:
    """Value of a cycle, and its place in one of the three blocks of native/sink.h."""

    name: str
    block: Block
    offset: int  # bytes, in its block
    format: str  # NumPy format of one number, such as "<f8"
    count: int | None = None  # None: a single number
    unit: str = ""  # such as "rad"; empty for a count, a code, or a unit of the device
    per_axis: bool = False  # one number for each axis, in their order


@dataclass(frozen=True, slots=True)
class SinkLayout:
    """Layout of the data that a loop publishes in every cycle."""

    period: float  # [s]
    axes: tuple[str, ...]  # names, in the order of arrays with one number per axis
    fields: tuple[SinkField, ...]
    record_size: int  # bytes of the blocks
    actual_size: int
    target_size: int
    utc_offset_ns: int  # UTC minus the link's clock, the clock of `scheduled_ns`
    virtual_time: bool


@dataclass(frozen=True, slots=True)
class Incident:
    """Event outside of the cyclic data."""

    kind: str  # class name of an event ("DeviceLost") or of the error that ended the loop
    message: str
    time: float  # on the link's clock [s]
    position: int | None = None  # of the device; None: the segment
    details: Mapping[str, object] = field(default_factory=dict)  # numbers and texts by name


class Sink(Protocol):
    """Receiver of every cycle of a loop."""

    def open(self, layout: SinkLayout) -> object:
        """Return a capsule of native/sink.h for the layout. A loop calls this after planning."""

    def report(self, incident: Incident) -> None:
        """Receive an incident. Any thread except the cycle thread may call this."""

    def close(self) -> None:
        """End the publication. Another `open` may follow."""


@runtime_checkable
class ServingSink(Sink, Protocol):
    """Sink that also serves requests to the loop of its data."""

    def serve(self, network: object) -> None:
        """Receive the `loop.Network` after `open`, before its first cycle. `close` ends it."""
