"""Bringing one device back into a network that runs: found, made sure of, told its part anew.

A device that was switched off has forgotten all but its EEPROM: station address, SyncManagers,
FMMUs, and what was mapped. IgH's and TwinCAT's way: back to INIT, then everything again.
"""

from __future__ import annotations

from typing import NamedTuple

from catenary.model.device import DeviceDescription, Identity
from catenary.plan.start_up import DevicePlan, renewed
from catenary.procedure.al_state import request_state
from catenary.procedure.configure import configure_mailbox, configure_process_data
from catenary.procedure.exchange import Procedure, Request, read, write, write_memory
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.pdo import read_mapping, verify_mapping, write_downloads
from catenary.procedure.sii import read_identity
from catenary.procedure.sii_owner import hand_over
from catenary.procedure.station import Station, answered
from catenary.procedure.stations import FMMU_BLOCK, SYNC_MANAGER_BLOCK
from catenary.wire.al import AlState
from catenary.wire.datagram import EcatCommand
from catenary.wire.register import (
    ACTIVATION,
    AL_STATUS,
    SII_CONFIGURATION,
    STATION_ADDRESS,
    STATION_ALIAS,
)
from catenary.wire.sii_interface import CONFIGURATION_FORCE


class Presence(NamedTuple):
    """One device as the cable shows it now."""

    rank: int  # in the order of the frame
    station_address: int  # 0: it was switched on and nobody has spoken to it
    alias: int


def look_around(at_most: int) -> Procedure[list[Presence]]:
    """Who is there, by position. Devices that come or go meanwhile are left for the next look;
    those behind the cut of a ring are counted and have no position."""
    [counted] = yield [read(EcatCommand.BRD, 0, AL_STATUS)]
    count = min(counted.working_counter, at_most)
    if counted.lost or count == 0:
        return []
    replies = yield [
        request
        for rank in range(count)
        for request in (
            read(EcatCommand.APRD, -rank, STATION_ADDRESS),
            read(EcatCommand.APRD, -rank, STATION_ALIAS),
        )
    ]
    there = [not reply.lost and reply.working_counter == 1 for reply in replies]
    reached = there.index(False) if False in there else len(there)
    if reached % 2 or any(there[reached:]) or any(reply.lost for reply in replies):
        return []
    replies = replies[:reached]
    addresses = [STATION_ADDRESS.unpack(reply.data) for reply in replies[0::2]]
    aliases = [STATION_ALIAS.unpack(reply.data) for reply in replies[1::2]]
    return [Presence(rank, *each) for rank, each in enumerate(zip(addresses, aliases, strict=True))]


def give_address(presence: Presence, station: Station) -> Procedure[None]:
    """The station address of a place, to the device that stands there."""
    [reply] = yield [write(EcatCommand.APWR, -presence.rank, STATION_ADDRESS, station.address)]
    answered(reply, station, "station address")


def forget_address(presence: Presence) -> Procedure[None]:
    """Takes the station address from a device that is not ours: two must not answer to one."""
    yield [write(EcatCommand.APWR, -presence.rank, STATION_ADDRESS, 0)]


def identify(station: Station) -> Procedure[Identity]:
    """What its EEPROM says it is. Takes the EEPROM from the device's application first."""
    replies = yield [
        write(EcatCommand.FPWR, station.address, SII_CONFIGURATION, CONFIGURATION_FORCE),
        write(EcatCommand.FPWR, station.address, SII_CONFIGURATION, 0),
    ]
    for reply in replies:
        answered(reply, station, "EEPROM access")
    return (yield from read_identity(station))


def bring_to_pre_op(station: Station, channel: MailboxChannel | None) -> Procedure[None]:
    """From whatever state to PRE-OP by way of INIT, with nothing left of before."""
    yield from request_state(station, AlState.INIT)
    requests = [
        _cleared(station, *FMMU_BLOCK),
        _cleared(station, *SYNC_MANAGER_BLOCK),
    ]
    for reply in (yield requests):
        answered(reply, station, "FMMUs and SyncManagers")
    yield [write(EcatCommand.FPWR, station.address, ACTIVATION, 0)]  # has no answer without clocks
    if channel is not None:
        yield from configure_mailbox(channel)
    yield from hand_over(station)
    yield from request_state(station, AlState.PRE_OP)


def bring_to_safe_op(
    station: Station,
    channel: MailboxChannel | None,
    device: DeviceDescription,
    plan: DevicePlan,
    clock: Procedure[None] | None = None,
) -> Procedure[None]:
    """Its start-up list and process data, from PRE-OP. What it has mapped is read first: it may be
    something else after power-up than before. `clock`: what sets its clock, last of all."""
    if channel is not None and device.coe:
        found = yield from read_mapping(channel, device)
        again = renewed(plan, found)
        yield from write_downloads(channel, found, again)
        if again.mapping_changed:
            yield from verify_mapping(channel, device, again)
    yield from configure_process_data(station, device, plan)
    if clock is not None:
        yield from clock
    yield from request_state(station, AlState.SAFE_OP)


def _cleared(station: Station, start: int, size: int) -> Request:
    return write_memory(station.address, start, bytes(size), repeatable=True)
