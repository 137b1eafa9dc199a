"""Moves: requested motions of axes, which run one step before each commit of the loop."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from catenary.drive.motions import HALT, OWN_BITS
from catenary.drive.port import AxisPort, Failure, Steps
from catenary.errors import CatenaryError, MoveError
from catenary.plan.request import Mover
from catenary.wire.cia402 import Mode

Outcome: TypeAlias = Literal["reached", "stopped", "replaced", "failed"]

WORST: tuple[Outcome, ...] = ("failed", "replaced", "stopped", "reached")


@dataclass(slots=True)
class Part:
    """Owner of the motion of one axis in a move."""

    port: AxisPort
    goal: float  # NaN for a homing
    steps: Steps
    stop: Callable[[], Steps]  # brings the axis to rest
    mode: int | None = None  # mode that the axis must keep; None if the motion changes it
    stop_requested: bool = False
    is_stopping: bool = False
    outcome: Outcome | None = None
    error: CatenaryError | None = None


class Move:
    """Handle of a motion from `arm.move_to(...)`, `arm.move_by(...)` or `arm.home()`.

    The loop must be iterated during the motion: call `loop.wait(move)`, or use a `for` statement.
    """

    def __init__(self, parts: Sequence[Part], patience: float) -> None:
        self._parts = tuple(parts)
        self._done = False
        self.patience = patience  # [s] default timeout of `loop.wait(move)`

    @property
    def done(self) -> bool:
        """True when no axis of the move is moving any more; see `outcome`."""
        return self._done

    @property
    def outcome(self) -> Outcome | None:
        """Result of the move; None while it is not done. The worst result of its axes counts.

        - "reached": all axes are at their goals.
        - "stopped": `stop` ended the move.
        - "replaced": another move of one of its axes ended the move.
        - "failed": an axis could not continue; see `error`.
        """
        if not self.done:
            return None
        return next(each for each in WORST if any(part.outcome == each for part in self._parts))

    @property
    def error(self) -> CatenaryError | None:
        """Error of a move that failed or was replaced; otherwise None."""
        errors = [part.error for part in self._parts if part.error is not None]
        return errors[0] if self.done and errors else None

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the moving axes."""
        return tuple(part.port.name for part in self._parts)

    @property
    def remaining(self) -> npt.NDArray[np.float64]:
        """Goal minus actual position of each moving axis, (k,) [rad or m]; NaN for a homing."""
        return np.array([part.goal - part.port.position for part in self._parts])

    def stop(self) -> None:
        """Request a stop. The move is done when its axes are at rest.

        In CSP, the axes decelerate with the acceleration of the move. In PP, the drive performs a
        halt (0x605D). A homing is ended.
        """
        for part in self._parts:  # without a lock, so that a signal handler can call it
            part.stop_requested = True

    def timeout_error(self, timeout: float) -> MoveError:
        """Return the error of a move that is not done after `timeout` [s]."""
        part = next((part for part in self._parts if part.outcome is None), self._parts[0])
        hint = "increase loop.wait(timeout=), or check Drives.state of the axis"
        return part.port.error(Failure(f"was still moving after {timeout:g} s", hint, part.goal))

    def finish_if_over(self) -> None:
        """Mark the move as done if no axis is moving any more."""
        if all(part.outcome is not None for part in self._parts):
            self._done = True

    def __repr__(self) -> str:
        return f"<Move of {', '.join(self.axes)}: {self.outcome or 'moving'}>"


class Moves:
    """Owner of the active moves of some drives, at most one per axis. It is a `Mover` of the loop.

    Any thread can request a move. The thread that iterates the loop runs the steps.
    """

    def __init__(self, movers: list[Mover]) -> None:
        self._movers = movers
        self._lock = threading.Lock()
        self._active: dict[int, tuple[Part, Move]] = {}

    def begin(self, parts: Mapping[int, Part], patience: float) -> Move:
        """Start a move. It replaces the present moves of its axes.

        Args:
            parts: motion of each axis, by its number.
            patience: default timeout of a wait [s].
        """
        with self._lock:
            move = Move(tuple(parts.values()), patience)
            replaced = {axis: self._active[axis] for axis in parts if axis in self._active}
            if self not in self._movers:
                self._movers.append(self)
            # A single update: after an interrupt, all axes of the move are active, or none.
            self._active.update({axis: (part, move) for axis, part in parts.items()})
            for part, old in replaced.values():
                _replace(part, old)
        return move

    def goal(self, axis: int) -> float | None:
        """Return the position from which `move_by` counts; None for the target of the axis."""
        with self._lock:
            part, _ = self._active.get(axis, (None, None))
        if part is None:
            return None
        if part.stop_requested:  # in PP, the target is still the previous goal
            return part.port.position if part.mode == Mode.PP else None
        return part.goal

    # plan.request.Mover

    def step(self, now: float) -> None:
        """Run one step of each moving axis.

        Args:
            now: time of the cycle [s].
        """
        with self._lock:
            for axis, (part, _) in list(self._active.items()):
                part.port.now = now
                if not self._check(axis, part):
                    self._advance(axis, part)
            self._leave_if_idle()

    def check(self) -> None:
        """End the moves of axes that cannot continue."""
        with self._lock:
            for axis, (part, _) in list(self._active.items()):
                self._check(axis, part)
            self._leave_if_idle()

    def end(self) -> None:
        """End all moves as failed, because the loop ends."""
        with self._lock:
            for axis, (part, _) in list(self._active.items()):
                hint = "wait for the move before you leave the loop: loop.wait(move)"
                self._fail(axis, part, Failure("was moving when the loop ended", hint, part.goal))
            self._leave_if_idle()

    # One axis

    def _check(self, axis: int, part: Part) -> bool:
        """End the motion of an axis if it cannot continue. Return True in this case."""
        cause = part.port.stop_cause()
        if cause is not None:
            hint = "check Drives.state and Drives.stopped, enable the axis, then move again"
        elif part.mode is not None and part.port.requested_mode != part.mode:
            cause, hint = "its mode was changed", "wait for the move before Drives.switch()"
        elif part.port.is_led:
            cause = "a law or a stream now sets its targets"
            hint = "wait for the move before you start a law or a stream"
        else:
            return False
        self._fail(axis, part, Failure(f"ended its move: {cause}", hint, part.goal))
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
        except BaseException:  # an interrupt has ended the generator
            self._fail(axis, part, Failure("was interrupted", "start the move again", part.goal))
            raise

    def _fail(self, axis: int, part: Part, failure: Failure) -> None:
        error = part.port.error(failure)
        part.steps.close()
        part.port.clear_bits(OWN_BITS)
        part.port.handshake = False
        self._finish(axis, "failed", error)

    def _finish(self, axis: int, outcome: Outcome, error: CatenaryError | None) -> None:
        """End the motion of an axis. After an error of the handshake, halt stays set."""
        part, move = self._active.pop(axis)
        part.outcome, part.error = outcome, error
        part.port.motion = None
        part.port.clear_bits(OWN_BITS & ~HALT)
        move.finish_if_over()

    def _leave_if_idle(self) -> None:
        if not self._active and self in self._movers:
            self._movers.remove(self)


def _replace(part: Part, move: Move) -> None:
    """End a motion that another move of the axis continues."""
    part.steps.close()
    part.port.clear_bits(OWN_BITS & ~HALT)
    part.outcome = "replaced"
    hint = "wait for a move before you start the next one, or check move.outcome"
    part.error = part.port.error(Failure("received another move", hint, part.goal))
    move.finish_if_over()
