"""Cycle: what `for cycle in loop` hands out, one object for the whole loop."""

from __future__ import annotations

from catenary.core import (
    CYCLE_LATE,
    CYCLE_LIMITED,
    CYCLE_OK,
    CYCLE_REFUSED,
    CYCLE_UNCOMMITTED,
    Engine,
)


class Cycle:
    """The cycle that the actual values belong to. The same object every time: it reads the
    engine, so note down what you want to keep."""

    __slots__ = ("_engine", "_first_ns", "_first_number")

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._first_number = engine.number
        self._first_ns = engine.time_ns

    @property
    def number(self) -> int:
        """0 for the first cycle of the iteration; skipped instants leave gaps in `time` alone."""
        return self._engine.number - self._first_number

    @property
    def time(self) -> float:
        """[s] since the first cycle of the iteration: a multiple of the period."""
        return (self._engine.time_ns - self._first_ns) * 1e-9

    @property
    def ok(self) -> bool:
        """Every sync unit that is needed answered: the inputs are of this cycle."""
        return bool(self._engine.flags & CYCLE_OK)

    @property
    def lost(self) -> int:
        """How many cycles in a row, up to this one, were not ok."""
        return self._engine.lost_in_row

    @property
    def late(self) -> bool:
        """Instants were skipped, or happened without new targets, since the cycle before."""
        return bool(self._engine.flags & (CYCLE_LATE | CYCLE_UNCOMMITTED))

    @property
    def limited(self) -> bool:
        """The set-points sent last were limited on some axis: see `Drives.limited`."""
        return bool(self._engine.flags & CYCLE_LIMITED)

    @property
    def refused(self) -> bool:
        """Some target was NaN or infinite; its axis held instead."""
        return bool(self._engine.flags & CYCLE_REFUSED)

    def spend(self, seconds: float) -> None:
        """In virtual time: lets time pass as if the body took that long [s]. On a NIC time passes
        by itself, and this raises RuntimeError."""
        self._engine.spend(round(seconds * 1e9))

    def __repr__(self) -> str:
        return f"Cycle(number={self.number}, time={self.time:.6f}, ok={self.ok})"
