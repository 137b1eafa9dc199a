"""Scan of one device, from power-up to PRE-OP, as one procedure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from catenary.bus.esi_source import unchanged
from catenary.errors import CatenaryError, DecodeError, IdentityError, SegmentError
from catenary.model.describe import describe
from catenary.model.device import DeviceDescription, Identity
from catenary.model.topology import make_topology, tree
from catenary.procedure.al_state import request_state
from catenary.procedure.configure import configure_mailbox
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.modules import read_module_lists
from catenary.procedure.names import name_entries
from catenary.procedure.pdo_offers import read_first_mapping
from catenary.procedure.profile import read_profile
from catenary.procedure.register_commands import run_commands
from catenary.procedure.sii import read_image
from catenary.procedure.sii_owner import hand_over
from catenary.procedure.station import Station, station_of, within
from catenary.procedure.stations import StationRegisters
from catenary.procedure.telegrams import with_telegrams
from catenary.wire.al import AlState

READ_TIMEOUT = 30.0  # [s] for the registers and the SII of one device
BRING_UP_TIMEOUT = 30.0  # [s] to bring it to PRE-OP and read its profile


class ScannedDevice(NamedTuple):
    """One device in PRE-OP with its mailbox, or the error that prevented PRE-OP."""

    description: DeviceDescription
    channel: MailboxChannel | None = None
    error: CatenaryError | None = None


def find(
    registers: StationRegisters,
    complete: Callable[[DeviceDescription], DeviceDescription] = unchanged,
) -> Procedure[ScannedDevice]:
    """Bring one device to PRE-OP, or return its error. Other devices are not affected.

    Args:
        registers: Registers of the device.
        complete: Function that adds the facts of its ESI to the description from its SII.
    """
    device = unread(registers)
    station = Station(registers.position, registers.station_address)  # its name is not known yet
    try:
        device = complete((yield from within(READ_TIMEOUT, station, identify(registers))))
        station = station_of(device)
        patience = BRING_UP_TIMEOUT + (device.timeouts.pre_op or 0.0)
        return (yield from within(patience, station, bring_to_pre_op(device, complete)))
    except (DecodeError, ValueError) as error:  # the device sent invalid data
        return ScannedDevice(device, error=_unreadable(station, error))
    except CatenaryError as error:
        return ScannedDevice(device, error=error)


def _unreadable(station: Station, error: Exception) -> SegmentError:
    return SegmentError(
        f"{station}: cannot use the data of the device: {error}",
        hint="its EEPROM or its firmware is faulty; please report it",
    )


def bring_to_pre_op(
    device: DeviceDescription,
    complete: Callable[[DeviceDescription], DeviceDescription] = unchanged,
) -> Procedure[ScannedDevice]:
    """Open the mailbox, assign the EEPROM to the device, and request PRE-OP.

    Then read the profile, the modules, the mapping and missing names. A device without a mailbox is
    not read.

    Args:
        device: Description from SII and ESI.
        complete: Function that adds the modules that a modular device reports.
    """
    station = station_of(device)
    if device.mailbox is None:
        yield from hand_over(station)
        yield from run_commands(station, device.register_commands, "IP")
        yield from request_state(station, AlState.PRE_OP)
        return ScannedDevice(device)
    channel = MailboxChannel(station, device.mailbox)
    yield from configure_mailbox(channel)
    yield from hand_over(station)
    yield from run_commands(station, device.register_commands, "IP")
    yield from request_state(station, AlState.PRE_OP)
    if device.coe:
        device = yield from read_profile(channel, device)
        if device.modular is not None:
            device = complete((yield from read_module_lists(channel, device)))
        device = yield from read_first_mapping(channel, device)
    elif device.soe:
        device = yield from with_telegrams(channel, device)
    device = yield from name_entries(channel, device)
    return ScannedDevice(device, channel)


def unread(registers: StationRegisters) -> DeviceDescription:
    """Return the description of a device from its registers alone."""
    device = described(registers, b"")
    return replace(device, notes=())


def identify(registers: StationRegisters) -> Procedure[DeviceDescription]:
    """Return the description of a device from its registers and SII."""
    station = Station(registers.position, registers.station_address)
    return described(registers, (yield from read_image(station)))


def described(registers: StationRegisters, image: bytes) -> DeviceDescription:
    return describe(
        registers.position,
        station_address=registers.station_address,
        alias=registers.alias,
        dl_status=registers.dl_status,
        system_time=registers.system_time,
        information=registers.information,
        image=image,
    )


def with_places(devices: Sequence[DeviceDescription]) -> tuple[DeviceDescription, ...]:
    """Return the descriptions, with the parent of each device."""
    places = tree([device.open_ports for device in devices])
    return tuple(
        replace(device, parent=place.parent, parent_port=place.parent_port)
        for device, place in zip(devices, places, strict=True)
    )


def oddities(devices: Sequence[DeviceDescription], *, ring: bool) -> tuple[str, ...]:
    """Return contradictions of the wiring (except in a ring) and the notes of the devices.

    Args:
        devices: Descriptions of the devices.
        ring: True if the devices form a ring; its cuts are reported elsewhere.
    """
    wiring = () if ring else make_topology([device.open_ports for device in devices]).contradictions
    return (*wiring, *(f"{device}: {note}" for device in devices for note in device.notes))


def check_identity(device: DeviceDescription, expected: Identity) -> None:
    """Check that a device is the same product; revision and serial number may differ.

    Args:
        device: Device that was found.
        expected: Identity to compare with.

    Raises:
        IdentityError: It is another product.
    """
    if device.identity.same_kind(expected):
        return
    raise IdentityError(
        f"{device}: expected {expected}, found {device.identity}",
        position=device.position,
        expected=expected,
        found=device.identity,
        hint="check the order of the devices on the cable, or correct the expected identity",
    )
