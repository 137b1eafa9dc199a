"""One device from any state to any other, by the states between, ETG.1000.6 §6.4.1: upwards none
may be skipped, and each needs something written before it is asked for. Downwards all may."""

from __future__ import annotations

import struct

from catenary.errors import EepromError
from catenary.model.device import DeviceDescription
from catenary.plan.start_up import DevicePlan
from catenary.procedure.al_state import DeviceState, read_state, request_state
from catenary.procedure.configure import (
    configure_mailbox,
    configure_mailbox_areas,
    configure_process_data,
)
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.pdo import read_mapping
from catenary.procedure.sii import read_words
from catenary.procedure.sii_owner import hand_over, with_eeprom
from catenary.procedure.station import Station
from catenary.wire.al import AlState
from catenary.wire.sii import BOOTSTRAP_WORD, MailboxArea

UPWARDS = (AlState.INIT, AlState.PRE_OP, AlState.SAFE_OP, AlState.OP)


def path(now: AlState | None, target: AlState) -> tuple[AlState, ...]:
    """The states to ask for in turn; `target` by itself where it is there already."""
    if now is target:
        return (target,)
    if now is None or AlState.BOOT in (now, target):  # no state at all; BOOT has one neighbour
        start = () if now is AlState.INIT or target is AlState.INIT else (AlState.INIT,)
        return (*start, *(upwards(target) or (target,)))
    return upwards(target, above=now) or (target,)


def upwards(target: AlState, above: AlState = AlState.INIT) -> tuple[AlState, ...]:
    """The states above one, up to another; none where that is below."""
    if target is AlState.BOOT:
        return (AlState.BOOT,)
    return UPWARDS[UPWARDS.index(above) + 1 : UPWARDS.index(target) + 1]


def climb(
    station: Station, device: DeviceDescription, target: AlState
) -> Procedure[MailboxChannel | None]:
    """Brings a device to INIT, PRE-OP or BOOT. Its mailbox, where it was opened on the way."""
    channel = None
    before = (yield from read_state(station)).state
    for state in path(before, target):
        if state is AlState.PRE_OP and before not in (AlState.SAFE_OP, AlState.OP):
            channel = yield from _open_mailbox(station, device)
            yield from hand_over(station)
        elif state is AlState.BOOT and before is not AlState.BOOT:
            yield from _open_bootstrap(station)
        yield from request_state(station, state)
        before = state
    return channel


def restart(station: Station, device: DeviceDescription) -> Procedure[DeviceDescription]:
    """From INIT to PRE-OP, with the mapping it has there. By INIT also where it is in PRE-OP: only
    then its mailbox is known to begin with the same counters as ours."""
    yield from request_state(station, AlState.INIT)
    channel = yield from climb(station, device, AlState.PRE_OP)
    if channel is None or not device.coe:
        return device
    return (yield from read_mapping(channel, device))


def bring_to_safe_op(
    station: Station, device: DeviceDescription, plan: DevicePlan
) -> Procedure[DeviceState]:
    """From PRE-OP to SAFE-OP with the mapping it has."""
    yield from configure_process_data(station, device, plan)
    return (yield from request_state(station, AlState.SAFE_OP))


def _open_mailbox(station: Station, device: DeviceDescription) -> Procedure[MailboxChannel | None]:
    if device.mailbox is None:
        return None
    channel = MailboxChannel(station, device.mailbox)
    yield from configure_mailbox(channel)
    return channel


def _open_bootstrap(station: Station) -> Procedure[None]:
    """SyncManagers 0 and 1 as the EEPROM has them for BOOT."""
    data = yield from with_eeprom(station, read_words(station, BOOTSTRAP_WORD, 4))
    numbers = struct.unpack("<4H", data)
    receive, send = MailboxArea(*numbers[:2]), MailboxArea(*numbers[2:])
    if not (receive.size and send.size):
        raise EepromError(
            f"{station} has no bootstrap mailbox in its EEPROM: it has no state BOOT",
            hint="devices that take firmware over EtherCAT have one",
        )
    yield from configure_mailbox_areas(station, receive, send)
