"""Positions between the commands of clients that send more slowly than the loop cycles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from catenary.share.commands import AxisCommand, LeaseEnd, Places

LONGEST = 0.020  # [s] after a command


class _Motion(NamedTuple):
    """Motion of an axis since its last command."""

    number: int  # of the cycle in which the command was read
    position: float  # [rad]
    velocity: float  # [rad/s]


class Extrapolation:
    """Motions that continue until the next command, as their clients have requested.

    Args:
        axes: names of the axes, in the order of the layout.
        period: cycle time [s].
    """

    def __init__(self, axes: Sequence[str], period: float) -> None:
        self._axes = axes
        self._period = period
        self._longest = LONGEST / period  # [cycles]
        self._motions: dict[str, _Motion] = {}

    def follow(
        self, commands: Sequence[AxisCommand], ended: Sequence[LeaseEnd], number: int
    ) -> bool:
        """Start and end motions. Return True if an axis moves.

        Args:
            commands: new commands, oldest first.
            ended: leases that have ended.
            number: number of the newest cycle.
        """
        for end in ended:
            for name in end.axes:
                self._motions.pop(name, None)
        for command in commands:
            self._motions |= self._started(command, number)
        return bool(self._motions)

    def _started(self, command: AxisCommand, number: int) -> Mapping[str, _Motion]:
        """Return the motions that a command starts. It ends those of its other axes."""
        for axis in command.axes:
            self._motions.pop(self._axes[axis], None)
        position, velocity = command.position, command.velocity
        if not command.extrapolate or position is None or velocity is None:
            return {}
        pairs = zip(position.tolist(), velocity.tolist(), strict=True)
        names = (self._axes[axis] for axis in command.axes)
        return {name: _Motion(number, *each) for name, each in zip(names, pairs, strict=True)}

    def write(self, places: Places, number: int) -> None:
        """Write the present positions into the targets of drives.

        An axis without a command for 20 ms stays where it is, with velocity 0.

        Args:
            places: targets of the drives, and indices in them, by name of the axis.
            number: number of the newest cycle.
        """
        for name, motion in list(self._motions.items()):
            cycles = number - motion.number
            if cycles > self._longest:
                del self._motions[name]
            if name not in places:
                continue
            target, k = places[name]
            if cycles > self._longest:
                target.velocity[k] = 0.0
            else:
                age = cycles * self._period
                target.position[k] = motion.position + motion.velocity * age
