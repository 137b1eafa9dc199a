"""Access to the whole memory of a device, for diagnostics."""

from __future__ import annotations

from catenary.errors import RegisterError
from catenary.procedure.exchange import Procedure, read_memory, write_memory
from catenary.procedure.station import Station, answered


def read_register(station: Station, address: int, size: int) -> Procedure[bytes]:
    """Read a part of a device's memory.

    Args:
        station: The device.
        address: Address of the first byte.
        size: Number of bytes.

    Raises:
        RegisterError: The device answers, but this part of its memory cannot be read.
    """
    [reply] = yield [read_memory(station.address, address, size, repeatable=True)]
    if not reply.lost and reply.working_counter == 0 and (yield from _is_present(station)):
        raise RegisterError(
            f"{station}: {_span(address, size)} cannot be read (working counter 0)",
            hint="the address is beyond its memory, or in a SyncManager buffer that is empty or "
            "must be read as a whole",
        )
    return answered(reply, station, _span(address, size))


def write_register(station: Station, address: int, data: bytes) -> Procedure[None]:
    """Write a part of a device's memory.

    Args:
        station: The device.
        address: Address of the first byte.
        data: The bytes to write.

    Raises:
        RegisterError: The device answers, but this part of its memory cannot be written.
    """
    [reply] = yield [write_memory(station.address, address, data, repeatable=False)]
    if not reply.lost and reply.working_counter == 0 and (yield from _is_present(station)):
        raise RegisterError(
            f"{station}: {_span(address, len(data))} cannot be written (working counter 0)",
            hint="the address is read-only, locked (AL control, until the application has read the "
            "previous request), beyond its memory, or in the buffer of a SyncManager",
        )
    answered(reply, station, _span(address, len(data)))


def _is_present(station: Station) -> Procedure[bool]:
    [reply] = yield [read_memory(station.address, 0, 1, repeatable=True)]
    return not reply.lost and reply.working_counter == 1


def _span(address: int, size: int) -> str:
    return f"0x{address:04X}" if size == 1 else f"0x{address:04X} to 0x{address + size - 1:04X}"
