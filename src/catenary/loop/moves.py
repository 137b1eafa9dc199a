"""Waiting for a move that continues while the loop is iterated."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from catenary.core import Cycle
from catenary.errors import CatenaryError, MoveError


class Awaited(Protocol):
    """Move of some axes, or touch probe: `catenary.drive.Move` and `catenary.drive.Probe`."""

    @property
    def done(self) -> bool: ...

    @property
    def error(self) -> CatenaryError | None: ...

    @property
    def patience(self) -> float:
        """Default timeout [s]."""

    def stop(self) -> None: ...

    def timeout_error(self, timeout: float) -> MoveError: ...


def require_move(move: object) -> None:
    """Raise TypeError for anything that is neither a move nor a touch probe."""
    if not hasattr(move, "patience"):
        raise TypeError(
            "loop.wait() needs a move or a touch probe, for example from arm.move_to() or "
            f"arm.probe(), not {move!r}"
        )


def wait_for_move(cycles: Iterator[Cycle], move: Awaited, timeout: float | None) -> None:
    """Iterate until a move is done: see `Loop.wait`.

    Args:
        cycles: Iterator of the loop.
        move: Move to wait for.
        timeout: Longest wait [s]; None: the default of the move.

    Raises:
        MoveError: The move was not done in time. It has been stopped.
        CatenaryError: The error of the move, or of a cycle.
    """
    limit = move.patience if timeout is None else timeout
    begun: float | None = None
    while not move.done:
        cycle = next(cycles)
        now = max(each.time for each in cycle.networks)  # the time of a failed network may stop
        begun = now if begun is None else begun
        if not move.done and now - begun > limit:
            raise stopped_late(move, limit)
    if move.error is not None:
        raise move.error


def stopped_late(move: Awaited, limit: float) -> MoveError:
    """Request the stop of a move that was not done in time, and return its error."""
    error = move.timeout_error(limit)
    move.stop()
    return error
