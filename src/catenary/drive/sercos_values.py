"""SERCOS drives as axes: IDNs for the objects of CiA 402, and scales. IEC 61800-7-204.

Positions keep the direction that the drive reports (S-0-0051). Velocities and torques with another
polarity (S-0-0043, S-0-0055, S-0-0085) are inverted, so that all values of an axis agree.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from catenary.drive import objects
from catenary.drive.objects import NAMED_COLUMNS, AxisObject, Unit
from catenary.drive.units import AxisUnits
from catenary.errors import ConfigurationError
from catenary.model.sercos_axis import CONTROL_WORD, STATUS_WORD, Scaling, SercosAxis
from catenary.wire.cia402 import Mode

IDNS: Mapping[AxisObject, int] = {
    objects.CONTROLWORD: CONTROL_WORD,
    objects.STATUSWORD: STATUS_WORD,
    objects.TARGET_VELOCITY: 36,
    objects.VELOCITY_OFFSET: 37,
    objects.ACTUAL_VELOCITY: 40,
    objects.TARGET_POSITION: 47,
    objects.ACTUAL_POSITION: 51,
    objects.TARGET_TORQUE: 80,
    NAMED_COLUMNS["torque_offset"]: 81,
    objects.ACTUAL_TORQUE: 84,
    NAMED_COLUMNS["following_error"]: 189,
}
POLARITY_BITS = {36: 0, 37: 1, 40: 2, 47: 0, 51: 2, 80: 0, 81: 1, 84: 2}
OPERATION_MODES = {  # S-0-0032: without bit 3, value to write
    Mode.CSP: (3, 0x000B),  # position control, encoder of the motor, without following distance
    Mode.CSV: (2, 0x0002),
    Mode.CST: (1, 0x0001),
}
METHOD, PARAMETER, OTHER_UNIT, SECONDS, LOAD, MODULO = 0x07, 0x08, 0x10, 0x20, 0x40, 0x80
NONE, ROTARY = 0, 2  # bits 0 to 2 of a scaling type
PREFERRED_COUNTS = 3_600_000  # per turn: 0.0001 degrees
TOLERANCE = 1e-6


def idn_of(wanted: AxisObject) -> int | None:
    """Return the IDN for an object of CiA 402; None if a SERCOS drive has none."""
    return IDNS.get(wanted)


def sign(drive: SercosAxis, number: int) -> int:
    """Return -1 if a value has another polarity than the position S-0-0051, otherwise 1."""
    reference = _polarity(drive.position, POLARITY_BITS[51])
    own = {Unit.VELOCITY: drive.velocity, Unit.TORQUE: drive.torque}
    unit = next((each.unit for each, idn in IDNS.items() if idn == number), Unit.RAW)
    if number not in POLARITY_BITS:
        return 1
    scaling = own.get(unit, drive.position)
    return 1 if _polarity(scaling, POLARITY_BITS[number]) == reference else -1


def _polarity(scaling: Scaling, bit: int) -> int:
    return (scaling.polarity or 0) >> bit & 1


def sercos_units(name: str, units: AxisUnits, drive: SercosAxis) -> AxisUnits:
    """Return the units of an axis with the scaling of its drive.

    `velocity_unit` remains None if the drive does not state its scaling, and `rated_torque` if the
    drive scales torques in percent and the application does not give it.

    Args:
        name: Name of the axis, for messages.
        units: Units from the application.
        drive: The drive.

    Raises:
        ConfigurationError: A scaling contradicts the options, or refers to the load or a line.
    """
    _check_position(name, units, drive)
    velocity = _velocity_unit(name, drive.velocity)
    given = units.velocity_unit
    if None not in (velocity, given) and not math.isclose(velocity, given, rel_tol=1e-3):  # type: ignore[arg-type]
        raise ConfigurationError(
            f"{name}: velocity_unit={given:g} rad/s, but S-0-0044 to S-0-0046 specify {velocity:g}",
            hint="omit velocity_unit=: the drive states its scaling",
        )
    torque = _torque_unit(name, drive.torque)
    return replace(
        units,
        velocity_unit=given if velocity is None else velocity,
        rated_torque=units.rated_torque if torque is None else 1000 * torque,
    )


def _check_position(name: str, units: AxisUnits, drive: SercosAxis) -> None:
    scaling = drive.position
    kind = _method(name, "S-0-0076", scaling)
    if (scaling.type or 0) & MODULO:
        raise ConfigurationError(
            f"{name}: its positions are modulo values (S-0-0076 bit 7)",
            hint="clear the bit: an axis needs absolute positions",
        )
    if kind == NONE:
        return
    parameters = (scaling.type or 0) & PARAMETER
    counts = scaling.resolution if parameters else PREFERRED_COUNTS
    if counts is not None and not math.isclose(counts, units.counts_per_turn, rel_tol=TOLERANCE):
        source = "S-0-0079" if parameters else "the preferred scaling (S-0-0076)"
        raise ConfigurationError(
            f"{name}: counts_per_turn={units.counts_per_turn:g}, but {source} is {counts}",
            hint=f"give counts_per_turn={counts}, or change the scaling of the drive",
        )


def _velocity_unit(name: str, scaling: Scaling) -> float | None:
    """Return the value of one velocity count [rad/s of the motor]; None if it is unknown."""
    if _method(name, "S-0-0044", scaling) == NONE:
        return None
    kind = scaling.type or 0
    weight = _weight(scaling) if kind & PARAMETER else 1e-6 if kind & SECONDS else 1e-4
    if weight is None:
        return None
    return weight * 2 * math.pi / (1 if kind & SECONDS else 60)


def _torque_unit(name: str, scaling: Scaling) -> float | None:
    """Return the value of one torque count [N·m]; None if it is 0.1 % of the rated torque."""
    if _method(name, "S-0-0086", scaling) == NONE:
        return None
    kind = scaling.type or 0
    if kind & OTHER_UNIT:
        raise ConfigurationError(
            f"{name}: its torques are in in·lbf (S-0-0086 bit 4)", hint="select N·m or percent"
        )
    return _weight(scaling) if kind & PARAMETER else 0.01


def _weight(scaling: Scaling) -> float | None:
    if not scaling.factor or scaling.exponent is None:
        return None
    return scaling.factor * 10.0**scaling.exponent


def _method(name: str, idn: str, scaling: Scaling) -> int:
    """Return bits 0 to 2 of a scaling type. Raise ConfigurationError if it is not of a motor."""
    kind = scaling.type or 0
    if kind & METHOD not in (NONE, ROTARY):
        raise ConfigurationError(
            f"{name}: {idn} is 0x{kind:04X}, a linear scaling",
            hint="select a rotary scaling of the motor shaft; metres_per_turn= makes a linear axis",
        )
    if kind & METHOD and kind & LOAD:
        raise ConfigurationError(
            f"{name}: {idn} is 0x{kind:04X}, a scaling that refers to the load (bit 6)",
            hint="select the motor shaft; gear_ratio= converts to the joint",
        )
    return kind & METHOD
