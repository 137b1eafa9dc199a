"""Reactions and limits in the object dictionary of a drive, read in PRE-OP.

These are objects of IEC 61800-7-201 / CiA 402-2: option codes 0x605A, 0x605C, 0x605E, 0x6007; quick
stop deceleration 0x6085; limits 0x607D (with 0x607C), 0x607F, 0x6080 and 0x6072.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeGuard

from catenary.drive.units import AxisUnits
from catenary.errors import DecodeError
from catenary.types import DINT, INT, UDINT, UINT, DataType
from catenary.wire.cia402 import SLOT_OFFSET, Object

if TYPE_CHECKING:
    from catenary.bus import SubDevice
    from catenary.bus.sub_device import DeviceOwner

MOTOR_SPEED_RANGE = (60, 200_000)  # [rpm] outside this range, 0x6080 probably has another unit
POSITION_EXTREMES = (-(2**31), 2**31 - 1)

ABORT_CONNECTION = {
    0: "no action",
    1: "fault",
    2: "disable voltage",
    3: "quick stop",
}
RAMPS = {
    1: "slow down on the slow down ramp",
    2: "slow down on the quick stop ramp",
    3: "slow down on the current limit",
    4: "slow down on the voltage limit",
}
FAULT_REACTION = {0: "disable the drive function, the motor coasts", **RAMPS}
DISABLE_OPERATION = {
    0: "disable the drive function, the motor coasts",
    1: "slow down on the slow down ramp, then disable the drive function",
}
QUICK_STOP = {
    0: "disable the drive function, the motor coasts",
    **{code: f"{ramp}, then SWITCH ON DISABLED" for code, ramp in RAMPS.items()},
    **{code + 4: f"{ramp}, stay in QUICK STOP ACTIVE" for code, ramp in RAMPS.items()},
}


@dataclass(frozen=True, slots=True)
class DriveSettings:
    """Raw values of one axis of a drive; None if an object is missing or cannot be read."""

    quick_stop: int | None = None  # 0x605A
    disable_operation: int | None = None  # 0x605C
    fault_reaction: int | None = None  # 0x605E
    abort_connection: int | None = None  # 0x6007
    quick_stop_deceleration: int | None = None  # 0x6085 [velocity counts per second]
    position_min: int | None = None  # 0x607D:01 [counts]
    position_max: int | None = None  # 0x607D:02 [counts]
    home_offset: int | None = None  # 0x607C [counts]
    max_profile_velocity: int | None = None  # 0x607F [velocity counts]
    max_motor_speed: int | None = None  # 0x6080 [rpm]
    max_torque: int | None = None  # 0x6072 [per mille of the rated torque]

    @property
    def brakes(self) -> bool:
        """True if a quick stop is known to decelerate the motor (0x605A is 1 to 8)."""
        return self.quick_stop is not None and 1 <= self.quick_stop <= 8

    def reactions(self) -> tuple[str, ...]:
        """Return one line of text for each option code."""
        return (
            _reaction("quick stop", Object.QUICK_STOP_OPTION, self.quick_stop, QUICK_STOP),
            _reaction(
                "disable operation",
                Object.DISABLE_OPERATION_OPTION,
                self.disable_operation,
                DISABLE_OPERATION,
            ),
            _reaction("fault", Object.FAULT_REACTION_OPTION, self.fault_reaction, FAULT_REACTION),
            _reaction(
                "watchdog expired",
                Object.ABORT_CONNECTION_OPTION,
                self.abort_connection,
                ABORT_CONNECTION,
            ),
        )


@dataclass(frozen=True, slots=True)
class OwnLimits:
    """Limits of the drive at the joint, in SI units; None without a plausible value."""

    position_min: float | None = None  # [rad]
    position_max: float | None = None  # [rad]
    velocity: float | None = None  # [rad/s]
    velocity_source: str = ""
    torque: float | None = None  # [N·m]
    deceleration: float | None = None  # [rad/s²]
    position_source: str = "0x607D of the drive"
    torque_source: str = "0x6072 of the drive"


OBJECTS: tuple[tuple[str, int, int, DataType[int]], ...] = (
    ("quick_stop", Object.QUICK_STOP_OPTION, 0, INT),
    ("disable_operation", Object.DISABLE_OPERATION_OPTION, 0, INT),
    ("fault_reaction", Object.FAULT_REACTION_OPTION, 0, INT),
    ("abort_connection", Object.ABORT_CONNECTION_OPTION, 0, INT),
    ("quick_stop_deceleration", Object.QUICK_STOP_DECELERATION, 0, UDINT),
    ("position_min", Object.SOFTWARE_POSITION_LIMIT, 1, DINT),
    ("position_max", Object.SOFTWARE_POSITION_LIMIT, 2, DINT),
    ("home_offset", Object.HOME_OFFSET, 0, DINT),
    ("max_profile_velocity", Object.MAX_PROFILE_VELOCITY, 0, UDINT),
    ("max_motor_speed", Object.MAX_MOTOR_SPEED, 0, UDINT),
    ("max_torque", Object.MAX_TORQUE, 0, UINT),
)


def read_settings(places: Sequence[tuple[SubDevice, int]]) -> list[DriveSettings]:
    """Read the settings of axes by SDO, from all devices in parallel.

    Args:
        places: SubDevice and slot of each axis.

    Returns:
        Settings of each axis. An object is None if the device refuses it, or if its size is wrong.
    """
    requests: dict[DeviceOwner, dict[int, list[tuple[int, int]]]] = {}
    for sub, slot in places:
        objects = [(index + SLOT_OFFSET * slot, subindex) for _, index, subindex, _ in OBJECTS]
        requests.setdefault(sub.main, {}).setdefault(sub.position, []).extend(objects)
    found = {main: main.read_objects(its) for main, its in requests.items()}
    return [_settings(found[sub.main][sub.position], SLOT_OFFSET * slot) for sub, slot in places]


def _settings(found: Mapping[tuple[int, int], bytes], base: int) -> DriveSettings:
    values: dict[str, int] = {}
    for name, index, subindex, kind in OBJECTS:
        data = found.get((index + base, subindex))
        if data is not None:
            with suppress(DecodeError):
                values[name] = kind.decode(data)
    return DriveSettings(**values)


def own_limits(
    settings: DriveSettings, units: AxisUnits, home_offset: int | None = None
) -> OwnLimits:
    """Convert the limits of the drive to SI units at the joint.

    Args:
        settings: raw values of the drive.
        units: units of the axis.
        home_offset: 0x607C that the start-up list writes [counts]; None if it does not write it.

    Returns:
        Limits with a known unit and a plausible value.
    """
    low, high = _position_limits(settings, units, home_offset)
    velocity, source = _velocity_limit(settings, units)
    torque = None
    if units.rated_torque is not None and _is_plausible(settings.max_torque, 16):
        torque = settings.max_torque * abs(units.torque_scale)
    deceleration = None
    if _is_plausible(settings.quick_stop_deceleration, 32):
        deceleration = settings.quick_stop_deceleration * abs(units.velocity_scale)
    return OwnLimits(low, high, velocity, source, torque, deceleration)


def _position_limits(
    settings: DriveSettings, units: AxisUnits, home_offset: int | None
) -> tuple[float | None, float | None]:
    """Return the limits of 0x607D minus the home offset 0x607C, at the joint [rad or m].

    A limit that is missing or not plausible is None. Source: IEC 61800-7-201, software position
    limit.
    """
    low, high = settings.position_min, settings.position_max
    if low is None or high is None or low >= high:
        return None, None
    offset = (settings.home_offset or 0) if home_offset is None else home_offset

    def joint(counts: int) -> float | None:
        if counts in POSITION_EXTREMES:
            return None
        return (counts - offset) * units.position_scale + units.offset

    ends = joint(low), joint(high)
    return ends if units.position_scale > 0 else (ends[1], ends[0])


def _velocity_limit(settings: DriveSettings, units: AxisUnits) -> tuple[float | None, str]:
    """Return the smaller of 0x6080 (rpm of the motor) and 0x607F at the joint, and its source.

    The limit is None if neither is plausible.

    0x607F has the velocity unit of the drive, so it is used only if `velocity_unit` is given.
    """
    found: list[tuple[float, str]] = []
    speed = settings.max_motor_speed
    if speed is not None and MOTOR_SPEED_RANGE[0] <= speed <= MOTOR_SPEED_RANGE[1]:
        found.append((speed * 2 * math.pi / 60 * units.per_motor_radian, "0x6080 of the drive"))
    profile = settings.max_profile_velocity
    if units.velocity_unit is not None and _is_plausible(profile, 32):
        found.append((profile * abs(units.velocity_scale), "0x607F of the drive"))
    return min(found, default=(None, ""))


def _is_plausible(raw: int | None, bits: int) -> TypeGuard[int]:
    """Return True if a raw limit is neither 0 nor the largest signed or unsigned number."""
    return raw is not None and raw not in (0, 2**bits - 1, 2 ** (bits - 1) - 1)


def _reaction(what: str, index: int, code: int | None, texts: dict[int, str]) -> str:
    if code is None:
        return f"{what}: unknown (0x{index:04X} cannot be read)"
    known = "manufacturer-specific" if code < 0 else texts.get(code, "reserved code")
    return f"{what}: {known} (0x{index:04X} = {code})"
