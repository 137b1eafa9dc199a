"""Positions of axes from the joints of another device, such as a glove, by name."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Protocol

from catenary.errors import ConfigurationError
from catenary.ros2.config import MappedJoint
from catenary.ros2.forward import CommandError


class JointPositions(Protocol):
    """`sensor_msgs/JointState`, of Catenary or of rclpy."""

    @property
    def name(self) -> Sequence[str]: ...
    @property
    def position(self) -> Sequence[float]: ...


class JointMap:
    """Mapping from the joints of a `sensor_msgs/JointState` to axes.

    Each axis has the position `scale * joint + offset`, clamped to its minimum and maximum. A
    glove moves further than a gripper, so clamping is not an error. Other joints are ignored.

    Args:
        joints: joint of each axis, by the name of the axis.
        axes: names of the commanded axes, in the order of the positions.

    Raises:
        ConfigurationError: an axis has no joint, a joint has an unknown axis, or a number is not
            usable.
    """

    def __init__(self, joints: Mapping[str, MappedJoint], axes: Sequence[str]) -> None:
        missing = [name for name in axes if name not in joints]
        if missing:
            raise ConfigurationError(
                f"commands.joint_states.axes: axis {missing[0]!r} has no joint",
                hint=f'add [commands.joint_states.axes."{missing[0]}"], or leave it out of '
                "commands.axes",
            )
        unknown = [name for name in joints if name not in axes]
        if unknown:
            raise ConfigurationError(
                f"commands.joint_states.axes: there is no commanded axis {unknown[0]!r}; the axes "
                f"are {', '.join(axes)}"
            )
        self._joints = [joints[name] for name in axes]
        for axis, joint in zip(axes, self._joints, strict=True):
            check(axis, joint)

    def __call__(self, message: JointPositions) -> list[float]:
        """Return the positions of the axes (n,) [rad].

        Raises:
            CommandError: a joint is missing or repeated, has no position, or it is not finite.
        """
        if len(message.name) != len(message.position):
            raise CommandError(f"{len(message.position)} positions for {len(message.name)} names")
        given = dict(zip(message.name, message.position, strict=True))
        if len(given) != len(message.name):
            raise CommandError(f"a joint is named twice: {', '.join(message.name)}")
        return [mapped(joint, given) for joint in self._joints]


def check(axis: str, joint: MappedJoint) -> None:
    """Raise ConfigurationError if the numbers of a joint are not usable."""
    low, high = bounds(joint)
    finite = math.isfinite(joint.scale) and math.isfinite(joint.offset)
    if not finite or joint.scale == 0.0 or not low <= high:
        raise ConfigurationError(
            f"commands.joint_states.axes: scale {joint.scale:g}, offset {joint.offset:g}, minimum "
            f"{low:g} and maximum {high:g} of axis {axis!r} are not usable: give finite numbers, a "
            "scale other than 0, and a minimum below the maximum"
        )


def bounds(joint: MappedJoint) -> tuple[float, float]:
    """Return the minimum and maximum of an axis [rad]; infinite if they are not given."""
    low = -math.inf if joint.minimum is None else joint.minimum
    return low, math.inf if joint.maximum is None else joint.maximum


def mapped(joint: MappedJoint, given: Mapping[str, float]) -> float:
    """Return the position of one axis [rad]. Raises CommandError if the joint is not usable."""
    value = given.get(joint.joint)
    if value is None:
        known = ", ".join(given) or "none"
        raise CommandError(f"the message has no joint {joint.joint!r}; it has {known}")
    if not math.isfinite(value):
        raise CommandError(f"the position of {joint.joint!r} is {value}")
    low, high = bounds(joint)
    return min(max(joint.scale * value + joint.offset, low), high)
