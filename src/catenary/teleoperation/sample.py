"""Values that the two sides exchange in every cycle."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

AXES_MAX = 16
Numbers: TypeAlias = Sequence[float] | npt.NDArray[np.float64]


class PeerSample(NamedTuple):
    """State of one side: three sequences with one number per axis, and three flags.

    `Peer.send` takes any sequences, such as arrays. `Peer.receive` returns tuples.
    """

    position: Numbers  # [rad] or [m]
    velocity: Numbers  # [rad/s] or [m/s]
    force: Numbers  # [N·m] or [N]
    holding: bool = False  # True if this side holds, and does not follow
    in_contact: bool = False
    wants_stop: bool = False  # True to ask the other side to stop

    @property
    def is_finite(self) -> bool:
        """True if no value is infinite or not a number."""
        return all(map(math.isfinite, (*self.position, *self.velocity, *self.force)))


def check_sample(sample: PeerSample, axes: int) -> None:
    """Check a sample before it is sent.

    Args:
        sample: the sample.
        axes: number of axes of the link.

    Raises:
        TypeError: a single number instead of a sequence.
        ValueError: a sequence has another length, or a value is not finite.
    """
    try:
        lengths = len(sample.position), len(sample.velocity), len(sample.force)
    except TypeError:
        raise TypeError(
            f"position, velocity and force are sequences with {axes} numbers: {sample}"
        ) from None
    if lengths != (axes, axes, axes):
        raise ValueError(f"the sample has {lengths} positions, velocities, forces; expected {axes}")
    if not sample.is_finite:
        raise ValueError(f"the sample has a value that is not finite: {sample}")
