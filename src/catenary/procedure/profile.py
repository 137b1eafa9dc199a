"""Device type (object 0x1000) and slots of CiA 402 axes.

ETG.6010 §"Multi-axis": the objects of axis k are 0x800·k above those of the first axis. Modular
devices (profile 5001, ETG.5001) list the profiles of all slots in 0xF010.
"""

from __future__ import annotations

from dataclasses import replace

from catenary.errors import SdoAbort
from catenary.model.device import DeviceDescription, ObjectInformation
from catenary.model.text import printable
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.sdo import upload_small
from catenary.procedure.sdo_information import describe_entry
from catenary.wire.sdo_information import Access, EntryDescription

DEVICE_TYPE = 0x1000
STATUSWORD = 0x6041
MODULE_PROFILES = 0xF010
PROFILE_DRIVE = 402
PROFILE_MODULAR = 5001
SLOT_STRIDE = 0x800
SLOTS_MAX = 16  # 0x6000 to 0xDFFF
READABLE = Access.READ_PRE_OP | Access.READ_SAFE_OP | Access.READ_OP
WRITABLE = Access.WRITE_PRE_OP | Access.WRITE_SAFE_OP | Access.WRITE_OP


def read_profile(
    channel: MailboxChannel, device: DeviceDescription
) -> Procedure[DeviceDescription]:
    """Read the device type and the slots of CiA 402 axes. Return the description with them.

    The description is unchanged if the device refuses to read its device type.

    Args:
        channel: The mailbox of the device.
        device: The description.
    """
    data = yield from _upload_if_present(channel, DEVICE_TYPE, 0)
    if data is None:
        return device
    device_type = int.from_bytes(data[:4], "little")
    profile = device_type & 0xFFFF
    slots: tuple[int, ...] = ()
    if profile == PROFILE_DRIVE:
        slots = yield from _count_axes(channel)
    elif profile == PROFILE_MODULAR:
        slots = yield from _listed_axes(channel)
    return replace(device, device_type=device_type, slots=slots)


def read_object(
    channel: MailboxChannel, device: DeviceDescription, index: int, subindex: int
) -> Procedure[ObjectInformation]:
    """Read the description of a dictionary entry.

    If the device does not describe the entry (SDO information), the length is that of its value, or
    0 if the device refuses to read it. Only the device can then decide whether the entry can be
    mapped.

    Args:
        channel: The mailbox of the device.
        device: The description.
        index: The index of the object.
        subindex: The subindex of the entry.
    """
    note = ""
    if device.mailbox is not None and device.mailbox.sdo_information:
        entry, note = yield from describe_entry(channel, index, subindex)
        if entry is not None:
            return _information(entry)
    data = yield from _upload_if_present(channel, index, subindex)
    return ObjectInformation(index, subindex, 0 if data is None else 8 * len(data), note=note)


def _information(entry: EntryDescription) -> ObjectInformation:
    return ObjectInformation(
        entry.index,
        entry.subindex,
        entry.bit_length,
        entry.data_type,
        Access.RXPDO_MAPPABLE in entry.access,
        Access.TXPDO_MAPPABLE in entry.access,
        printable(entry.name),
        readable=bool(entry.access & READABLE) or not entry.access & WRITABLE,
    )


def _count_axes(channel: MailboxChannel) -> Procedure[tuple[int, ...]]:
    slots = [0]
    for slot in range(1, SLOTS_MAX):
        statusword = yield from _upload_if_present(channel, STATUSWORD + SLOT_STRIDE * slot, 0)
        if statusword is None:
            break
        slots.append(slot)
    return tuple(slots)


def _listed_axes(channel: MailboxChannel) -> Procedure[tuple[int, ...]]:
    count = yield from _upload_if_present(channel, MODULE_PROFILES, 0)
    slots = []
    for slot in range(min(int.from_bytes((count or b"")[:1], "little"), SLOTS_MAX)):
        data = yield from _upload_if_present(channel, MODULE_PROFILES, slot + 1)
        if data is not None and int.from_bytes(data[:2], "little") == PROFILE_DRIVE:
            slots.append(slot)
    return tuple(slots)


def _upload_if_present(
    channel: MailboxChannel, index: int, subindex: int
) -> Procedure[bytes | None]:
    """Read an object. Return None if the device refuses, for any reason."""
    try:
        return (yield from upload_small(channel, index, subindex))
    except SdoAbort:
        return None
