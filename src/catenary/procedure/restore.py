"""Return of one device to a running network: find, identify and configure it again.

A device that was switched off has lost its station address, SyncManagers, FMMUs and mapping. Only
its EEPROM remains. As in IgH and TwinCAT, it is brought to INIT and configured completely.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from catenary.model.device import DeviceDescription, Identity
from catenary.model.register_command import RegisterCommand
from catenary.plan.start_up import DevicePlan, renewed
from catenary.procedure.al_state import request_state
from catenary.procedure.configure import configure_mailbox, configure_process_data
from catenary.procedure.exchange import Procedure, Request, read, write, write_memory
from catenary.procedure.idn_commands import PRE_OP_STEPS, SAFE_OP_STEPS, run_idn_commands
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.modules import prepare_modules
from catenary.procedure.pdo import read_mapping, verify_mapping, write_downloads, write_in_safe_op
from catenary.procedure.register_commands import run_commands
from catenary.procedure.sii import read_identity
from catenary.procedure.sii_owner import hand_over
from catenary.procedure.station import Station, answered
from catenary.procedure.stations import FMMU_BLOCK, SYNC_MANAGER_BLOCK
from catenary.procedure.telegrams import restore as restore_telegrams
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
    """One device that is present."""

    rank: int  # from 0, in the order in which a frame passes the devices
    station_address: int  # 0 if the device was powered up and has no address yet
    alias: int


def find_devices(at_most: int) -> Procedure[list[Presence]]:
    """Return the present devices, by position.

    The result is empty if a frame is lost, or if devices appear or disappear at the same time. Try
    again later. In a cut ring, the devices after the cut are counted but have no position.

    Args:
        at_most: Maximum number of devices to read.
    """
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
    present = [not reply.lost and reply.working_counter == 1 for reply in replies]
    reached = present.index(False) if False in present else len(present)
    if reached % 2 or any(present[reached:]) or any(reply.lost for reply in replies):
        return []
    replies = replies[:reached]
    addresses = [STATION_ADDRESS.unpack(reply.data) for reply in replies[0::2]]
    aliases = [STATION_ALIAS.unpack(reply.data) for reply in replies[1::2]]
    return [Presence(rank, *each) for rank, each in enumerate(zip(addresses, aliases, strict=True))]


def give_address(presence: Presence, station: Station) -> Procedure[None]:
    """Set the station address of a present device.

    Args:
        presence: The device.
        station: Its position and station address.
    """
    [reply] = yield [write(EcatCommand.APWR, -presence.rank, STATION_ADDRESS, station.address)]
    answered(reply, station, "station address")


def forget_address(presence: Presence) -> Procedure[None]:
    """Clear the station address of an unknown device, so that addresses stay unique."""
    yield [write(EcatCommand.APWR, -presence.rank, STATION_ADDRESS, 0)]


def identify(station: Station) -> Procedure[Identity]:
    """Take the EEPROM from the device's processor, and read the identity."""
    replies = yield [
        write(EcatCommand.FPWR, station.address, SII_CONFIGURATION, CONFIGURATION_FORCE),
        write(EcatCommand.FPWR, station.address, SII_CONFIGURATION, 0),
    ]
    for reply in replies:
        answered(reply, station, "EEPROM access")
    return (yield from read_identity(station))


def bring_to_pre_op(
    station: Station,
    channel: MailboxChannel | None,
    commands: Sequence[RegisterCommand] = (),
) -> Procedure[None]:
    """Bring a device from any state through INIT to PRE-OP.

    In INIT, its FMMUs, SyncManagers and SYNC signals are cleared, its mailbox is configured, and
    its EEPROM is assigned to its processor.

    Args:
        station: The device.
        channel: Its mailbox; None if it has none.
        commands: Register commands of an ENI.
    """
    yield from request_state(station, AlState.INIT)
    requests = [
        _cleared(station, *FMMU_BLOCK),
        _cleared(station, *SYNC_MANAGER_BLOCK),
    ]
    for reply in (yield requests):
        answered(reply, station, "FMMUs and SyncManagers")
    # A device without clocks does not answer.
    yield [write(EcatCommand.FPWR, station.address, ACTIVATION, 0)]
    if channel is not None:
        yield from configure_mailbox(channel)
    yield from hand_over(station)
    yield from run_commands(station, commands, "IP")
    yield from request_state(station, AlState.PRE_OP)


def bring_to_safe_op(
    station: Station,
    channel: MailboxChannel | None,
    device: DeviceDescription,
    plan: DevicePlan,
    clock: Procedure[None] | None = None,
) -> Procedure[None]:
    """Write the start-up list and the process-data configuration, and request SAFE-OP.

    The device must be in PRE-OP. The mapping is read first, because the power-up may have
    changed it.

    Args:
        station: The device.
        channel: Its mailbox; None if it has none.
        device: Its description.
        plan: Its plan.
        clock: The procedure that sets its clock, run before the request; None without a clock.
    """
    if channel is not None and device.coe:
        found, again = yield from prepare_modules(channel, device, plan)
        found = yield from read_mapping(channel, found)
        again = renewed(again, found)
        yield from write_downloads(channel, found, again)
        if again.mapping_changed:
            yield from verify_mapping(channel, device, again)
    if channel is not None:
        yield from run_idn_commands(channel, device.idn_commands, PRE_OP_STEPS)
        yield from run_idn_commands(channel, plan.idns, PRE_OP_STEPS)
    if channel is not None and device.sercos_axes:
        yield from restore_telegrams(channel, device)
    yield from configure_process_data(station, device, plan)
    yield from run_commands(station, plan.registers, "PS")
    if clock is not None:
        yield from clock
    yield from request_state(station, AlState.SAFE_OP)
    yield from write_in_safe_op(channel, plan)
    if channel is not None:
        yield from run_idn_commands(channel, device.idn_commands, SAFE_OP_STEPS)
    yield from run_commands(station, plan.registers, "SO")


def _cleared(station: Station, start: int, size: int) -> Request:
    return write_memory(station.address, start, bytes(size), repeatable=True)
