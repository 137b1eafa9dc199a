"""Moves: requested motions of some axes, stepped before each commit of the loop."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from catenary.drive.motions import HALT, OWN_BITS
from catenary.drive.port import AxisPort, Complaint, Steps
from catenary.errors import CatenaryError, MoveError
from catenary.plan.request import Mover
from catenary.wire.cia402 import Mode

Outcome: TypeAlias = Literal["reached", "stopped", "replaced", "failed"]

WORST: tuple[Outcome, ...] = ("failed", "replaced", "stopped", "reached")


@dataclass(slots=True)
class Part:
    """Owns the motion of one axis in a move."""

    port: AxisPort
    goal: float  # NaN in homing
    steps: Steps
    stop: Callable[[], Steps]  # brings the axis to rest
    mode: int | None = None  # the axis must keep it; None: the motion changes it
    stop_requested: bool = False
    is_stopping: bool = False
    outcome: Outcome | None = None
    error: CatenaryError | None = None


class Move:
    """Handle of a requested motion: `arm.move_to(...)`, `arm.move_by(...)`, `arm.home()`.

    The loop must be iterated while it moves: `loop.wait(move)` does it, or your own `for`.
    """

    def __init__(self, parts: Sequence[Part], patience: float) -> None:
        self._parts = tuple(parts)
        self._done = False
        self.patience = patience  # [s] default of `loop.wait(move)`

    @property
    def done(self) -> bool:
        """True once every axis has arrived, or has ended otherwise: see `outcome`."""
        return self._done

    @property
    def outcome(self) -> Outcome | None:
        """End of the move; None while it is not done. The worst end of its axes counts.

        "reached": its goal. "stopped": by `stop`. "replaced": by another move of one of its axes.
        "failed": see `error`.
        """
        if not self.done:
            return None
        return next(each for each in WORST if any(part.outcome == each for part in self._parts))

    @property
    def error(self) -> CatenaryError | None:
        """Error of a move that failed or was replaced; else None."""
        errors = [part.error for part in self._parts if part.error is not None]
        return errors[0] if self.done and errors else None

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the moving axes."""
        return tuple(part.port.name for part in self._parts)

    @property
    def remaining(self) -> npt.NDArray[np.float64]:
        """(k,) goal minus actual position of the moving axes [rad], [m]; NaN in homing."""
        return np.array([part.goal - part.port.position for part in self._parts])

    def stop(self) -> None:
        """Decelerate and hold; the move is done when its axes are at rest.

        In CSP by the acceleration of the move, in PP by the drive's halt (0x605D), in homing the
        search ends.
        """
        for part in self._parts:  # without a lock, so that a signal handler may call it
            part.stop_requested = True

    def timeout_error(self, timeout: float) -> MoveError:
        """Return the error of a move that is not done after `timeout` [s]."""
        part = next((part for part in self._parts if part.outcome is None), self._parts[0])
        hint = "give loop.wait(timeout=) more time, or look at what keeps the axis: Drives.state"
        return part.port.error(Complaint(f"was still moving after {timeout:g} s", hint, part.goal))

    def finish_if_over(self) -> None:
        """Become done if no axis moves any more."""
        if all(part.outcome is not None for part in self._parts):
            self._done = True

    def __repr__(self) -> str:
        return f"<Move of {', '.join(self.axes)}: {self.outcome or 'moving'}>"


class Moves:
    """Owns the active moves of some drives: at most one of each axis. A `Mover` of the loop.

    Moves are requested by any thread; the thread that iterates the loop steps them.
    """

    def __init__(self, movers: list[Mover]) -> None:
        self._movers = movers
        self._lock = threading.Lock()
        self._active: dict[int, tuple[Part, Move]] = {}

    def begin(self, parts: Mapping[int, Part], patience: float) -> Move:
        """Start a move. It replaces the motion of axes that move already.

        Args:
            parts: Motion of each axis, by its number.
            patience: Default timeout of a wait [s].
        """
        with self._lock:
            move = Move(tuple(parts.values()), patience)
            replaced = {axis: self._active[axis] for axis in parts if axis in self._active}
            if self not in self._movers:
                self._movers.append(self)
            # At once: an interrupt must leave neither half a move nor a motion without a move.
            self._active.update({axis: (part, move) for axis, part in parts.items()})
            for part, old in replaced.values():
                _replace(part, old)
        return move

    def goal(self, axis: int) -> float | None:
        """Return the position from which `move_by` counts while an axis moves; None: its target."""
        with self._lock:
            part, _ = self._active.get(axis, (None, None))
        if part is None:
            return None
        if part.stop_requested:  # in PP the target is still the abandoned goal
            return part.port.position if part.mode == Mode.PP else None
        return part.goal

    # plan.request.Mover

    def step(self, now: float) -> None:
        """Compute one step of each moving axis, at the time of the cycle [s]."""
        with self._lock:
            for axis, (part, _) in list(self._active.items()):
                part.port.now = now
                if not self._check(axis, part):
                    self._advance(axis, part)
            self._leave_if_idle()

    def check(self) -> None:
        """End the moves of axes that were stopped."""
        with self._lock:
            for axis, (part, _) in list(self._active.items()):
                self._check(axis, part)
            self._leave_if_idle()

    def end(self) -> None:
        """End all moves: the loop is left."""
        with self._lock:
            for axis, (part, _) in list(self._active.items()):
                hint = "wait for a move before the loop is left: loop.wait(move)"
                self._fail(axis, part, Complaint("was moving when the loop ended", hint, part.goal))
            self._leave_if_idle()

    # One axis

    def _check(self, axis: int, part: Part) -> bool:
        """End the motion of an axis that cannot continue it. Return True if so."""
        cause = part.port.stop_cause()
        if cause is not None:
            hint = "see Drives.state and Drives.stopped; reset and enable the axis, then move again"
        elif part.mode is not None and part.port.requested_mode != part.mode:
            cause, hint = "its mode was changed", "wait for a move before Drives.switch()"
        elif part.port.is_led:
            cause = "a law or a stream sets its targets now"
            hint = "wait for a move before you start a law"
        else:
            return False
        self._fail(axis, part, Complaint(f"ended its move: {cause}", hint, part.goal))
        return True

    def _advance(self, axis: int, part: Part) -> None:
        if part.stop_requested and not part.is_stopping:
            part.steps.close()
            part.steps = part.stop()
            part.is_stopping = True
        try:
            next(part.steps)
        except StopIteration:
            self._finish(axis, "stopped" if part.is_stopping else "reached", None)
        except CatenaryError as error:
            self._finish(axis, "failed", error)
        except BaseException:  # an interrupt: the motion has ended in the middle
            self._fail(axis, part, Complaint("was interrupted", "start the move again", part.goal))
            raise

    def _fail(self, axis: int, part: Part, complaint: Complaint) -> None:
        error = part.port.error(complaint)
        part.steps.close()
        part.port.clear_bits(OWN_BITS)
        part.port.handshake = False
        self._finish(axis, "failed", error)

    def _finish(self, axis: int, outcome: Outcome, error: CatenaryError | None) -> None:
        """End the move of the axis. After a handshake error it stays halted."""
        part, move = self._active.pop(axis)
        part.outcome, part.error = outcome, error
        part.port.motion = None
        part.port.clear_bits(OWN_BITS & ~HALT)
        move.finish_if_over()

    def _leave_if_idle(self) -> None:
        if not self._active and self in self._movers:
            self._movers.remove(self)


def _replace(part: Part, move: Move) -> None:
    """End a motion whose successor continues from it."""
    part.steps.close()
    part.port.clear_bits(OWN_BITS & ~HALT)
    part.outcome = "replaced"
    hint = "wait for a move before the next one, or look at move.outcome"
    part.error = part.port.error(Complaint("got another move", hint, part.goal))
    move.finish_if_over()
