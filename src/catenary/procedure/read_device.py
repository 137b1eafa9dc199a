"""Passive scan of a segment for diagnostics. It does not affect the operation of the segment.

The scan requests no state and writes no mapping, FMMU or SyncManager. It only writes the station
address of a device that has none, or that shares it with another device.
"""

from __future__ import annotations

from collections.abc import Sequence

from catenary.procedure.exchange import Procedure, read, write
from catenary.procedure.station import Station, answered
from catenary.procedure.stations import STATION_BASE, StationRegisters, read_registers
from catenary.wire.datagram import EcatCommand
from catenary.wire.register import STATION_ADDRESS


def visit(device_count: int) -> Procedure[tuple[StationRegisters, ...]]:
    """Replace missing and duplicate station addresses, then read the registers of all devices."""
    found = yield from read_addresses(device_count)
    addresses = distinct(found)
    yield from give_addresses(found, addresses)
    return (yield from read_registers(addresses))


def read_addresses(device_count: int) -> Procedure[tuple[int, ...]]:
    """Read the station addresses of the devices, in the order in which a frame passes them."""
    replies = yield [read(EcatCommand.APRD, -rank, STATION_ADDRESS) for rank in range(device_count)]
    return tuple(
        STATION_ADDRESS.unpack(answered(reply, Station(rank, 0), "station address"))
        for rank, reply in enumerate(replies)
    )


def give_addresses(found: Sequence[int], wanted: Sequence[int]) -> Procedure[None]:
    """Write the station addresses that differ.

    Args:
        found: The present addresses, in the order in which a frame passes the devices.
        wanted: The new addresses, in the same order.
    """
    missing = [rank for rank in range(len(found)) if wanted[rank] != found[rank]]
    if not missing:
        return
    replies = yield [
        write(EcatCommand.APWR, -rank, STATION_ADDRESS, wanted[rank]) for rank in missing
    ]
    for rank, reply in zip(missing, replies, strict=True):
        answered(reply, Station(rank, wanted[rank]), "station address")


def distinct(found: Sequence[int]) -> tuple[int, ...]:
    """Return unique addresses: an address that is 0 or a duplicate is replaced by a free one."""
    taken = set(found)
    addresses: list[int] = []
    for position, address in enumerate(found):
        if address == 0 or address in addresses:
            address = STATION_BASE + position
            while address in taken:
                address += 1
            taken.add(address)
        addresses.append(address)
    return tuple(addresses)
