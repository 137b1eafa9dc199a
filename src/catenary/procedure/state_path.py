"""State changes of one device through intermediate states, ETG.1000.6 §6.4.1.

On the way up, no state may be skipped, and the device is configured between the states. On the way
down, all intermediate states may be skipped.
"""

from __future__ import annotations

import struct

from catenary.errors import EepromError
from catenary.model.describe import bootstrap_mailbox
from catenary.model.device import DeviceDescription, MailboxLayout
from catenary.plan.start_up import DevicePlan
from catenary.procedure.al_state import DeviceState, read_state, request_state
from catenary.procedure.configure import (
    configure_mailbox,
    configure_mailbox_areas,
    configure_process_data,
    disable_mailbox,
)
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.pdo import read_mapping
from catenary.procedure.register_commands import run_commands
from catenary.procedure.sii import read_words
from catenary.procedure.sii_owner import hand_over, with_eeprom
from catenary.procedure.station import Station
from catenary.wire.al import AlState
from catenary.wire.sii import BOOTSTRAP_WORD, MailboxArea

UPWARDS = (AlState.INIT, AlState.PRE_OP, AlState.SAFE_OP, AlState.OP)


def path(now: AlState | None, target: AlState) -> tuple[AlState, ...]:
    """Return the states to request, in order; only `target` if the device is already in it.

    Args:
        now: The present state; None if it is invalid.
        target: The final state.
    """
    if now is target:
        return (target,)
    # BOOT can be entered only from INIT, and left only for INIT.
    if now is None or AlState.BOOT in (now, target):
        start = () if now is AlState.INIT or target is AlState.INIT else (AlState.INIT,)
        return (*start, *(upwards(target) or (target,)))
    return upwards(target, above=now) or (target,)


def upwards(target: AlState, above: AlState = AlState.INIT) -> tuple[AlState, ...]:
    """Return the states after `above` up to `target`; only BOOT if `target` is BOOT.

    The result is empty if `target` is not higher than `above`.

    Args:
        target: The last state.
        above: The state before the first one.
    """
    if target is AlState.BOOT:
        return (AlState.BOOT,)
    return UPWARDS[UPWARDS.index(above) + 1 : UPWARDS.index(target) + 1]


def climb(
    station: Station, device: DeviceDescription, target: AlState
) -> Procedure[MailboxChannel | None]:
    """Bring a device to INIT, PRE-OP or BOOT.

    On the way up to PRE-OP, its mailbox is configured, and its EEPROM is assigned to its processor.
    For BOOT, its bootstrap mailbox is configured instead of the standard one.

    Args:
        station: The device.
        device: Its description.
        target: The final state.

    Returns:
        The standard mailbox of the device if it was configured, otherwise None.

    Raises:
        StateError: The device refuses a state or takes too long.
        EepromError: The bootstrap mailbox, which BOOT requires, is not known.
    """
    channel = None
    before = (yield from read_state(station)).state
    for state in path(before, target):
        if state is AlState.PRE_OP and before not in (AlState.SAFE_OP, AlState.OP):
            channel = yield from _open_mailbox(station, device)
            yield from hand_over(station)
            yield from run_commands(station, device.register_commands, "IP")
        elif state is AlState.BOOT and before is not AlState.BOOT:
            yield from _open_bootstrap(station, device)
            yield from hand_over(station)  # a boot loader may write it; TwinCAT's ENI files agree
        yield from request_state(station, state)
        before = state
    return channel


def restart(station: Station, device: DeviceDescription) -> Procedure[DeviceDescription]:
    """Bring a device through INIT to PRE-OP, and return the description with its mapping.

    INIT is necessary even if the device is in PRE-OP, because it restarts the mailbox counters.

    Args:
        station: The device.
        device: Its description.
    """
    yield from request_state(station, AlState.INIT)
    channel = yield from climb(station, device, AlState.PRE_OP)
    if channel is None or not device.coe:
        return device
    return (yield from read_mapping(channel, device))


def bring_to_safe_op(
    station: Station, device: DeviceDescription, plan: DevicePlan
) -> Procedure[DeviceState]:
    """Configure the process data and bring a device from PRE-OP to SAFE-OP.

    The mapping is not changed.

    Args:
        station: The device.
        device: Its description.
        plan: Its plan.
    """
    yield from configure_process_data(station, device, plan)
    yield from run_commands(station, plan.registers, "PS")
    return (yield from request_state(station, AlState.SAFE_OP))


def _open_mailbox(station: Station, device: DeviceDescription) -> Procedure[MailboxChannel | None]:
    if device.mailbox is None:
        return None
    channel = MailboxChannel(station, device.mailbox)
    yield from disable_mailbox(station)  # it may still be that of BOOT
    yield from configure_mailbox(channel)
    return channel


def _open_bootstrap(station: Station, device: DeviceDescription) -> Procedure[None]:
    """Configure SyncManagers 0 and 1 with the bootstrap mailbox."""
    layout = device.bootstrap or (yield from read_bootstrap(station))
    yield from disable_mailbox(station)
    yield from configure_mailbox_areas(
        station,
        MailboxArea(layout.receive_offset, layout.receive_size),
        MailboxArea(layout.send_offset, layout.send_size),
    )


def read_bootstrap(station: Station) -> Procedure[MailboxLayout]:
    """Read the bootstrap mailbox from the EEPROM.

    Args:
        station: The device.

    Raises:
        EepromError: The EEPROM has none, or one that is not possible.
    """
    data = yield from with_eeprom(station, read_words(station, BOOTSTRAP_WORD, 4))
    numbers = struct.unpack("<4H", data)
    receive, send = MailboxArea(*numbers[:2]), MailboxArea(*numbers[2:])
    layout = bootstrap_mailbox(receive, send, "SII")
    if layout is not None:
        return layout
    if not (receive.size and send.size):
        what = "has no bootstrap mailbox in its EEPROM: it does not support BOOT"
    else:
        what = (
            f"has an invalid bootstrap mailbox in its EEPROM: {receive.size} bytes at "
            f"0x{receive.offset:04X} and {send.size} bytes at 0x{send.offset:04X}"
        )
    raise EepromError(
        f"{station} {what}",
        hint="only devices with firmware update over EtherCAT have one. If its manual describes "
        "BOOT, add the vendor's ESI file to the library: catenary esi add FILE",
    )
