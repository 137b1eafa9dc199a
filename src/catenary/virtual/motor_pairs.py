"""Pairs of joints and motors: the axis of a segment that drives each joint of a plant."""

from __future__ import annotations

from collections.abc import Sequence

from catenary.errors import ConfigurationError
from catenary.virtual.devices.device import Device
from catenary.virtual.devices.motor_device import MotorDevice
from catenary.virtual.joint import Joint


def pair_motors(
    name: str, joints: Sequence[Joint], devices: Sequence[Device]
) -> list[tuple[MotorDevice, int]]:
    """Return the (servo, axis) that drives each joint.

    Args:
        name: Name of the model, for errors.
        joints: The joints, in the order of the axes if they do not name an axis.
        devices: The devices of the segment.

    Raises:
        ConfigurationError: The joints do not match the axes of the servos.
    """
    present = {
        (position, axis): device
        for position, device in enumerate(devices)
        if isinstance(device, MotorDevice)
        for axis in range(device.axes)
    }
    rest = iter(sorted(present.keys() - {joint.axis for joint in joints}))
    places = [joint.axis or next(rest, None) for joint in joints]
    axes = ", ".join(f"({position}, {axis})" for position, axis in present) or "none"
    for joint, place in zip(joints, places, strict=True):
        if place is None or place not in present:
            missing = "axis" if place is None else f"axis {place}"
            raise ConfigurationError(
                f"{name}: no {missing} for joint {joint.name!r}; the axes are {axes}",
                hint="" if present else "for a segment without motors, use plant=plant.part([])",
            )
        if places.count(place) > 1:
            raise ConfigurationError(f"{name}: two joints use axis {place}")
    if any(rest) and not any(joint.axis for joint in joints):
        raise ConfigurationError(
            f"{name}: {len(joints)} joints have motors, but the segment has {len(present)} axes",
            hint="if some axes do not drive the model, give each joint its axis=(position, axis)",
        )
    return [(present[place], place[1]) for place in places if place is not None]
