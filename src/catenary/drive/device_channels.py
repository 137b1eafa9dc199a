"""Channels of devices: mapped ones with their names, and chosen ones."""

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
from catenary.plan.pdo_rewrite import write_down
from catenary.plan.pdo_search import pdo_names
from catenary.plan.request import ImageLayout, WrittenPdo


class NamedChannel(NamedTuple):
    """Channel of one device, and its name."""

    name: str
    device: int
    channel: Channel
    which: Which = ANY  # selects one place if the device maps the object several times


def chosen_channels(sub: SubDevice, named: Mapping[str, Channel]) -> tuple[NamedChannel, ...]:
    """Return the channels that the application chose."""
    return tuple(
        NamedChannel(name, sub.position, channel, Which(bit_length=channel.bit_length))
        for name, channel in named.items()
    )


def mapped_channels(
    devices: Iterable[DeviceDescription], direction: Direction, scale: Mapping[str, float]
) -> tuple[NamedChannel, ...]:
    """Return all channels of the devices with unique names.

    Raises:
        ValueError: The devices have no channels.
    """
    devices = list(devices)
    if not devices:
        raise ValueError(
            f"{direction.noun}: no device given; main.subs shows those that were found. A group is "
            "empty if no device has its alias"
        )
    found = [
        (device, pdo, entry)
        for device in devices
        for assignment in device.assignments(direction)
        for pdo, entry in number_entries(assignment)
    ]
    if not found:
        raise ValueError(
            f"no {direction.name.lower()} process data in the devices given"
            f"{_choice(devices, direction)}"
        )
    names = unique_names([(e.name, pdo.name, str(device.position)) for device, pdo, e in found])
    for name in scale:
        if name not in names:
            raise ValueError(f"scale: no channel {name!r}; there are: {', '.join(names)}")
    return place_entries(names, found, scale)


def place_entries(
    names: Sequence[str],
    found: Sequence[tuple[DeviceDescription, Pdo, Entry]],
    scale: Mapping[str, float],
) -> tuple[NamedChannel, ...]:
    """Return mapped entries as channels. An entry that is mapped twice keeps its own place."""
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
    """Return the PDOs that could be assigned, if there are any."""
    offered = [pdo for device in devices for pdo in device.pdos(direction)]
    return f": none is assigned; choose with pdos= from {pdo_names(offered)}" if offered else ""


def with_written(
    device: DeviceDescription, direction: Direction, pdos: Sequence[WrittenPdo]
) -> DeviceDescription:
    """Return the device as if it had these PDOs; unchanged without PDOs."""
    if not pdos:
        return device
    return device.with_process_data(direction, write_down(device, direction, pdos).assignments)


def number_entries(assignment: Assignment) -> list[tuple[Pdo, Entry]]:
    """Return all entries with their PDOs, without gaps and entries that no number can hold."""
    return [
        (pdo, entry)
        for pdo in assignment.pdos
        for entry in pdo.entries
        if entry.index and 1 <= entry.bit_length <= 64
    ]


def unique_names(parts: list[tuple[str, str, str]]) -> list[str]:
    """Return a short unique name for each (entry, PDO, position), numbered if necessary.

    Terminals call every channel's entry "Output" and tell them apart by their PDO, "Channel 3".
    """
    for spelling in (short_name, pdo_name, full_name):
        names = [spelling(*part) for part in parts]
        if len(set(names)) == len(names):
            return names
    return [f"{name} {names[: i + 1].count(name)}" for i, name in enumerate(names)]


def short_name(entry: str, pdo: str, position: str) -> str:
    return entry or pdo or "value"


def pdo_name(entry: str, pdo: str, position: str) -> str:
    return f"{pdo} {entry}".strip() or "value"


def full_name(entry: str, pdo: str, position: str) -> str:
    return f"{position} {pdo_name(entry, pdo, position)}"


def column(named: NamedChannel, layout: ImageLayout, direction: Direction) -> Column:
    """Return the channel with its place."""
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
