"""Rules for accesses through the gateway.

Without permission, only SDO uploads, SDO information and FoE reads pass. Permission for a device
allows all accesses, except those that are dangerous while one of its axes is enabled. A mailbox
message cannot change a state, so that BOOT needs no rule: in BOOT, a device has files only.
"""

from __future__ import annotations

from catenary.gateway.refusal import Reason, Refusal
from catenary.gateway.request import Access, Request
from catenary.gateway.transfer import Transfer
from catenary.model.device import DeviceDescription
from catenary.model.process_data import mapped_entries
from catenary.wire.mailbox import Type

# Mappings of RxPDOs and TxPDOs (0x16xx, 0x1Axx and the ranges after them), and their assignment
MAPPING = ((0x1600, 0x17FF), (0x1A00, 0x1BFF), (0x1C10, 0x1C2F))
FIRST_AXIS, LAST_AXIS, SLOT = 0x6000, 0xDFFF, 0x800  # objects of the axes of a device
CONTROL = (0x6040 % SLOT, 0x6060 % SLOT)  # controlword and modes of operation of each axis


def is_read(request: Request, transfer: Transfer | None) -> bool:
    """Return True if a message only reads.

    Args:
        request: Message of a client.
        transfer: Transfer that the message continues or ends; None if there is none.
    """
    if request.access in (Access.CONTINUE, Access.END):
        return transfer is not None and not transfer.writes
    return request.access is Access.READ


def is_dangerous(request: Request, transfer: Transfer | None, device: DeviceDescription) -> bool:
    """Return True if a message must not pass while an axis of the device is enabled.

    The subindex does not count: complete access writes several of them.

    Args:
        request: Message of a client.
        transfer: Transfer that the message continues; None if there is none.
        device: Description of the device, with its present mapping.
    """
    if is_read(request, transfer) or request.access is Access.END:
        return False
    first = request if transfer is None else transfer.first
    if first.index is None or first.message.type is not Type.COE:
        return True  # files, and messages that are not parsed
    return controls_motion(first.index, device)


def controls_motion(index: int, device: DeviceDescription) -> bool:
    """Return True if an object controls an axis, or belongs to the process data or their mapping.

    Args:
        index: Index of the object.
        device: Description of the device, with its present mapping.
    """
    if any(first <= index <= last for first, last in MAPPING):
        return True
    if FIRST_AXIS <= index <= LAST_AXIS and index % SLOT in CONTROL:
        return True
    mapped = mapped_entries((*device.outputs, *device.inputs))
    return any(entry.index == index for entry in mapped)


def not_allowed(request: Request) -> Refusal:
    """Return the refusal of a write without permission."""
    return Refusal(
        Reason.NOT_ALLOWED, f"{request.what}: write access is not enabled for this device"
    )


def axis_enabled(request: Request, why: str) -> Refusal:
    """Return the refusal of an access while an axis is enabled.

    Args:
        request: The request.
        why: The axes, or the reason for which their state is not known.
    """
    return Refusal(Reason.AXIS_ENABLED, f"{request.what}: {why}")
