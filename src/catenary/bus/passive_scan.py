"""Passive scan for diagnostics: it changes no state."""

from __future__ import annotations

from dataclasses import replace

from catenary.bus.ring import check_direction, routed
from catenary.bus.runner import BlockingRunner
from catenary.bus.segment_scan import READ_TIMEOUT, described, unread, with_places
from catenary.errors import CatenaryError
from catenary.link import RingLink
from catenary.link.ring_state import Shape
from catenary.model.device import DeviceDescription
from catenary.procedure.exchange import Procedure
from catenary.procedure.read_device import distinct, give_addresses, read_addresses, visit
from catenary.procedure.sii import read_image
from catenary.procedure.sii_owner import with_eeprom
from catenary.procedure.station import Station, within
from catenary.procedure.stations import StationRegisters, count, read_registers


def passive_scan(
    runner: BlockingRunner, ring: RingLink | None, names: bool
) -> tuple[DeviceDescription, ...]:
    """Return all devices by position, with their parents.

    Args:
        runner: Runner of the procedures.
        ring: Ring link; None for a line.
        names: True to also read the EEPROMs.
    """
    runner.flush()
    device_count = runner.run(count()).devices
    if ring is not None:
        check_direction(ring.state)
    if ring is not None and ring.state.shape in (Shape.CUT, Shape.SECOND_ONLY):
        registers = _visit_from_both_ends(runner, ring, device_count)
    else:
        registers = runner.run(visit(device_count))
    if not names:
        return with_places([replace(unread(each), name="") for each in registers])
    return with_places(runner.run_all([_named(each) for each in registers]))


def _visit_from_both_ends(
    runner: BlockingRunner, ring: RingLink, device_count: int
) -> tuple[StationRegisters, ...]:
    """Read the registers from both ends of a ring, as `assign_from_both_ends` does."""
    near = ring.state.first_devices
    with routed(ring, "first"):
        found = runner.run(read_addresses(near))
    with routed(ring, "second"):
        found += runner.run(read_addresses(device_count - near))
    addresses = distinct(found)
    with routed(ring, "first"):
        runner.run(give_addresses(found[:near], addresses[:near]))
    with routed(ring, "second"):
        runner.run(give_addresses(found[near:], addresses[near:]))
    return runner.run(read_registers(addresses))


def _named(registers: StationRegisters) -> Procedure[DeviceDescription]:
    """Return the device with the content of its EEPROM, or with a note if it is unreadable."""
    station = Station(registers.position, registers.station_address)
    try:
        reading = within(READ_TIMEOUT, station, read_image(station))
        image = yield from with_eeprom(station, reading)
    except CatenaryError as error:
        return replace(unread(registers), notes=(error.message,))
    return described(registers, image)
