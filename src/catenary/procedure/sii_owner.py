"""Ownership of the EEPROM: the MainDevice or the device's processor (PDI), ETG.1000.4 §6.4.2.

The registers are 0x0500 and 0x0501.
"""

from __future__ import annotations

from typing import TypeVar

from catenary.errors import CatenaryError, EepromError
from catenary.procedure.exchange import Procedure, read, write
from catenary.procedure.station import Station, answered
from catenary.wire.datagram import EcatCommand
from catenary.wire.register import SII_CONFIGURATION, SII_PDI_ACCESS
from catenary.wire.sii_interface import (
    CONFIGURATION_FORCE,
    CONFIGURATION_TO_PDI,
    PDI_ACCESS_ACTIVE,
)

T = TypeVar("T")


def hand_over(station: Station) -> Procedure[None]:
    """Assign the EEPROM to the device's processor, which may need it between INIT and PRE-OP.

    SOEM (`ecx_config_init`) and IgH (`ec_fsm_slave_config_enter_assign_pdi`) do the same just
    before PRE-OP.
    """
    yield from _configure(station, CONFIGURATION_TO_PDI)


def with_eeprom(station: Station, procedure: Procedure[T], *, force: bool = False) -> Procedure[T]:
    """Run a procedure with the EEPROM assigned to the MainDevice, then restore the owner.

    Args:
        station: The device.
        procedure: The procedure to run.
        force: True to take the EEPROM even while the device's processor accesses it.

    Raises:
        EepromError: The device's processor is accessing the EEPROM, and `force` is False.
    """
    was_theirs = yield from _take(station, force)
    try:
        result = yield from procedure
    except CatenaryError:
        if was_theirs:
            yield from _configure(station, CONFIGURATION_TO_PDI)
        raise
    if was_theirs:
        yield from _configure(station, CONFIGURATION_TO_PDI)
    return result


def _take(station: Station, force: bool) -> Procedure[bool]:
    """Take the EEPROM. Return True if the processor owned it before."""
    owner, access = yield [
        read(EcatCommand.FPRD, station.address, SII_CONFIGURATION),
        read(EcatCommand.FPRD, station.address, SII_PDI_ACCESS),
    ]
    was_theirs = bool(answered(owner, station, "EEPROM owner")[0] & CONFIGURATION_TO_PDI)
    in_use = bool(answered(access, station, "EEPROM access")[0] & PDI_ACCESS_ACTIVE)
    if in_use and not force:
        raise EepromError(
            f"{station}: its processor is using the EEPROM (register 0x0501)",
            hint="bring it to INIT, or try again later",
        )
    if in_use:
        yield from _configure(station, CONFIGURATION_FORCE)
    if in_use or was_theirs:
        yield from _configure(station, 0)
    return was_theirs


def _configure(station: Station, value: int) -> Procedure[None]:
    [reply] = yield [write(EcatCommand.FPWR, station.address, SII_CONFIGURATION, value)]
    answered(reply, station, "EEPROM owner")
