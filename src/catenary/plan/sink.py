"""Sink: who is given every cycle of a loop, in whatever process it is read. `loop` and `share` meet
here: a Loop gives to a sink and never asks what becomes of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, Protocol

Block = Literal["record", "actual", "target"]


@dataclass(frozen=True, slots=True)
class SinkField:
    """A value of a cycle and its place in one of the three blocks of native/sink.h."""

    name: str
    block: Block
    offset: int  # bytes, in its block
    format: str  # NumPy's, of one number: "<f8"
    count: int | None = None  # None: a single number
    unit: str = ""  # "rad", "ns"; "": a count, a code, or as the device has it
    per_axis: bool = False  # one number for each axis, in their order


@dataclass(frozen=True, slots=True)
class SinkLayout:
    """What a loop gives in every cycle."""

    period: float  # [s]
    axes: tuple[str, ...]  # names, in the order of the arrays that are per axis
    fields: tuple[SinkField, ...]
    record_size: int  # bytes of the blocks
    actual_size: int
    target_size: int
    utc_offset_ns: int  # UTC less the link's clock, in which `scheduled_ns` counts
    virtual_time: bool


@dataclass(frozen=True, slots=True)
class Incident:
    """Something that happened beside the cycle."""

    kind: str  # the name of an event's class ("DeviceLost") or of the error that ended the loop
    message: str
    time: float  # of the link's clock [s]
    position: int | None = None  # of the device; None: about the segment
    details: Mapping[str, object] = field(default_factory=dict)  # numbers and texts, by name


class Sink(Protocol):
    def open(self, layout: SinkLayout) -> object:
        """A capsule of native/sink.h made for the layout, once a loop has its plan."""

    def tell(self, incident: Incident) -> None:
        """Something happened; from any thread but the cycle's."""

    def close(self) -> None:
        """The loop has ended: nothing more is given. Another `open` may follow."""
