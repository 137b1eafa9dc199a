"""Checks of the arguments of `Drives(...)`, before anything is sent."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from typing import TypeAlias

from catenary.bus import SubDevice
from catenary.drive.axis import MEASURED, Axis
from catenary.drive.channel import Channel, ChannelSpec, make_channel
from catenary.drive.modules import Modules, chosen_modules, described
from catenary.drive.objects import NAMED_COLUMNS, WRITTEN_OBJECTS, AxisObject
from catenary.model.device import DeviceDescription, mapped_entries
from catenary.plan.cycle import NumberKind
from catenary.plan.named_pdos import pdos_named
from catenary.plan.request import DistributedClock, ObjectReference, WrittenPdo
from catenary.plan.start_up_object import StartUp
from catenary.wire.cia402 import Mode

AxisSource: TypeAlias = SubDevice | tuple[SubDevice, int]
PdoEntry: TypeAlias = tuple[int, int, int] | str  # (index, subindex, bits), or a channel name
PdoName: TypeAlias = int | str | WrittenPdo  # number, or name of a PDO or a mapping
PdoList: TypeAlias = str | Sequence[PdoName] | Mapping[PdoName, Sequence[PdoEntry]]
ColumnSpec: TypeAlias = ChannelSpec | AxisObject
Columns: TypeAlias = Sequence[str | tuple[str, ColumnSpec]] | Mapping[str, ColumnSpec]

STATUSWORD = 0x6041
DIVIDER_MAX = 10_000  # cycles; use SDO for slower exchanges
MODES: dict[str, Mode] = {
    **{"csp": Mode.CSP, "csv": Mode.CSV, "cst": Mode.CST},
    **{"pp": Mode.PP, "pv": Mode.PV},  # the drive computes the trajectory
    "hm": Mode.HM,  # homing by `Drives.home`; this mode has no target
}


def axis_sources(
    subs: Iterable[AxisSource], modules: Modules | None = None
) -> list[tuple[SubDevice, int]]:
    """Return (SubDevice, slot) of every axis. A SubDevice without a slot means all of its slots.

    Args:
        subs: the devices or axes.
        modules: modules in the slots of each device; None: as scanned.

    Raises:
        TypeError: `subs` is not iterable, or an element is neither a SubDevice nor a tuple.
        ValueError: The list is empty, an axis is given twice, or a device is not a drive.
    """
    if not isinstance(subs, Iterable):
        raise TypeError(f"Drives takes a list of SubDevices, such as subs.drives; not {subs!r}")
    sources: list[tuple[SubDevice, int]] = []
    for source in subs:
        if not isinstance(source, tuple) and not hasattr(source, "slots"):
            raise TypeError(f"an axis is a SubDevice or (SubDevice, slot), not {source!r}")
        if isinstance(source, tuple):
            sources.append(source)
        else:
            slots = described(source, chosen_modules(source, modules)).slots if modules else ()
            slots = slots or source.slots or _sercos_drives(source) or (0,)
            sources.extend((source, slot) for slot in slots)
        check_drive(sources[-1][0])
    if not sources:
        raise ValueError("no axes: the list of SubDevices is empty")
    places = [(sub.position, slot) for sub, slot in sources]
    for place in places:
        if places.count(place) > 1:
            raise ValueError(f"device {place[0]}, slot {place[1]} is given twice")
    return sources


def check_drive(sub: SubDevice) -> None:
    """Raise ValueError if a device has neither an object dictionary nor a mapped statusword.

    A drive that does not state its profile in 0x1000 is accepted.
    """
    if sub.is_drive or sub.description.coe or sub.description.sercos_axes:
        return
    assignments = (*sub.description.inputs, *sub.description.outputs)
    if not any(entry.index == STATUSWORD for entry in mapped_entries(assignments)):
        raise ValueError(
            f"{sub.station} is not a drive: it has neither CiA 402 objects nor SERCOS drives; use "
            "Inputs or Outputs for its process data; main.subs.drives are the drives"
        )


def _sercos_drives(sub: SubDevice) -> tuple[int, ...]:
    """Return the numbers of the SERCOS drives of a device."""
    return tuple(each.drive for each in sub.description.sercos_axes)


def axis_name(sub: SubDevice, slot: int) -> str:
    """Return the default name of an axis."""
    return f"{sub.position} {sub.name}" + (f" slot {slot}" if slot else "")


def axis_names(
    sources: Sequence[tuple[SubDevice, int]], names: Sequence[str] | None
) -> tuple[str, ...]:
    """Return the names of the axes.

    Args:
        sources: SubDevice and slot of each axis.
        names: names from the application; None for the default names.

    Raises:
        ValueError: `names` is a string, their number is wrong, or a name is used twice.
    """
    if names is None:
        return tuple(axis_name(sub, slot) for sub, slot in sources)
    if isinstance(names, str) or len(names) != len(sources):
        raise ValueError(f"names={names!r}: give a list of {len(sources)} names, one per axis")
    if len(set(names)) < len(names):
        raise ValueError(f"names={list(names)}: every axis needs its own name")
    return tuple(names)


def axis_modes(first: str, others: Sequence[str]) -> tuple[Mode, ...]:
    """Return the modes of an axis without duplicates, starting with `first`.

    Raises:
        ValueError: A mode is unknown.
    """
    return tuple(dict.fromkeys(mode_of(name) for name in (first, *others)))


def warn_of_default_velocity(axes: Sequence[Axis]) -> None:
    """Warn of axes in CSP or PP without a velocity limit, once for each kind of axis."""
    lacking = [axis for axis in axes if axis.options.lacks_velocity(axis.modes)]
    for units in dict.fromkeys(axis.units.names for axis in lacking):
        alike = [axis for axis in lacking if axis.units.names == units]
        names = ", ".join(axis.name for axis in alike)
        default = alike[0].units.defaults.velocity_limit
        warnings.warn(
            f"no velocity_limit for {names}: the default of {default:.3g} {units.velocity} at the "
            f"joint is used; write Drives(velocity_limit=...) [{units.velocity}]",
            UserWarning,
            stacklevel=3,
        )


def clock_request(dc: DistributedClock | bool) -> DistributedClock | None:
    """Return the clock request of the option `dc`; None if it is False."""
    if isinstance(dc, bool):
        return DistributedClock() if dc else None
    return dc


def written_pdos(
    pdos: PdoList,
    named: Mapping[str, Channel] | Mapping[str, AxisObject],
    device: DeviceDescription,
) -> tuple[WrittenPdo, ...]:
    """Return the PDOs of the option `pdos`, with their entries if they are given.

    Args:
        pdos: value of the option.
        named: objects that the entries may refer to by name.
        device: device with the names of its PDOs and mappings.

    Raises:
        TypeError: The option is neither a list of numbers and names nor a mapping of these to
            entries.
        ValueError: An index is not that of a PDO, or the name of an entry is unknown.
        MappingError: The name of a PDO is unknown or ambiguous.
    """
    pdos = [pdos] if isinstance(pdos, str) else pdos
    if not isinstance(pdos, Iterable) or not all(map(_is_pdo, pdos)):
        raise TypeError(
            f"pdos={pdos!r}: give PDO numbers, [0x1A00], names, ['Inputs'], or PDOs with entries, "
            "{0x1A00: entries}"
        )
    found: list[WrittenPdo] = []
    for each in pdos:
        chosen = pdos_named(device, each) if isinstance(each, str) else (_numbered(each),)
        if isinstance(pdos, Mapping) and pdos[each]:
            entries = tuple(_written_entry(each, entry, named) for entry in pdos[each])
            chosen = tuple(replace(pdo, entries=entries) for pdo in chosen)
        found += [pdo for pdo in chosen if pdo not in found]
    return tuple(found)


def _is_pdo(given: object) -> bool:
    """Return True for a number, a name or a WrittenPdo; a number in quotes is not valid."""
    if isinstance(given, WrittenPdo):
        return True
    return isinstance(given, int) or (isinstance(given, str) and not given.startswith("0x"))


def _numbered(index: int | WrittenPdo) -> WrittenPdo:
    if isinstance(index, WrittenPdo):
        return index
    if not 0x1600 <= index < 0x1C00:
        raise ValueError(
            f"pdos: 0x{index:04X} is not a PDO; use 0x1600 to 0x19FF for outputs and 0x1A00 to "
            "0x1BFF for inputs"
        )
    return WrittenPdo(index)


def _written_entry(
    pdo: PdoName, entry: PdoEntry, named: Mapping[str, Channel] | Mapping[str, AxisObject]
) -> ObjectReference:
    if not isinstance(entry, str):
        return ObjectReference(*entry)
    if entry not in named:
        near = get_close_matches(entry, named, n=1)
        guess = f"; did you mean {near[0]!r}?" if near else ""
        known = f"known names are {', '.join(named)}" if named else "this request has no names"
        place = f"0x{pdo:04X}" if isinstance(pdo, int) else repr(pdo)
        raise ValueError(f"pdos: unknown name {entry!r} in {place}; {known}{guess}")
    found = named[entry]
    return ObjectReference(found.index, found.subindex, found.bit_length)


def start_up_list(objects: Sequence[StartUp]) -> tuple[StartUp, ...]:
    """Return the start-up objects of the option `start_up`.

    Raises:
        TypeError: The option is not a list of StartUp objects.
    """
    if isinstance(objects, StartUp) or not all(isinstance(each, StartUp) for each in objects):
        raise TypeError(f"start_up={objects!r}: give a list, [StartUp(index, subindex, value)]")
    return tuple(objects)


def mode_of(name: str) -> Mode:
    """Return the mode of a name such as "csp". Raises ValueError if the name is unknown."""
    try:
        return MODES[name.lower()]
    except KeyError:
        raise ValueError(f"unknown mode {name!r}; known modes are {', '.join(MODES)}") from None


def cycles_between(name: str, divider: int) -> int:
    """Return a divider after a check of its range.

    Args:
        name: name of the option, for the message.
        divider: number of cycles.

    Raises:
        ValueError: The divider is not a whole number in the valid range.
    """
    if not isinstance(divider, int) or not 1 <= divider <= DIVIDER_MAX:
        raise ValueError(
            f"{name}={divider!r} must be a whole number of cycles from 1 to {DIVIDER_MAX}"
        )
    return divider


def known(measured: Sequence[str]) -> tuple[str, ...]:
    """Return the names of measured quantities. Raises ValueError if one is unknown."""
    for name in measured:
        if name not in MEASURED:
            raise ValueError(
                f"measured: unknown quantity {name!r}; known quantities are {', '.join(MEASURED)}"
            )
    return tuple(measured)


def named_columns(columns: Columns) -> dict[str, AxisObject]:
    """Return the objects of the option `columns` by name.

    Raises:
        TypeError: An object is neither a Channel nor (index, subindex, type[, scale]), or its type
            is not numeric.
        ValueError: A column without an object has an unknown name, or a number is out of range.
    """
    named: dict[str, AxisObject] = {}
    for column in columns.items() if isinstance(columns, Mapping) else columns:
        if not isinstance(column, str):
            name, spec = column
            named[name] = _axis_object(name, spec)
        elif column in NAMED_COLUMNS:
            named[column] = NAMED_COLUMNS[column]
        else:
            raise ValueError(
                f"columns: unknown name {column!r}; known names are {', '.join(NAMED_COLUMNS)}"
            )
    return named


def force_and_torque(
    forces: Sequence[float | None],
    torques: Sequence[float | None],
    metres_per_turn: Sequence[float | None],
) -> tuple[float | None, ...]:
    """Return one limit per axis: a force [N] if it is linear, a torque [N·m] if it is rotary.

    A limit that is not given is None.

    Args:
        forces: option `force_limit` of each axis.
        torques: option `torque_limit` of each axis.
        metres_per_turn: option `metres_per_turn` of each axis; None for a rotary axis.

    Raises:
        ValueError: A rotary axis has a force limit, or a linear axis has a torque limit.
    """
    chosen: list[float | None] = []
    for axis, (force, torque, metres) in enumerate(
        zip(forces, torques, metres_per_turn, strict=True)
    ):
        if metres is None and force is not None:
            raise ValueError(
                f"force_limit is given for axis {axis}, which is rotary; use torque_limit= [N·m], "
                "or give metres_per_turn= for a linear axis"
            )
        if metres is not None and torque is not None:
            raise ValueError(
                f"torque_limit is given for axis {axis}, which is linear; use force_limit= [N]"
            )
        chosen.append(torque if metres is None else force)
    return tuple(chosen)


def _axis_object(name: str, spec: ColumnSpec) -> AxisObject:
    """Return the object of a column.

    The object of a Channel is an output if CiA 402 or the Channel defines it as one.
    """
    if isinstance(spec, AxisObject):
        return spec
    channel = make_channel("columns", name, spec)
    return AxisObject(
        channel.index,
        channel.subindex,
        channel.bit_length,
        signed=channel.kind is NumberKind.SIGNED,
        output=channel.output or (channel.index, channel.subindex) in WRITTEN_OBJECTS,
        real=channel.kind is NumberKind.REAL,
        scale=channel.scale,
    )
