"""Process data of the devices of an ENI: the PDOs, the named variables and the clocks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from catenary.bus import SubDevice
from catenary.drive.channel import Channel, NumberType, channel_of
from catenary.drive.process_data import ProcessData
from catenary.esi.eni.clocks import sync_signals
from catenary.esi.eni.places import PlacedVariable
from catenary.esi.eni.values import EniDevice, EniSyncManager
from catenary.model.device import DeviceDescription, Direction, Entry
from catenary.plan.request import DistributedClock, ObjectReference, WrittenPdo
from catenary.types import Boolean, Integer, Real, by_name
from catenary.wire.clock import Activation


def make_process_data(
    device: EniDevice, sub: SubDevice, variables: Mapping[str, PlacedVariable]
) -> ProcessData:
    """Return the process data of one device.

    Args:
        device: the device in the file.
        sub: the device found.
        variables: variables of the device, by their names in the process data.
    """
    channels: dict[Direction, dict[str, Channel]] = {direction: {} for direction in Direction}
    for name, each in variables.items():
        channels[each.variable.direction][name] = channel(each)
    return ProcessData(
        sub,
        inputs=channels[Direction.INPUT],
        # Without names, the bytes of the outputs must still be sent.
        outputs=channels[Direction.OUTPUT] or None,
        pdos=written_pdos(device, sub.description),
        dc=clock(device) or False,
    )


def channel(placed: PlacedVariable) -> Channel:
    """Return the channel of a variable. A type of another length becomes an unsigned integer."""
    entry = placed.entry
    kind = number_type(placed.variable.data_type or entry.type, entry.bit_length)
    return Channel(entry.index, entry.subindex, kind, pdo=placed.pdo)


def number_type(name: str, bits: int) -> NumberType:
    """Return the numeric type with a name; an unsigned integer if it has another length.

    Args:
        name: name of the type in the file.
        bits: length of the number.
    """
    try:
        found = by_name(name)
    except ValueError:
        found = None
    if isinstance(found, Boolean | Integer | Real) and found.bit_length == bits:
        return found
    return channel_of(Entry(1, 0, bits)).type


def written_pdos(device: EniDevice, description: DeviceDescription) -> list[WrittenPdo]:
    """Return the PDOs of the file by SyncManager; those that can change with their entries."""
    return [
        _written(manager, number, device, description)
        for manager in device.sync_managers
        for number in range(len(manager.pdos))
    ]


def _written(
    manager: EniSyncManager, number: int, device: EniDevice, description: DeviceDescription
) -> WrittenPdo:
    pdo = manager.pdos[number]
    entries = tuple(ObjectReference(e.index, e.subindex, e.bit_length) for e in pdo.entries)
    keeps = pdo.fixed or not description.coe or not entries
    return WrittenPdo(pdo.index, None if keeps else entries, manager.index)


def clock(device: EniDevice) -> DistributedClock | None:
    """Return the clock request of a device; None if the file starts no SYNC signal."""
    signals = sync_signals(device)
    if signals is None:
        return None
    return DistributedClock(
        sync0=signals.sync0 or None,
        sync1=signals.sync1 if Activation.SYNC1 & signals.assign_activate >> 8 else None,
        shift=signals.shift,
        assign_activate=signals.assign_activate,
    )


def channel_names(device: str, variables: Sequence[PlacedVariable]) -> dict[str, PlacedVariable]:
    """Return the variables of a device by short names: without the name of the device.

    An output with the name of an input has " (output)" after it.

    Args:
        device: name of the device.
        variables: variables of the device.
    """
    named: dict[str, PlacedVariable] = {}
    for each in variables:
        name = each.variable.name.removeprefix(f"{device}.")
        while name in named:
            name = f"{name} (output)"
        named[name] = each
    return named
