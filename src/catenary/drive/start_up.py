"""SDO reads and downloads of an axis in PRE-OP: rated torque, settings, mode, 0x60C2."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from catenary.bus import SubDevice
from catenary.drive.axis import Axis, interpolation_time
from catenary.drive.settings import read_settings
from catenary.errors import ConfigurationError, SdoAbort
from catenary.types import SINT, UDINT, USINT
from catenary.wire.cia402 import Mode, Object

# SDO abort codes for a missing object: no object, no subindex.
OBJECT_MISSING = (0x06020000, 0x06090011)


def with_rated_torque(axis: Axis, sub: SubDevice) -> Axis:
    """Read 0x6076 by SDO, and return the axis with this rated torque.

    The axis is returned unchanged if the application gave a rated torque or the axis uses no
    torque. It is also unchanged if it only measures the torque and the drive has no rated torque.

    Args:
        axis: the axis.
        sub: its device.

    Raises:
        ConfigurationError: The axis needs its torque, but the drive does not have a rated torque.
        SdoAbort: The drive has 0x6076, but refuses to read it.
    """
    if axis.sercos or axis.units.rated_torque is not None or not axis.uses_torque:
        return axis
    index = axis.index(Object.MOTOR_RATED_TORQUE)
    try:
        rated = sub.sdo.read(index, 0, type=UDINT)
    except SdoAbort as abort:
        if abort.code not in OBJECT_MISSING:
            raise
        rated = 0
    if rated <= 0 and not axis.needs_torque:
        return axis  # its torque reads NaN
    if rated <= 0:
        raise ConfigurationError(
            f"{axis.name}: the drive has no rated torque (0x{index:04X})",
            hint="give Drives(rated_torque=...) in N·m, or omit torque from measured=",
        )
    return replace(axis, units=replace(axis.units, rated_torque=rated * 1e-3))


def with_settings(axes: Sequence[Axis], subs: Sequence[SubDevice]) -> tuple[Axis, ...]:
    """Read the reactions and limits of the drives by SDO, and return the axes with them.

    Args:
        axes: the axes.
        subs: device of each axis.

    Raises:
        ConfigurationError: An axis in CST has no `on_loss=` and a quick stop that may not brake, or
            no deceleration is known.
    """
    by_sdo = [k for k, axis in enumerate(axes) if axis.sercos is None]
    places = [(subs[k], axes[k].slot) for k in by_sdo]
    read = list(axes)
    for k, settings in zip(by_sdo, read_settings(places), strict=True):
        read[k] = replace(axes[k], settings=settings)
        _check_quick_stop(read[k])
        _ = read[k].bounds  # an error must be raised before anything is written
    return tuple(read)


def _check_quick_stop(axis: Axis) -> None:
    """Raise ConfigurationError in CST if the quick stop may not brake and `on_loss=` is missing."""
    if Mode.CST not in axis.modes or axis.options.on_loss is not None or axis.settings.brakes:
        return
    index, code = axis.index(Object.QUICK_STOP_OPTION), axis.settings.quick_stop
    found = "cannot be read" if code is None else f"is {code}"
    why = "switches the motor off without braking" if code == 0 else "has an unknown effect"
    raise ConfigurationError(
        f"{axis.name}: the quick stop option code 0x{index:04X} {found}, so a quick stop in CST "
        f"{why}",
        hint=f"write 2 to 0x{index:04X} if the drive allows it, or state the reaction: "
        'Drives(on_loss="quick_stop"), "disable", or "csp_hold" (position hold in CSP)',
    )


def downloads(axis: Axis, sub: SubDevice, period_ns: int) -> tuple[tuple[int, int, bytes], ...]:
    """Return the objects to write at the start-up: mode, 0x60C2, ramps and homing settings.

    The call reads the mode and 0x60C2 by SDO, and omits each that already has the right value.

    Args:
        axis: the axis.
        sub: its device.
        period_ns: time between two exchanges [ns].

    Returns:
        (index, subindex, data) of each object.

    Raises:
        ConfigurationError: 0x60C2 cannot represent the period.
        SdoAbort: The drive refuses to read an object that it has.
    """
    if axis.sercos is not None:
        return ()
    found = _mode(axis, sub) + _interpolation(axis, sub, period_ns) + _ramps(axis)
    return found + (axis.homing.downloads(axis.units, axis.index(0)) if axis.homing else ())


def _mode(axis: Axis, sub: SubDevice) -> tuple[tuple[int, int, bytes], ...]:
    """Return 0x6060 with the first mode; empty if the drive lacks it or is in this mode."""
    index = axis.index(Object.MODE_OF_OPERATION)
    try:
        found = sub.sdo.read(index, 0, type=SINT)
    except SdoAbort as abort:
        if abort.code not in OBJECT_MISSING:
            raise
        return ()
    if found == int(axis.modes[0]):
        return ()
    return ((index, 0, SINT.encode(int(axis.modes[0]))),)


def _ramps(axis: Axis) -> tuple[tuple[int, int, bytes], ...]:
    """Return 0x6083 and 0x6084 of the profile modes, if the application limits them."""
    if not axis.uses_profile:
        return ()
    ramps = (
        (Object.PROFILE_ACCELERATION, axis.options.acceleration_limit),
        (Object.PROFILE_DECELERATION, axis.options.deceleration_limit),
    )
    scale = abs(axis.units.velocity_scale)
    return tuple(
        (axis.index(index), 0, UDINT.encode(max(1, round(value / scale))))
        for index, value in ramps
        if value is not None
    )


def _interpolation(
    axis: Axis, sub: SubDevice, period_ns: int
) -> tuple[tuple[int, int, bytes], ...]:
    """Return 0x60C2 for a period; empty if the drive lacks it or already has this value."""
    index = axis.index(Object.INTERPOLATION_TIME_PERIOD)
    try:
        found = (sub.sdo.read(index, 1, type=USINT), sub.sdo.read(index, 2, type=SINT))
    except SdoAbort as abort:
        if abort.code not in OBJECT_MISSING:
            raise
        return ()
    needed = interpolation_time(period_ns)
    if needed is None:
        raise ConfigurationError(
            f"{axis.name}: 0x{index:04X} cannot represent a period of {period_ns / 1e3:g} us "
            "(1 to 255 times a power of ten)",
            hint="choose a period such as 1 ms, 500 us, 250 us or 125 us",
        )
    if found == needed:
        return ()
    value, exponent = needed
    return (
        (index, 1, value.to_bytes(1, "little")),
        (index, 2, exponent.to_bytes(1, "little", signed=True)),
    )
