"""Events of register writes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TypeAlias

from catenary.capture.register_contents import (
    EepromAssigned,
    FmmuWrite,
    RegisterWrite,
    SyncManagerWrite,
    SyncUnitWrite,
)
from catenary.capture.registers import WrittenRegisters
from catenary.wire.register import (
    ACTIVATION,
    AL_CONTROL,
    CYCLIC_UNIT_CONTROL,
    PROCESS_RAM,
    SII_CONFIGURATION,
    SII_CONTROL_STATUS,
    SII_DATA,
    STATION_ADDRESS,
    SYSTEM_TIME,
    Register,
    fmmu,
    sync_manager,
)
from catenary.wire.sii_interface import CONFIGURATION_FORCE, CONFIGURATION_TO_PDI

Written: TypeAlias = FmmuWrite | SyncManagerWrite | SyncUnitWrite | RegisterWrite | EepromAssigned

_FIRST_CONFIGURATION = 0x0400  # watchdogs; lower registers do not depend on the next state

_EEPROM = range(SII_CONTROL_STATUS.address, SII_DATA.address + SII_DATA.size)
_FMMUS = range(fmmu(0).address, fmmu(15).address + fmmu(15).size)
_SYNC_MANAGERS = range(sync_manager(0).address, sync_manager(15).address + sync_manager(15).size)
_SYNC_UNIT = range(CYCLIC_UNIT_CONTROL.address, ACTIVATION.address + 1)


def register_writes(
    registers: WrittenRegisters, address: int, data: bytes, *, accepted: bool = True
) -> Iterator[Written]:
    """Store a write, and yield its events: SyncManagers, FMMUs, SYNC unit, other registers.

    AL control, the station address and the EEPROM interface have events of their own.

    Args:
        registers: The registers, which change only if the write was accepted.
        address: Address of the first byte.
        data: The written bytes.
        accepted: False if no device processed the datagram.
    """
    if address >= PROCESS_RAM or not data:
        return
    target = registers if accepted else registers.copy()
    target.write(address, data)
    found: list[Written] = []
    if address in _FMMUS:
        found += target.fmmus(address, len(data))
    elif address in _SYNC_MANAGERS:
        found += target.sync_managers(address, len(data))
    elif address + len(data) > _SYNC_UNIT.start and address < _SYNC_UNIT.stop:
        found.append(target.sync_unit())
    elif address == SII_CONFIGURATION.address:
        owner = data[0]
        found.append(
            EepromAssigned(bool(owner & CONFIGURATION_TO_PDI), bool(owner & CONFIGURATION_FORCE))
        )
    elif not _is_followed(address, data):
        found.append(RegisterWrite(address, data))
    for each in found:
        yield each if accepted else replace(each, accepted=False)


def _is_followed(address: int, data: bytes) -> bool:
    """Return True for a write that has events of another kind."""
    return (
        _covers(address, data, AL_CONTROL)
        or (address == STATION_ADDRESS.address and any(data))
        or address in _EEPROM
    )


def _covers(address: int, data: bytes, register: Register[int]) -> bool:
    return address <= register.address < address + len(data)


def is_configuration(written: Written) -> bool:
    """Return True for a write that prepares the next state."""
    if isinstance(written, RegisterWrite):
        return written.address >= _FIRST_CONFIGURATION
    return not isinstance(written, EepromAssigned)


def is_clock_update(address: int) -> bool:
    """Return True for a write of the system time, which a master may repeat in every cycle."""
    return address == SYSTEM_TIME.address


def is_eeprom(address: int) -> bool:
    """Return True for an address of the EEPROM interface, except its assignment."""
    return address != SII_CONFIGURATION.address and address in _EEPROM
