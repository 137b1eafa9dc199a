"""Methods that start moves, in a loop that runs in the background."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from functools import partial

from catenary.drive import Drives
from catenary.errors import LoopError
from catenary.remote import messages
from catenary.remote.program import Program, Work, in_thread


def home(program: Program, axes: list[str]) -> Work[messages.Done]:
    """Start the homing of axes; see `Client.home`."""
    drives, numbers = _drives_of(program, axes)
    return (yield from _begin(program, lambda: drives.home(numbers)))


def move(
    program: Program, axes: list[str], positions: list[float], velocity: float | None = None
) -> Work[messages.Done]:
    """Start a move of axes to positions; see `Client.move`."""
    if len(positions) != len(axes):
        raise ValueError(f"{len(positions)} positions for {len(axes)} axes")
    drives, numbers = _drives_of(program, axes)
    begin = partial(drives.move_to, positions, velocity=velocity, axes=numbers)
    return (yield from _begin(program, begin))


def _begin(program: Program, begin: Callable[[], object]) -> Work[messages.Done]:
    """Begin a motion in an update of the loop. Nothing moves after the deadline of the request.

    Raises:
        LoopError: The share does not allow motions, or the loop does not run in the background.
    """
    if not program.share.layout.jog:
        raise LoopError(
            "the program does not allow motions on request of other programs",
            hint="it can allow them: cat.Share(..., jog=True)",
        )
    update = _update_of(program)

    def start(given_up: Callable[[], bool]) -> None:
        with update():
            if not given_up():
                begin()

    yield from in_thread(start)
    return messages.Done()


def _update_of(program: Program) -> Callable[[], AbstractContextManager[None]]:
    """Return `Loop.update` of a loop in the background. Raises LoopError for other loops."""
    update = program.session.update
    if update is None:
        raise LoopError(
            "the program iterates its loop itself and writes the targets: moves are not possible",
            hint="call loop.run_in_background() in the program, or use a lease",
        )
    return update


def _drives_of(program: Program, axes: Sequence[str]) -> tuple[Drives, list[int]]:
    """Return the Drives of axes, and the numbers of the axes in it.

    Raises:
        ValueError: An axis is unknown, or the axes belong to several Drives.
    """
    for drives in program.network.requests:
        if not isinstance(drives, Drives) or not axes:
            continue
        if set(axes) <= set(drives.names):
            return drives, [drives.names.index(name) for name in axes]
    known = [axis.name for axis in program.network.plan.cycle.axes]
    raise ValueError(
        f"axes {', '.join(axes) or '(none)'}: use axes of one Drives; known axes: "
        f"{', '.join(known) or 'none'}"
    )
