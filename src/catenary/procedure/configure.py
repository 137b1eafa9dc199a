"""Configuration of SyncManagers, FMMUs and the watchdog, ETG.1000.4 §6.3, §6.6, §6.7.

The SyncManagers of the mailbox are written in INIT, those of the process data in PRE-OP. The
watchdog is verified, because drives depend on it if the MainDevice fails.
"""

from __future__ import annotations

from catenary.errors import ConfigurationError, DecodeError
from catenary.model.device import DeviceDescription, Direction
from catenary.plan.layout import FmmuPlan, MailboxFmmu, SyncManagerPlan
from catenary.plan.start_up import WATCHDOG_DIVIDER, DevicePlan
from catenary.procedure.exchange import Procedure, Request, read, write
from catenary.procedure.mailbox import IN, OUT, MailboxChannel
from catenary.procedure.station import Station, answered
from catenary.wire import fmmu, register
from catenary.wire.datagram import EcatCommand
from catenary.wire.register import Register
from catenary.wire.sii import MailboxArea
from catenary.wire.sync_manager import (
    MAILBOX_IN,
    MAILBOX_OUT,
    WATCHDOG_TRIGGER,
    Activation,
    Control,
    Status,
    SyncManager,
)


def configure_mailbox(channel: MailboxChannel) -> Procedure[None]:
    """Write SyncManagers 0 and 1, and reset the mailbox state. The device must be in INIT."""
    layout = channel.layout
    yield from configure_mailbox_areas(
        channel.station,
        MailboxArea(layout.receive_offset, layout.receive_size),
        MailboxArea(layout.send_offset, layout.send_size),
    )
    channel.reset()


def configure_mailbox_areas(
    station: Station, receive: MailboxArea, send: MailboxArea
) -> Procedure[None]:
    """Write SyncManagers 0 and 1 for the standard or the bootstrap mailbox.

    The device must be in INIT.

    Args:
        station: The device.
        receive: The memory that the MainDevice writes.
        send: The memory that the MainDevice reads.
    """
    out = SyncManager(receive.offset, receive.size, MAILBOX_OUT)
    back = SyncManager(send.offset, send.size, MAILBOX_IN)
    yield from _write_all(
        station,
        [_sync_manager(station, OUT, out), _sync_manager(station, IN, back)],
        "mailbox SyncManagers",
    )


def disable_mailbox(station: Station) -> Procedure[None]:
    """Disable SyncManagers 0 and 1, so that another mailbox can be configured.

    An enabled SyncManager keeps its address and length (ET1100 datasheet, 0x0800).
    """
    requests = [_switched_off(station, OUT), _switched_off(station, IN)]
    yield from _write_all(station, requests, "mailbox SyncManagers")


def configure_process_data(
    station: Station, device: DeviceDescription, plan: DevicePlan
) -> Procedure[None]:
    """Write the SyncManagers and FMMUs of the process data, and the watchdog.

    The device must be in PRE-OP. All process-data SyncManagers are disabled first, because an
    enabled SyncManager keeps its length. Unused FMMUs are cleared, and the watchdog is verified.

    Args:
        station: The device.
        device: Its description.
        plan: Its plan.

    Raises:
        ConfigurationError: The watchdog registers or the trigger bits of the SyncManagers do not
            keep the written values, or a control byte of the SII is invalid.
    """
    planned = plan.layout.sync_managers
    possible = {each.index for each in device.sync_managers if not _is_mailbox(device, each.index)}
    requests = [
        _switched_off(station, index)
        for index in sorted(possible | {manager.index for manager in planned})
    ]
    requests += [_planned_manager(station, manager) for manager in planned]
    requests += [_planned_fmmu(station, each) for each in plan.layout.fmmus]
    if plan.layout.mailbox is not None:
        requests.append(_mailbox_fmmu(station, plan.layout.mailbox))
    used_fmmus = len(plan.layout.fmmus) + (plan.layout.mailbox is not None)
    for number in range(used_fmmus, min(device.controller.fmmu_count, register.FMMU_COUNT)):
        block = register.fmmu(number)
        requests.append(write(EcatCommand.FPWR, station.address, block, bytes(block.size)))
    watchdog = _watchdog_registers(plan)
    requests += [write(EcatCommand.FPWR, station.address, reg, value) for reg, value in watchdog]
    yield from _write_all(station, requests, "SyncManagers and FMMUs")
    yield from _verify_watchdog(station, plan, watchdog)


def _watchdog_registers(plan: DevicePlan) -> list[tuple[Register[int], int]]:
    """Return the watchdog registers and their values; empty for a device without outputs."""
    if not plan.layout.output_size:
        return []
    time = (register.WATCHDOG_TIME_PROCESS_DATA, plan.watchdog_count)
    return [(register.WATCHDOG_DIVIDER, WATCHDOG_DIVIDER), time] if plan.watchdog_ns else [time]


def _verify_watchdog(
    station: Station, plan: DevicePlan, written: list[tuple[Register[int], int]]
) -> Procedure[None]:
    """Read back the watchdog registers and trigger bits. Raise an error if one of them differs."""
    outputs = [m for m in plan.layout.sync_managers if m.direction is Direction.OUTPUT]
    expected = [(reg, value, ~0) for reg, value in written]
    expected += [
        (register.sync_manager_control(m.index), m.control, WATCHDOG_TRIGGER) for m in outputs
    ]
    if not expected:
        return
    replies = yield [read(EcatCommand.FPRD, station.address, reg) for reg, _, _ in expected]
    for (reg, value, mask), reply in zip(expected, replies, strict=True):
        found = reg.unpack(answered(reply, station, reg.name))
        if (found ^ value) & mask:
            raise _not_kept(station, reg, value, found, trigger=mask == WATCHDOG_TRIGGER)


def _not_kept(
    station: Station, reg: Register[int], written: int, found: int, *, trigger: bool
) -> ConfigurationError:
    digits = 2 * reg.size
    what = f" (bit 6, watchdog trigger: {bool(found & WATCHDOG_TRIGGER):d})" if trigger else ""
    return ConfigurationError(
        f"{station}: register 0x{reg.address:04X} ({reg.name}): wrote 0x{written:0{digits}X}, "
        f"read back 0x{found:0{digits}X}{what}: its outputs would not have the planned watchdog",
        hint="use watchdog=0 if the device has no process-data watchdog; it then keeps its last "
        "outputs after a crash",
    )


def _is_mailbox(device: DeviceDescription, index: int) -> bool:
    return device.mailbox is not None and index in (OUT, IN)


def _planned_manager(station: Station, plan: SyncManagerPlan) -> Request:
    try:
        control = Control.from_byte(plan.control)
    except DecodeError as error:
        raise ConfigurationError(
            f"{station}: its SII specifies an invalid control byte for SyncManager {plan.index}: "
            f"{error}",
            hint="its SII is wrong; ask the vendor for a corrected image",
        ) from error
    return _sync_manager(station, plan.index, SyncManager(plan.start, plan.length, control))


def _sync_manager(station: Station, index: int, block: SyncManager) -> Request:
    return write(EcatCommand.FPWR, station.address, register.sync_manager(index), block.encode())


def _switched_off(station: Station, index: int) -> Request:
    activation = register.sync_manager_activation(index)
    return write(EcatCommand.FPWR, station.address, activation, int(Activation(0)))


def _planned_fmmu(station: Station, plan: FmmuPlan) -> Request:
    block = fmmu.bits(
        plan.logical_start * 8,
        plan.physical_start * 8,
        plan.length * 8,
        reads=plan.direction is Direction.INPUT,
        writes=plan.direction is Direction.OUTPUT,
    )
    return write(EcatCommand.FPWR, station.address, register.fmmu(plan.index), block.encode())


def _mailbox_fmmu(station: Station, plan: MailboxFmmu) -> Request:
    status = register.sync_manager_status(IN).address
    full = 8 * status + int(Status.MAILBOX_FULL).bit_length() - 1
    block = fmmu.bits(plan.logical_bit, full, 1, reads=True)
    return write(EcatCommand.FPWR, station.address, register.fmmu(plan.index), block.encode())


def _write_all(station: Station, requests: list[Request], what: str) -> Procedure[None]:
    if not requests:
        return
    replies = yield requests
    for reply in replies:
        answered(reply, station, what)
