"""Devices as they are: what diagnosis looks at."""

from __future__ import annotations

from dataclasses import replace

from catenary.bus.runner import BlockingRunner
from catenary.bus.segment_scan import described, unread, with_places
from catenary.errors import CatenaryError
from catenary.model.device import DeviceDescription
from catenary.procedure.exchange import Procedure
from catenary.procedure.sii import read_image
from catenary.procedure.sii_owner import with_eeprom
from catenary.procedure.station import Station
from catenary.procedure.stations import StationRegisters, count
from catenary.procedure.visit import visit


def look(runner: BlockingRunner, names: bool) -> tuple[DeviceDescription, ...]:
    """All devices in the order of their positions, with their parents."""
    runner.flush()
    registers = runner.run(visit(runner.run(count())))
    if not names:
        return with_places([replace(unread(each), name="") for each in registers])
    return with_places(runner.run_all([_named(each) for each in registers]))


def _named(registers: StationRegisters) -> Procedure[DeviceDescription]:
    """With what the EEPROM says of its identity; where it cannot be read, with a note why."""
    station = Station(registers.position, registers.station_address)
    try:
        image = yield from with_eeprom(station, read_image(station))
    except CatenaryError as error:
        return replace(unread(registers), notes=(error.message,))
    return described(registers, image)
