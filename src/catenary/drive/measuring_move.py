"""Measuring moves: moves that end at the edge of a touch probe, `move_to(..., until=probe)`."""

from __future__ import annotations

from collections.abc import Sequence

from catenary.drive.move import Part
from catenary.drive.port import AxisPort, Failure, Steps
from catenary.drive.probe import Probe


def end_at_edge(parts: Sequence[Part], probe: Probe) -> None:
    """Let the motions of a move begin when a probe is armed, and stop when it has its edge.

    Args:
        parts: The motions, one per axis.
        probe: The probe.

    Raises:
        ValueError: The probe has already ended, or it is continuous.
    """
    if probe.continuous:
        raise ValueError(
            f"until={probe!r}: a continuous probe does not end at an edge; arm it with "
            "continuous=False"
        )
    if probe.done:
        raise ValueError(
            f"until={probe!r}: the probe has already ended; arm a new one with probe() "
            "immediately before each move"
        )
    moving = {part.port for part in parts}
    for part in parts:
        part.steps = _until_edge(part, part.steps, probe, moving)


def _until_edge(part: Part, motion: Steps, probe: Probe, moving: set[AxisPort]) -> Steps:
    """Run the motion of one axis until the probe ends, then bring the axis to rest.

    Args:
        part: Owner of the motion.
        motion: The motion.
        probe: The probe.
        moving: Axes of the move that are not at their goals yet. They arrive at different times.

    Raises:
        MoveError: The probe failed, or all axes reached their goals without an edge.
    """
    rest = part.stop()  # ends a previous move of the axis while the probe is being armed
    try:
        while not probe.armed and not probe.done:
            next(rest, None)
            yield
        rest.close()
        while not probe.done:
            try:
                next(motion)
            except StopIteration:
                moving.discard(part.port)
                if not moving:
                    what = f"reached its goal without an edge of {probe!r}"
                    hint = "check the probe, its edge and its wiring, or choose a farther goal"
                    raise part.port.error(Failure(what, hint)) from None
            yield
    finally:
        motion.close()
        probe.stop()
    yield from part.stop()
    if probe.error is not None:
        raise probe.error
