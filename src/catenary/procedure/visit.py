"""Looking at a segment without changing what it does: for diagnosis beside another program's
bring-up, or of devices that are where they are for a reason.

No state is asked for, no mapping, FMMU or SyncManager is touched. A device is written to in one
case only: it has no station address of its own (none was ever given, or a twin has the same).
"""

from __future__ import annotations

from collections.abc import Sequence

from catenary.procedure.exchange import Procedure, read, write
from catenary.procedure.station import Station, answered
from catenary.procedure.stations import STATION_BASE, StationRegisters, read_registers
from catenary.wire.datagram import Command
from catenary.wire.register import STATION_ADDRESS


def visit(device_count: int) -> Procedure[tuple[StationRegisters, ...]]:
    """The registers of all devices, by the station addresses they have already."""
    replies = yield [
        read(Command.APRD, -position, STATION_ADDRESS) for position in range(device_count)
    ]
    found = [
        STATION_ADDRESS.unpack(answered(reply, Station(position, 0), "station address"))
        for position, reply in enumerate(replies)
    ]
    addresses = distinct(found)
    missing = [
        position for position in range(device_count) if addresses[position] != found[position]
    ]
    if missing:
        replies = yield [
            write(Command.APWR, -position, STATION_ADDRESS, addresses[position])
            for position in missing
        ]
        for position, reply in zip(missing, replies, strict=True):
            answered(reply, Station(position, addresses[position]), "station address")
    return (yield from read_registers(addresses))


def distinct(found: Sequence[int]) -> tuple[int, ...]:
    """The addresses as found; where one is 0 or there already, the next one that is free."""
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
