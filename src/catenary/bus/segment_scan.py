"""What is asked of one device on its way from power-up to PRE-OP, as one procedure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from catenary.errors import CatenaryError, IdentityError
from catenary.model.describe import describe
from catenary.model.device import DeviceDescription, Identity
from catenary.model.topology import make_topology, tree
from catenary.procedure.al_state import request_state
from catenary.procedure.configure import configure_mailbox
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.pdo_offers import read_first_mapping
from catenary.procedure.profile import read_profile
from catenary.procedure.sii import read_image
from catenary.procedure.sii_owner import hand_over
from catenary.procedure.station import Station
from catenary.procedure.stations import StationRegisters
from catenary.wire.al import State


class Found(NamedTuple):
    """One device in PRE-OP, with the mailbox that brought it there; or what kept it from there."""

    description: DeviceDescription
    channel: MailboxChannel | None = None
    error: CatenaryError | None = None


def find(registers: StationRegisters) -> Procedure[Found]:
    """Brings one device to PRE-OP, or tells what is wrong with it: the others go on."""
    device = unread(registers)
    try:
        device = yield from identify(registers)
        return (yield from bring_to_pre_op(device))
    except CatenaryError as error:
        return Found(device, error=error)


def bring_to_pre_op(device: DeviceDescription) -> Procedure[Found]:
    """Opens the mailbox, asks for PRE-OP and reads the profile and the mapping."""
    station = Station(device.position, device.station_address, device.name)
    if device.mailbox is None:
        yield from hand_over(station)
        yield from request_state(station, State.PRE_OP)
        return Found(device)
    channel = MailboxChannel(station, device.mailbox)
    yield from configure_mailbox(channel)
    yield from hand_over(station)
    yield from request_state(station, State.PRE_OP)
    if device.coe:
        device = yield from read_profile(channel, device)
        device = yield from read_first_mapping(channel, device)
    return Found(device, channel)


def unread(registers: StationRegisters) -> DeviceDescription:
    """What its registers alone say."""
    device = described(registers, b"")
    return replace(device, notes=())


def identify(registers: StationRegisters) -> Procedure[DeviceDescription]:
    """What registers and SII say."""
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
    """The devices with their parents."""
    places = tree([device.open_ports for device in devices])
    return tuple(
        replace(device, parent=place.parent, parent_port=place.parent_port)
        for device, place in zip(devices, places, strict=True)
    )


def oddities(devices: Sequence[DeviceDescription], *, ring: bool) -> tuple[str, ...]:
    """What contradicts itself in the wiring (of a ring its cuts say it), and in the EEPROMs."""
    wiring = () if ring else make_topology([device.open_ports for device in devices]).contradictions
    return (*wiring, *(f"{device}: {note}" for device in devices for note in device.notes))


def check_identity(device: DeviceDescription, expected: Identity) -> None:
    """IdentityError unless it is the same product. Revision and serial number may differ."""
    if device.identity.same_kind(expected):
        return
    raise IdentityError(
        f"{device}: expected {expected}, found {device.identity}",
        position=device.position,
        expected=expected,
        found=device.identity,
        hint="check the order of the devices on the cable, or correct what is expected",
    )
