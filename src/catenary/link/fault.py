"""Faults for a fault injector: the kind, and the frames it affects."""

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
    """Fault that affects some of the frames of a link.

    Frames are counted from 0, separately for each `direction` and `traffic`. The first datagram of
    a cyclic frame has an index below 0x80. With one frame per cycle, `traffic="cyclic"` therefore
    counts cycles.

    Args:
        kind: "lose", "delay", "duplicate" or "corrupt".
        direction: "sent" or "received".
        traffic: "all", "cyclic" or "acyclic".
        frames: Numbers of the affected frames; None for all frames.
        probability: Probability of the fault for each of these frames.
        delay: Delay [s]; only for kind "delay".
        offset: Offset of the byte to invert, only for kind "corrupt"; None inverts a random bit of
            the EtherCAT part.
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
                raise ValueError(f"invalid {name} {value!r}: must be one of {', '.join(known)}")
        if not 0.0 <= self.probability <= 1.0:
            raise ValueError(f"probability {self.probability} is outside 0 to 1")
        if (self.kind == "delay") != (self.delay > 0.0):
            raise ValueError(
                f"kind {self.kind!r} with a delay of {self.delay} s: only kind 'delay' has one, "
                "which must be above 0 s"
            )
        if self.offset is not None and (self.kind != "corrupt" or self.offset < 0):
            raise ValueError(f"kind {self.kind!r} cannot have offset {self.offset}")
        if self.frames is not None and (self.frames.step < 1 or self.frames.start < 0):
            raise ValueError(f"frames {self.frames} must not start below 0 or count downwards")
