"""State of a ring, derived from the links on which the copies of frames return."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

ROUTES = ("first", "second", "both")
NOWHERE = 2  # a copy has not returned yet


class Shape(Enum):
    """Shape of a ring."""

    UNKNOWN = "unknown"  # no frame has returned yet
    CLOSED = "closed"
    CUT = "cut"  # each copy returns on its side of the cut
    FIRST_ONLY = "first only"  # frames sent on the second link do not return
    SECOND_ONLY = "second only"
    DEAD = "dead"  # no frame returns


class RingState(NamedTuple):
    """Shape of a ring, and the number of devices reached from each end.

    The numbers are working counters of broadcasts. In a closed ring, all devices are reached from
    the first end and none from the second.
    """

    shape: Shape
    first_devices: int
    second_devices: int

    @classmethod
    def of(
        cls, arrived_on: Sequence[int], given_up: Sequence[bool], counted: Sequence[int]
    ) -> RingState:
        """Return the state of a ring.

        Args:
            arrived_on: For each copy, the link on which it returned last.
            given_up: For each copy, True if it no longer returns.
            counted: For each copy, the number of devices that answered its last broadcast.
        """
        there = [on != NOWHERE and not gone for on, gone in zip(arrived_on, given_up, strict=True)]
        met = [count if here else 0 for count, here in zip(counted, there, strict=True)]
        return cls(_shape(arrived_on, there), *met)

    @property
    def cut_behind(self) -> int | None:
        """Position of the last device before the cut; -1 if the cable of the first link is cut.

        None if the shape is closed, unknown or dead.
        """
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
