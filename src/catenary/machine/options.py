"""Options of `Loop`, `Drives` and `ProcessData` from the tables of a machine file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any, TypeVar

from msgspec import UNSET

from catenary.bus import SubDevice
from catenary.drive import DistributedClock, HomingMethod, TouchProbe
from catenary.drive.arguments import axis_modes, force_and_torque
from catenary.drive.limits import LimitOptions
from catenary.drive.units import AxisUnits
from catenary.loop.options import ClockOptions, Scheduling, StopPolicy
from catenary.machine.channels import make_columns
from catenary.machine.file import MachineFile
from catenary.machine.references import WHOLE_LISTS, axis_addresses, pdo_index
from catenary.machine.schema import (
    ClockTable,
    DrivesTable,
    HomingTable,
    Optional,
    TouchProbeTable,
)
from catenary.plan.options import period_in_ns
from catenary.toml_lines import KeyPath

T = TypeVar("T")


def loop_options(file: MachineFile, reference: SubDevice | None = None) -> dict[str, Any]:
    """Return the options of `Loop` from [loop] and [clocks].

    Args:
        file: the machine file.
        reference: device of `clocks.reference`; None if the file gives none, or if the devices are
            not known yet.

    Raises:
        MachineFileError: A value is out of range.
    """
    tables, path = file.tables, ("loop",)
    options = file.values(tables.loop, path)
    if "period" in options:
        with file.located((*path, "period")):
            period_in_ns(options["period"])
    stop = file.values(tables.loop.stop, (*path, "stop"))
    scheduling = file.values(tables.loop.scheduling, (*path, "scheduling"))
    clocks = file.values(tables.clocks, ("clocks",)) | {"reference": reference}
    options["stop"] = _made(file, StopPolicy, stop, (*path, "stop"))
    options["scheduling"] = _made(file, Scheduling, scheduling, (*path, "scheduling"))
    options["clocks"] = _made(file, ClockOptions, clocks, ("clocks",))
    return options


def drives_options(file: MachineFile, role: str) -> dict[str, Any]:
    """Return the options of `Drives` from [drives.ROLE], without its axes.

    Args:
        file: the machine file.
        role: name of the drives.

    Raises:
        MachineFileError: A value is not valid, a required option is missing, or the devices have
            different values of `op_mode`.
    """
    path: KeyPath = ("drives", role)
    table = file.tables.drives[role]
    linear = table.metres_per_turn is not UNSET
    options = file.values(table, path, linear=linear)
    del options["axes"]
    if "columns" in options:
        options["columns"] = make_columns(file, (*path, "columns"), options["columns"])
    if isinstance(options.get("touch_probe"), TouchProbeTable):
        given = file.values(options["touch_probe"], (*path, "touch_probe"))
        options["touch_probe"] = _made(file, TouchProbe, given, (*path, "touch_probe"))
    if "homing" in options:
        options["homing"] = _homing(file, options["homing"], (*path, "homing"), linear)
    if "pdos" in options and isinstance(options["pdos"], dict):
        options["pdos"] = {
            pdo_index(file, (*path, "pdos", pdo), pdo): entries
            for pdo, entries in options["pdos"].items()
        }
    options.pop("clock", None)
    options["dc"] = _clock_of_axes(file, role)
    _check_ranges(file, table, options, path)
    return options


def process_data_options(file: MachineFile, role: str) -> dict[str, Any]:
    """Return the options of `ProcessData` from [process_data.ROLE], without its channels.

    Args:
        file: the machine file.
        role: name of the process data.

    Raises:
        MachineFileError: The clock or the index of a PDO is not valid.
    """
    path: KeyPath = ("process_data", role)
    table = file.tables.process_data[role]
    options: dict[str, Any] = {"dc": _clock(file, table.clock, table.device, (*path, "clock"))}
    for name in ("required", "divider"):
        if getattr(table, name) is not UNSET:
            options[name] = getattr(table, name)
    if table.safe:
        options["safe"] = dict(table.safe)
    if isinstance(table.pdos, list):
        options["pdos"] = table.pdos
    elif table.pdos:
        options["pdos"] = {
            pdo_index(file, (*path, "pdos", pdo), pdo): names for pdo, names in table.pdos.items()
        }
    return options


def _clock(
    file: MachineFile, given: Optional[bool | ClockTable], device: str, path: KeyPath
) -> DistributedClock | bool:
    """Return the option `dc` of a request: `clock` of the role, or else `op_mode` of the device."""
    if isinstance(given, bool):
        return given
    if isinstance(given, ClockTable):
        return _made(file, DistributedClock, file.values(given, path), path)
    [own] = [each for each in file.tables.device if each.name == device]
    return False if own.op_mode is UNSET else DistributedClock(op_mode=own.op_mode)


def _clock_of_axes(file: MachineFile, role: str) -> DistributedClock | bool:
    path: KeyPath = ("drives", role)
    table = file.tables.drives[role]
    devices = dict.fromkeys(axis.device for axis in axis_addresses(file, role))
    clocks = [_clock(file, table.clock, device, (*path, "clock")) for device in devices]
    if any(clock != clocks[0] for clock in clocks):
        raise file.error(
            path,
            "the devices of these drives have different values of op_mode",
            hint='write clock = { op_mode = "..." } here, for all of these devices',
        )
    return clocks[0]


def _homing(
    file: MachineFile, given: HomingTable | Sequence[HomingTable], path: KeyPath, linear: bool
) -> HomingMethod | list[HomingMethod]:
    if isinstance(given, HomingTable):
        return _made(file, HomingMethod, file.values(given, path, linear=linear), path)
    return [
        _made(file, HomingMethod, file.values(each, (*path, i), linear=linear), (*path, i))
        for i, each in enumerate(given)
    ]


def _made(file: MachineFile, kind: type[T], values: dict[str, Any], path: KeyPath) -> T:
    """Make an options object. Its ValueError becomes an error with the line of the option."""
    with file.located(path, values):
        return kind(**values)


def _check_ranges(
    file: MachineFile, table: DrivesTable, options: dict[str, Any], path: KeyPath
) -> None:
    """Run the checks of `Drives` for each axis, before the segment is opened."""
    for number, name in enumerate(table.axes):
        own = {
            key: value[number] if isinstance(value, list) and key not in WHOLE_LISTS else value
            for key, value in options.items()
        }
        with file.located(path, options):
            modes = axis_modes(own.get("mode", "csp"), own.get("other_modes", ()))
            units = AxisUnits(**_of(AxisUnits, own))
            [own["torque_limit"]] = force_and_torque(
                (own.get("force_limit"),), (own.get("torque_limit"),), (units.metres_per_turn,)
            )
            LimitOptions(**_of(LimitOptions, own)).check(name, modes, units.names)


def _of(kind: type[AxisUnits] | type[LimitOptions], options: dict[str, Any]) -> dict[str, Any]:
    """Return the options that are fields of a class."""
    names = {field.name for field in fields(kind)}
    return {name: value for name, value in options.items() if name in names}
