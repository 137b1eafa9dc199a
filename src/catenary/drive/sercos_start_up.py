"""SERCOS drives as axes, before the loop: check of the options, and settings read through SoE.

The start-up writes the telegrams, the operation mode and the cycle times that differ.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from catenary.drive.axis import Axis
from catenary.drive.sercos_settings import SercosSettings
from catenary.drive.sercos_values import IDNS, OPERATION_MODES, sercos_units
from catenary.errors import ConfigurationError, SoeError
from catenary.model.esi_settings import IdnCommand
from catenary.model.sercos_axis import CONTROL_WORD, STATUS_WORD, SercosAxis
from catenary.wire.cia402 import Mode
from catenary.wire.sercos import idn_text

if TYPE_CHECKING:
    from catenary.bus import SubDevice

OUTPUTS = {number for each, number in IDNS.items() if each.output}
CYCLE_TIMES = {1: "control unit cycle time", 2: "SERCOS cycle time"}  # [us]
CYCLE_TIME_MAX = 0xFFFF  # [us]
EXTERNAL_ENCODERS = (4, 5)  # lowest bits of S-0-0032: the second encoder alone, or both
WITHOUT_LAG = 0x0008  # bit 3 of S-0-0032; both values suit an axis
LIMITS = {38, 39, 82, 83, 91, 92}  # limits of velocity and torque: 0 would remove the torque
NO_IDN = 0x1001  # error code of SoE
IN_AT, IN_MDT = 187, 188  # lists of the IDNs that a telegram may contain


def check_options(axis: Axis) -> None:
    """Check the options of an axis of a SERCOS drive.

    Raises:
        ConfigurationError: An option needs CiA 402.
    """
    refused = {
        "other_modes=": len(axis.modes) > 1,
        f"mode={axis.modes[0].name.lower()!r}": axis.modes[0] not in OPERATION_MODES,
        "on_loss='csp_hold'": axis.holds_on_loss,
        "homing=": axis.homing is not None,
        "touch_probe=": bool(axis.optional_columns),
        "pdos=": bool(axis.pdos),
        "start_up=": bool(axis.objects),
        "modules=": bool(axis.modules),
    }
    for option in (option for option, is_given in refused.items() if is_given):
        raise ConfigurationError(
            f"{axis.name}: {option} needs CiA 402, and this is a SERCOS drive",
            hint="a SERCOS drive has one of the modes 'csp', 'csv' and 'cst'",
        )
    for name, column in axis.columns.items():
        if column not in IDNS:
            raise ConfigurationError(
                f"{axis.name}: a SERCOS drive has no column {name!r}",
                hint="its columns are velocity_offset, torque_offset and following_error; use "
                "ProcessData for other IDNs",
            )


def with_sercos(
    axes: Sequence[Axis], subs: Sequence[SubDevice], period_ns: int
) -> tuple[Axis, ...]:
    """Read the SERCOS drives, and return all axes with the settings of these drives.

    Args:
        axes: The axes, of any profile.
        subs: Device of each axis.
        period_ns: Period of the loop [ns].

    Raises:
        ConfigurationError: An option needs CiA 402, the scaling of a drive contradicts an option,
            or a drive cannot exchange a value that its axis needs.
        SoeError: A drive refuses to report the attribute of a value.
    """
    pairs = list(zip(axes, subs, strict=True))
    with_soe = {sub.position: sub for sub in subs if sub.description.sercos_axes}
    telegrams = {
        position: _telegrams(sub, [axis for axis, _ in pairs if axis.device == position])
        for position, sub in with_soe.items()
    }
    return tuple(
        _with_settings(axis, sub, telegrams[sub.position], period_ns)
        if sub.position in with_soe
        else axis
        for axis, sub in pairs
    )


def _drive_of(axis: Axis, drives: Iterable[SercosAxis]) -> SercosAxis:
    for each in drives:
        if each.drive == axis.slot:
            return each
    raise ConfigurationError(
        f"{axis.name}: its device has no SERCOS drive {axis.slot}", hint="see `catenary scan`"
    )


def _telegrams(sub: SubDevice, axes: Sequence[Axis]) -> tuple[SercosAxis, ...]:
    """Return all drives of a device with the telegrams that the axes need."""
    wanted: dict[int, tuple[list[int], list[int]]] = {}
    present = sub.description.sercos_axes
    for axis in axes:
        check_options(axis)
        drive = _drive_of(axis, present)
        mdt = [each.number for each in drive.outputs[1:]]
        at = [each.number for each in drive.inputs[1:]]
        _check_limits(axis, LIMITS.intersection(mdt))
        required, optional = _needed(axis)
        if required <= {*mdt, *at}:
            continue
        offered = _offered(sub, axis.slot)
        for numbers, names in ((mdt, offered[0]), (at, offered[1])):
            numbers += [n for n in (*required, *optional) if n in names and n not in numbers]
        missing = required - {*mdt, *at}
        if missing:
            raise ConfigurationError(
                f"{axis.name}: its telegrams cannot contain "
                f"{', '.join(map(idn_text, sorted(missing)))}, which mode "
                f"{axis.modes[0].name} needs",
                hint="S-0-0187 and S-0-0188 list the values that it can exchange",
            )
        wanted[axis.slot] = mdt, at
    return sub.soe.planned_telegrams(wanted) if wanted else present


def _check_limits(axis: Axis, limits: set[int]) -> None:
    """Raise ConfigurationError if the telegrams of an axis contain limits."""
    if limits:
        raise ConfigurationError(
            f"{axis.name}: its MDT contains {', '.join(map(idn_text, sorted(limits)))}, a limit "
            "that an axis does not write; it would be 0, without torque or motion",
            hint="omit it in soe.configure_telegrams(mdt=...), and write the limit with soe.write",
        )


def _needed(axis: Axis) -> tuple[set[int], list[int]]:
    """Return the IDNs that the telegrams must contain, and those that they may contain."""
    required, optional = axis.sercos_values()
    numbers = {IDNS[each] for each in required}
    return numbers - {CONTROL_WORD, STATUS_WORD}, [IDNS[each] for each in optional]


def _offered(sub: SubDevice, drive: int) -> tuple[set[int], set[int]]:
    """Return the IDNs that MDT and AT may contain, from S-0-0188 and S-0-0187."""
    lists: list[set[int]] = []
    for number in (IN_MDT, IN_AT):
        data = _bytes(sub, number, drive)
        idns = data[4:]  # after the lengths of the list
        lists.append({int.from_bytes(idns[k : k + 2], "little") for k in range(0, len(idns), 2)})
        if not data:
            lists[-1] = set(IDNS.values())  # it has no list: it refuses a wrong telegram
    return lists[0] & OUTPUTS, lists[1] - OUTPUTS


def _with_settings(
    axis: Axis, sub: SubDevice, telegrams: tuple[SercosAxis, ...], period_ns: int
) -> Axis:
    drive = _drive_of(axis, telegrams)
    settings = SercosSettings(
        drive,
        telegrams if telegrams != sub.description.sercos_axes else (),
        (*_mode(axis, sub), *_cycle_times(axis, sub, period_ns * axis.divider)),
        position_max=_number(sub, axis, 49, signed=True),
        position_min=_number(sub, axis, 50, signed=True),
        velocity=_number(sub, axis, 91),
        torque=_number(sub, axis, 92),
    )
    units = sercos_units(axis.name, axis.units, drive)
    found = replace(axis, units=units, sercos=settings)
    _check_scales(found)
    _ = found.bounds  # an error must be raised before anything is written
    return found


def _check_scales(axis: Axis) -> None:
    """Raise ConfigurationError if the scale of a value that the axis needs is unknown."""
    velocities = axis.modes[0] is Mode.CSV or "velocity_offset" in axis.columns
    if axis.measured_required:
        velocities |= "velocity" in axis.measured
    if velocities and axis.units.velocity_unit is None:
        raise ConfigurationError(
            f"{axis.name}: the drive does not state the scaling of its velocities (S-0-0044)",
            hint="give Drives(velocity_unit=...) in rad/s of the motor",
        )
    if axis.needs_torque and axis.units.rated_torque is None:
        raise ConfigurationError(
            f"{axis.name}: its torques are in percent of its rated torque, which is unknown",
            hint="give Drives(rated_torque=...) in N·m, or omit torque from measured=",
        )


def _mode(axis: Axis, sub: SubDevice) -> tuple[IdnCommand, ...]:
    """Return the operation mode to write (S-0-0032); empty if the drive is in it.

    The other bits select motions of the drive itself, or telegrams that change (AX5000, bit 15).
    """
    low, value = OPERATION_MODES[axis.modes[0]]
    found = _number(sub, axis, 32)
    if found is not None and axis.modes[0] is Mode.CSP and found & 7 in EXTERNAL_ENCODERS:
        raise ConfigurationError(
            f"{axis.name}: S-0-0032 is 0x{found:04X}, position control with an external encoder",
            hint="an axis uses the encoder of the motor: write 0x000B to S-0-0032 if this is safe",
        )
    if found is not None and found & ~WITHOUT_LAG == low:
        return ()
    return (_command(axis, 32, value, "operation mode"),)


def _cycle_times(axis: Axis, sub: SubDevice, exchange_ns: int) -> tuple[IdnCommand, ...]:
    """Return the cycle times to write, S-0-0001 and S-0-0002."""
    microseconds, rest = divmod(exchange_ns, 1000)
    commands: list[IdnCommand] = []
    for number, name in CYCLE_TIMES.items():
        found = _number(sub, axis, number)
        if found is None or (found == microseconds and not rest):
            continue
        if rest or microseconds > CYCLE_TIME_MAX:
            raise ConfigurationError(
                f"{axis.name}: {idn_text(number)} cannot represent {exchange_ns / 1e3:g} us",
                hint=f"choose a period of whole microseconds, at most {CYCLE_TIME_MAX} us",
            )
        commands.append(_command(axis, number, microseconds, name))
    return tuple(commands)


def _command(axis: Axis, number: int, value: int, name: str) -> IdnCommand:
    data = value.to_bytes(2, "little")
    return IdnCommand(("PS",), number, data, axis.slot, comment=name, source=f"Drives, {axis.name}")


def _number(sub: SubDevice, axis: Axis, number: int, *, signed: bool = False) -> int | None:
    """Return the raw value of an IDN; None if the drive does not have it."""
    data = _bytes(sub, number, axis.slot)
    return int.from_bytes(data, "little", signed=signed) if data else None


def _bytes(sub: SubDevice, number: int, drive: int) -> bytes:
    """Return the value of an IDN; empty if the drive does not have it."""
    try:
        return sub.soe.read_bytes(number, drive=drive)
    except SoeError as error:
        if error.code != NO_IDN:
            raise
        return b""
