"""Station addresses of a clone: unambiguous ones during the reading, and the old ones after it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import chain

from catenary.errors import SegmentError
from catenary.procedure.clone_access import WRITABLE, is_writable, left_state, require_writable
from catenary.procedure.clone_registers import Present
from catenary.procedure.exchange import Procedure, read, write
from catenary.procedure.station import Station, answered
from catenary.procedure.stations import STATION_BASE
from catenary.wire.al import STATE_MASK
from catenary.wire.datagram import EcatCommand
from catenary.wire.register import AL_STATUS, STATION_ADDRESS


def unambiguous(devices: Sequence[Present]) -> tuple[int | None, ...]:
    """Return an address for each device to which only this device answers.

    Devices in INIT and PRE-OP keep their address if it is unique, else get a free one. Other
    devices have None, because their address cannot be changed.
    """
    answering = [each.station_address for each in devices]
    aliases = [each.alias if each.answers_to_alias else 0 for each in devices]
    taken = {*answering, *aliases, *(each.alias for each in devices)}
    found: list[int | None] = []
    for rank, device in enumerate(devices):
        address = device.station_address
        if not is_writable(device):
            found.append(None)
            continue
        others = (*answering[:rank], *answering[rank + 1 :], *aliases[:rank], *aliases[rank + 1 :])
        if address == 0 or address in others:
            address = _free(STATION_BASE + rank, taken)
            taken.add(address)
        found.append(address)
    return tuple(found)


def _free(first: int, taken: Collection[int]) -> int:
    """Return the first address from `first` on that no device has; 0 is not an address."""
    free = (n for n in chain(range(first, 0x10000), range(1, first)) if n not in taken)
    return next(free)


def give_address(device: Present, address: int) -> Procedure[None]:
    """Write a station address by position, if the same device is there in INIT or PRE-OP.

    Args:
        device: Registers of the device.
        address: The new station address.

    Raises:
        StateError: The device is in another state.
        SegmentError: Another device is at its position.
    """
    station = Station(device.rank, address)
    state, now = yield [
        read(EcatCommand.APRD, -device.rank, AL_STATUS),
        read(EcatCommand.APRD, -device.rank, STATION_ADDRESS),
    ]
    word = AL_STATUS.unpack(answered(state, station, "AL status"))
    if word & STATE_MASK not in WRITABLE:
        raise left_state(station, word & STATE_MASK, 0)
    found = STATION_ADDRESS.unpack(answered(now, station, "station address"))
    if found != device.station_address:
        raise SegmentError(
            f"{station} has the station address 0x{found:04X}, and had "
            f"0x{device.station_address:04X} before",
            hint="a device was plugged in or unplugged: check the cables, then clone again",
        )
    [reply] = yield [write(EcatCommand.APWR, -device.rank, STATION_ADDRESS, address)]
    answered(reply, station, "station address")


def return_address(device: Present, address: int) -> Procedure[None]:
    """Write back the station address of a device that has another one.

    Args:
        device: Registers of the device before its address was changed.
        address: Its present address, to which no other device answers.

    Raises:
        StateError: The device is neither in INIT nor in PRE-OP.
    """
    station = Station(device.rank, address)
    yield from require_writable(station)
    request = write(EcatCommand.FPWR, address, STATION_ADDRESS, device.station_address)
    # Not repeated: after a lost answer, the device has its old address already.
    [reply] = yield [request._replace(repeatable=False)]
    if not reply.lost:
        answered(reply, station, "station address")
