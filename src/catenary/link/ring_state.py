"""How a ring carries, told by where the copies of its frames came back."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

ROUTES = ("first", "second", "both")
NOWHERE = 2  # a copy has not come back yet


class Shape(Enum):
    UNKNOWN = "unknown"  # nothing has come back yet
    CLOSED = "closed"
    CUT = "cut"  # each copy turns round on its side of the cut
    FIRST_ONLY = "first only"  # nothing comes back of what goes out on the second link
    SECOND_ONLY = "second only"
    DEAD = "dead"  # nothing comes back at all


class RingState(NamedTuple):
    """`first_devices`, `second_devices`: how many are reached from each end, as far as broadcasts
    were counted: in a closed ring all from the first, none from the second."""

    shape: Shape
    first_devices: int
    second_devices: int

    @classmethod
    def of(
        cls, arrived_on: Sequence[int], given_up: Sequence[bool], counted: Sequence[int]
    ) -> RingState:
        """From, for each copy, the link it came back on last, whether it has stopped coming, and
        the devices it met."""
        there = [on != NOWHERE and not gone for on, gone in zip(arrived_on, given_up, strict=True)]
        met = [count if here else 0 for count, here in zip(counted, there, strict=True)]
        return cls(_shape(arrived_on, there), *met)

    @property
    def cut_behind(self) -> int | None:
        """The position in front of the cut, -1 where it is the cable of the first link; None:
        closed, or not known."""
        if self.shape in (Shape.CUT, Shape.FIRST_ONLY, Shape.SECOND_ONLY):
            return self.first_devices - 1
        return None


def _shape(arrived_on: Sequence[int], there: Sequence[bool]) -> Shape:
    if not any(there):
        return Shape.UNKNOWN if NOWHERE in arrived_on else Shape.DEAD
    if there[0] and arrived_on[0] == 1:
        return Shape.CLOSED
    if all(there):
        return Shape.CUT
    return Shape.FIRST_ONLY if there[0] else Shape.SECOND_ONLY
