"""What a fault injector does to which frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

Kind: TypeAlias = Literal["lose", "delay", "duplicate", "corrupt"]
Direction: TypeAlias = Literal["sent", "received"]
Traffic: TypeAlias = Literal["all", "cyclic", "acyclic"]

KINDS: tuple[Kind, ...] = ("lose", "delay", "duplicate", "corrupt")
DIRECTIONS: tuple[Direction, ...] = ("sent", "received")
TRAFFICS: tuple[Traffic, ...] = ("all", "cyclic", "acyclic")


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One fault, at the frames numbered `frames` (default: any), each with `probability`.

    Frames are counted from 0 per `direction` and `traffic`: cyclic frames have a first datagram of
    index below 0x80, so that with one frame a cycle `traffic="cyclic"` counts cycles.
    `delay` [s] goes with kind "delay". "corrupt" inverts the byte at `offset` of the frame, or one
    bit anywhere in its EtherCAT part where `offset` is None.
    """

    kind: Kind
    direction: Direction = "received"
    traffic: Traffic = "all"
    frames: range | None = None
    probability: float = 1.0
    delay: float = 0.0
    offset: int | None = None

    def __post_init__(self) -> None:
        for name, value, known in (
            ("kind", self.kind, KINDS),
            ("direction", self.direction, DIRECTIONS),
            ("traffic", self.traffic, TRAFFICS),
        ):
            if value not in known:
                raise ValueError(f"{name} {value!r} is none of {', '.join(known)}")
        if not 0.0 <= self.probability <= 1.0:
            raise ValueError(f"probability {self.probability} is not within 0..1")
        if (self.kind == "delay") != (self.delay > 0.0):
            raise ValueError(f"kind {self.kind!r} does not go with a delay of {self.delay} s")
        if self.offset is not None and (self.kind != "corrupt" or self.offset < 0):
            raise ValueError(f"kind {self.kind!r} does not go with offset {self.offset}")
        if self.frames is not None and (self.frames.step < 1 or self.frames.start < 0):
            raise ValueError(f"frames {self.frames} do not count upwards from 0")
