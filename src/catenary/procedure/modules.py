"""Modules of a modular device (ETG.5001): their idents are read, compared and written in PRE-OP."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from catenary.errors import ConfigurationError, MailboxError, ResponseTimeout, SdoAbort
from catenary.model.device import DeviceDescription, Direction, mapped_pdos
from catenary.model.module import (
    BY_IDENT,
    CONFIGURED_IDENTS,
    DETECTED_IDENTS,
)
from catenary.model.module_mapping import with_mapping_of, with_modules
from catenary.plan.modules import ModulePlan, ident_difference
from catenary.plan.start_up import DevicePlan, renewed
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.pdo import read_mapping, write_object
from catenary.procedure.sdo import OBJECT_MISSING, upload_small
from catenary.procedure.station import within

LISTS_TIMEOUT = 15.0  # [s] for both lists of idents in a scan


def read_module_lists(
    channel: MailboxChannel, device: DeviceDescription
) -> Procedure[DeviceDescription]:
    """Read 0xF050 and 0xF030 of a modular device. Return the description with them.

    A note names the reason if the device does not answer.

    Args:
        channel: The mailbox of the device.
        device: The description; returned unchanged if it is not modular.
    """
    if device.modular is None:
        return device
    reading = within(LISTS_TIMEOUT, channel.station, _read_lists(channel))
    try:
        detected, configured = yield from reading
    except (MailboxError, ResponseTimeout, SdoAbort) as error:
        note = f"the idents of its modules cannot be read: {error.message}"
        return replace(device, notes=(*device.notes, note))
    modular = replace(device.modular, detected=detected, configured=configured)
    return replace(device, modular=modular)


def _read_lists(
    channel: MailboxChannel,
) -> Procedure[tuple[tuple[int, ...] | None, tuple[int, ...] | None]]:
    detected = yield from read_idents(channel, DETECTED_IDENTS)
    configured = yield from read_idents(channel, CONFIGURED_IDENTS)
    return detected, configured


def read_idents(channel: MailboxChannel, index: int) -> Procedure[tuple[int, ...] | None]:
    """Return the idents of a list, by slot; None if the device does not have the list.

    Args:
        channel: The mailbox of the device.
        index: 0xF050 or 0xF030.

    Raises:
        SdoAbort: The device has the list, but refuses to read it.
    """
    try:
        count = (yield from upload_small(channel, index, 0))[:1]
    except SdoAbort as abort:
        if abort.code in OBJECT_MISSING:
            return None
        raise
    idents = []
    for subindex in range(1, int.from_bytes(count, "little") + 1):
        data = yield from upload_small(channel, index, subindex)
        idents.append(int.from_bytes(data[:4], "little"))
    return tuple(idents)


def prepare_modules(
    channel: MailboxChannel, device: DeviceDescription, plan: DevicePlan
) -> Procedure[tuple[DeviceDescription, DevicePlan]]:
    """Compare the detected modules with the plan, then write the configured idents.

    Nothing is written if the modules differ. After the idents were written, the device may have
    another mapping; it is read again. Return the description, and the plan with the mapping
    changes that are still needed.

    Args:
        channel: The mailbox of the device.
        device: The description with the present mapping.
        plan: The plan of the device.

    Raises:
        ConfigurationError: A slot has another module than the plan expects.
        SdoAbort: The device refuses an ident.
    """
    modules = plan.modules
    if modules is None:
        return device, plan
    yield from _check_detected(channel, modules)
    fitted = with_modules(device, modules.modules, modules.source)
    if not modules.downloads:
        return with_mapping_of(fitted, device), plan
    for step in modules.downloads:
        yield from write_object(channel, step)
    if fitted.modular is not None:
        modular = replace(fitted.modular, configured=modules.idents)
        fitted = replace(fitted, modular=modular)
    fitted = yield from read_mapping(channel, fitted)
    return fitted, renewed(plan, fitted)


def check_order(device: DeviceDescription, plan: DevicePlan) -> None:
    """Check that a device that assigns the PDOs of its modules itself has the order of the plan.

    Some gateways have read-only assignments, and fill them when 0xF030 is written (SOEM#358).

    Args:
        device: The description, read after 0xF030 was written.
        plan: The plan of the device.

    Raises:
        ConfigurationError: The order differs. A new plan from `device` has the right order.
    """
    if device.mailbox is None or device.mailbox.pdo_assign:
        return
    for direction in Direction:
        present = [pdo.index for pdo in mapped_pdos(device.assignments(direction))]
        planned = [pdo.index for pdo in mapped_pdos(plan.assignments(direction))]
        if present != planned and sorted(present) == sorted(planned):
            raise ConfigurationError(
                f"{device}: it assigned the {direction.noun} of its modules in the order "
                f"{_texts(present)}, and does not accept that of the plan, {_texts(planned)}",
                hint="start the loop again: its order is known now, and the plan uses it",
            )


def _texts(indices: Sequence[int]) -> str:
    return ", ".join(f"0x{index:04X}" for index in indices)


def _check_detected(channel: MailboxChannel, modules: ModulePlan) -> Procedure[None]:
    if modules.device.identify_by not in BY_IDENT:
        return
    detected = yield from read_idents(channel, DETECTED_IDENTS)
    different = "" if detected is None else ident_difference(modules, detected)
    if different:
        raise ConfigurationError(
            f"{channel.station}: its modules (0x{DETECTED_IDENTS:04X}) are not those of the plan "
            f"({modules.source}): {different}",
            hint="nothing was written; correct modules=, or plug the expected modules in and scan "
            "again",
        )
