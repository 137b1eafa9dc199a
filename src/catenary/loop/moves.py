"""Waiting for a move: a motion that goes on while the loop is iterated."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from catenary.core import Cycle
from catenary.errors import CatenaryError, MoveError


class Awaited(Protocol):
    """Move of some axes: `catenary.drive.move.Move`."""

    @property
    def done(self) -> bool: ...

    @property
    def error(self) -> CatenaryError | None: ...

    @property
    def patience(self) -> float:
        """Default timeout [s]."""

    def stop(self) -> None: ...

    def timeout_error(self, timeout: float) -> MoveError: ...


def check_awaited(move: object) -> None:
    """Raise TypeError for what is not a move, such as a time."""
    if not hasattr(move, "timeout_error"):
        raise TypeError(
            f"wait takes a move, such as arm.move_to(0.5); not {move!r}. To let time pass, iterate "
            "the loop, or in the background use time.sleep"
        )


def wait_for_move(cycles: Iterator[Cycle], move: Awaited, timeout: float | None) -> None:
    """Iterate until a move is done. See `Loop.wait`."""
    limit = move.patience if timeout is None else timeout
    begun: float | None = None
    while not move.done:
        cycle = next(cycles)
        begun = cycle.time if begun is None else begun
        if not move.done and cycle.time - begun > limit:
            raise stopped_late(move, limit)
    if move.error is not None:
        raise move.error


def stopped_late(move: Awaited, limit: float) -> MoveError:
    """Stop a move that was not done in time, and return its error."""
    error = move.timeout_error(limit)
    move.stop()
    return error
