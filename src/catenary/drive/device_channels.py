"""Channels of devices: those that are mapped, and those that the application chooses."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from catenary.bus import SubDevice
from catenary.drive.channel import Channel, channel_of
from catenary.errors import MappingError
from catenary.model.device import Assignment, DeviceDescription, Direction, Entry, Pdo
from catenary.plan.cycle import Column
from catenary.plan.numbers import ANY, Which
from catenary.plan.op_mode import chosen_pdos
from catenary.plan.pdo_rewrite import write_down
from catenary.plan.pdo_search import pdo_names
from catenary.plan.request import DistributedClock, ImageLayout, WrittenPdo


class NamedChannel(NamedTuple):
    """Channel of one device, and its name."""

    name: str
    device: int  # position of the device
    channel: Channel
    which: Which = ANY  # selects one place if the device maps the object several times


def chosen_channels(sub: SubDevice, named: Mapping[str, Channel]) -> tuple[NamedChannel, ...]:
    """Return the channels that the application chose for a device.

    Args:
        sub: the device.
        named: channels by name.
    """
    return tuple(
        NamedChannel(name, sub.position, channel, Which(channel.pdo, channel.bit_length))
        for name, channel in named.items()
    )


def mapped_channels(
    devices: Iterable[DeviceDescription], direction: Direction, scale: Mapping[str, float]
) -> tuple[NamedChannel, ...]:
    """Return all mapped channels of some devices, with unique names.

    Args:
        devices: the devices.
        direction: direction of the process data.
        scale: factor of each channel by name; a channel without one has raw numbers.

    Raises:
        ValueError: No device is given, the devices have no channels, or a name is unknown.
    """
    devices = list(devices)
    if not devices:
        raise ValueError(
            f"{direction.noun}: no device given; main.subs contains the devices that were found. A "
            "group is empty if no device has its alias"
        )
    found = [
        (device, pdo, entry)
        for device in devices
        for assignment in device.assignments(direction)
        for pdo, entry in number_entries(assignment)
    ]
    if not found:
        raise ValueError(
            f"the given devices have no {direction.name.lower()} process data"
            f"{_choice(devices, direction)}"
        )
    names = unique_names([(e.name, pdo.name, str(device.position)) for device, pdo, e in found])
    for name in scale:
        if name not in names:
            raise ValueError(
                f"scale: unknown channel {name!r}; the channels are {', '.join(names)}"
            )
    return place_entries(names, found, scale)


def place_entries(
    names: Sequence[str],
    found: Sequence[tuple[DeviceDescription, Pdo, Entry]],
    scale: Mapping[str, float],
) -> tuple[NamedChannel, ...]:
    """Return the channels of mapped entries. Each mapping of an object has its own channel.

    Args:
        names: name of each channel.
        found: device, PDO and entry of each channel.
        scale: factor of each channel by name.
    """
    alike: Counter[tuple[int, int, int, int, int]] = Counter()
    made = []
    for name, (device, pdo, entry) in zip(names, found, strict=True):
        place = (device.position, pdo.index, entry.index, entry.subindex, entry.bit_length)
        which = Which(pdo.index, entry.bit_length, alike[place])
        alike[place] += 1
        channel = channel_of(entry, scale.get(name))
        made.append(NamedChannel(name, device.position, channel, which))
    return tuple(made)


def _choice(devices: Sequence[DeviceDescription], direction: Direction) -> str:
    """Return a hint with the PDOs that could be assigned; empty if the devices have none."""
    offered = [pdo for device in devices for pdo in device.pdos(direction)]
    if not offered:
        return ""
    return f": no PDO is assigned; choose with pdos= from {pdo_names(offered)}"


def with_chosen(
    device: DeviceDescription,
    pdos: Sequence[WrittenPdo],
    clock: DistributedClock | None,
    directions: Sequence[Direction],
) -> DeviceDescription:
    """Return the description of a device with the PDOs of a request, or those of its OpMode.

    Args:
        device: the device.
        pdos: PDOs to assign, with their entries if these are to be written.
        clock: clock request, which chooses the OpMode.
        directions: directions to change.
    """
    for direction in directions:
        chosen = chosen_pdos(device, pdos, clock, direction)
        if chosen:
            assignments = write_down(device, direction, chosen).assignments
            device = device.with_process_data(direction, assignments)
    return device


def number_entries(assignment: Assignment) -> list[tuple[Pdo, Entry]]:
    """Return the entries of up to 64 bits with their PDOs, without padding."""
    return [
        (pdo, entry)
        for pdo in assignment.pdos
        for entry in pdo.entries
        if entry.index and 1 <= entry.bit_length <= 64
    ]


def unique_names(parts: list[tuple[str, str, str]]) -> list[str]:
    """Return a unique name for each (entry, PDO, position), as short as possible.

    Many terminals name the entry of every channel "Output". Only the PDO names, such as
    "Channel 3", differ. Names that are still equal are numbered.
    """
    for spelling in (short_name, pdo_name, full_name):
        names = [spelling(*part) for part in parts]
        if len(set(names)) == len(names):
            return names
    return [f"{name} {names[: i + 1].count(name)}" for i, name in enumerate(names)]


def short_name(entry: str, pdo: str, position: str) -> str:
    """Return the name of the entry, such as "Output"; without one, that of the PDO, or "value"."""
    return entry or pdo or "value"


def pdo_name(entry: str, pdo: str, position: str) -> str:
    """Return the names of the PDO and the entry, such as "Channel 3 Output".

    Without both, return "value".
    """
    return f"{pdo} {entry}".strip() or "value"


def full_name(entry: str, pdo: str, position: str) -> str:
    """Return the position of the device and both names, such as "2 Channel 3 Output"."""
    return f"{position} {pdo_name(entry, pdo, position)}"


def column(named: NamedChannel, layout: ImageLayout, direction: Direction) -> Column:
    """Return the column of a channel.

    Args:
        named: channel of a device.
        layout: layout of the process image.
        direction: direction of the channel.

    Raises:
        MappingError: The channel is not in the process data.
    """
    channel = named.channel
    find = layout.output if direction is Direction.OUTPUT else layout.input
    number = find(named.device, channel.index, channel.subindex, named.which)
    if number is None:
        raise MappingError(f"device {named.device}: {channel.place} is not in its process data")
    return Column(
        name=named.name,
        number=replace(number, kind=channel.kind, scale=channel.scale or 1.0, offset=0.0),
        bank=channel.bank,
        device=named.device,
        sync_unit=layout.sync_unit(named.device),
    )
