"""Virtual devices from a clone: the facts of each device, and how they are connected."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from catenary.errors import ConfigurationError
from catenary.line import ClonedDevice, ClonedEntry, ClonedObject
from catenary.virtual.blueprint import RAM_MAX, SYNC_MANAGERS_MAX, Blueprint
from catenary.virtual.coe.object_facts import EntryFacts, ObjectFacts
from catenary.virtual.description import Description, FileFacts
from catenary.virtual.line_pdos import cloned_pdos
from catenary.virtual.mapping_quirks import MappingQuirks
from catenary.virtual.sii_blueprint import CHECKSUM_BYTE, decoded, describe_sii, ports_of
from catenary.virtual.wiring import Place
from catenary.wire.features import Information, PortKind
from catenary.wire.sdo_information import Access
from catenary.wire.sii import HEADER_SIZE, MailboxProtocol, Sii, checksum_of

FMMUS_MAX = 8  # of a virtual controller
ASSIGNMENTS = range(0x1C10, 0x1C30)
DEVICE_TYPE = 0x1000
ANY_READ = Access.READ_PRE_OP | Access.READ_SAFE_OP | Access.READ_OP
ANY_WRITE = Access.WRITE_PRE_OP | Access.WRITE_SAFE_OP | Access.WRITE_OP


def cloned_blueprint(device: ClonedDevice, folder: str) -> Blueprint:
    """Return the facts of a device of a clone.

    Args:
        device: The device.
        folder: Folder of the clone, for messages.

    Raises:
        ConfigurationError: The SII was not read, or is not valid.
    """
    where = f"{folder}: device {device.position} ({device.name})"
    if device.sii is None:
        reason = device.missing.get("sii", "no reason is given")
        raise ConfigurationError(
            f"{where}: its SII was not read: {reason}",
            hint="a twin needs the SII; stop the other program, then clone the segment again",
        )
    image = device.sii.ljust(HEADER_SIZE, b"\xff")
    sii = decoded(image, where)
    information = device.information
    clock = information.supports_clocks if information is not None else bool(sii.clock_modes)
    description = _described(device, describe_sii(sii, clock=clock), information)
    coe = MailboxProtocol.COE in sii.header.mailbox_protocols
    return Blueprint(
        description,
        image + bytes(len(image) % 2),
        _ports(device, information, sii),
        tuple(object_facts(each) for each in device.objects),
        exact=bool(device.objects),
        serves_coe=coe,
        information=_information(information),
        clock_bits=32 if information is not None and information.clock_bits == 32 else None,
        alias=None if device.alias == _loaded_alias(image, sii) else device.alias,
    )


def _loaded_alias(image: bytes, sii: Sii) -> int:
    """Return the alias that a controller loads. It ignores an image with a wrong checksum."""
    valid = image[CHECKSUM_BYTE] == checksum_of(image)
    return sii.header.station_alias if valid else 0


def parents(devices: Sequence[ClonedDevice]) -> dict[int, Place]:
    """Return the (device, port) that each device is connected to, except for the default.

    Args:
        devices: Devices of a clone.
    """
    return {
        device.position: (device.parent, device.parent_port)
        for device in devices
        if device.position
        and device.parent is not None
        and device.parent_port is not None
        and (device.parent, device.parent_port) != (device.position - 1, 1)
    }


def object_facts(each: ClonedObject) -> ObjectFacts:
    """Return the facts of one object of a clone."""
    return ObjectFacts(
        each.index,
        each.name,
        tuple(_entry(entry) for entry in each.entries),
        each.code,
        each.data_type,
        each.maximum_subindex,
    )


def _entry(entry: ClonedEntry) -> EntryFacts:
    """Return the facts of an entry. One without a description can be read and written."""
    value = entry.value
    described = bool(entry.bit_length or entry.access)
    return EntryFacts(
        entry.subindex,
        entry.name,
        entry.data_type,
        entry.bit_length if described else 8 * len(value or b""),
        int(entry.access) if described else int(ANY_READ | ANY_WRITE),
        value,
        entry.abort or 0,
    )


def _described(
    device: ClonedDevice, description: Description, information: Information | None
) -> Description:
    """Return the description of the SII, with what was read from the device itself."""
    assert description.facts is not None
    rx, tx = cloned_pdos(device, description)
    facts = replace(
        description.facts,
        device_type=_device_type(device, description.facts),
        sdo_information=any(each.code for each in device.objects),
    )
    description = replace(
        description,
        alias=device.alias,
        rx_pdos=rx,
        tx_pdos=tx,
        facts=facts,
        mapping_quirks=_permissions(device, description.mapping_quirks),
    )
    if information is None:
        return description
    return replace(
        description,
        lrw=information.supports_lrw,
        ram=min(max(description.ram, 1024 * information.ram_size), RAM_MAX),
        fmmu_count=min(max(information.fmmu_count, 1), FMMUS_MAX),
        sync_manager_count=_sync_managers(information, description),
    )


def _sync_managers(information: Information, description: Description) -> int:
    """Return the number of SyncManagers: at least those of the SII, and those of the mailbox."""
    named = len(description.sync_managers)
    needed = max(information.sync_manager_count, named, 2 if description.mailbox else 1)
    return min(needed, SYNC_MANAGERS_MAX)


def _device_type(device: ClonedDevice, facts: FileFacts) -> int:
    value = device.value(DEVICE_TYPE, 0)
    return int.from_bytes(value[:4], "little") if value else facts.device_type


def _permissions(device: ClonedDevice, by_sii: MappingQuirks) -> MappingQuirks:
    """Return which PDO objects are read-only: as their access rights tell, else as the SII."""
    lists = [each for each in device.objects if each.index in ASSIGNMENTS and _first(each)]
    if not lists:
        return by_sii
    fixed = not any(_first(each) & ANY_WRITE for each in lists)
    return MappingQuirks(fixed_lists="declared" if fixed else "no")


def _first(each: ClonedObject) -> Access:
    """Return the access rights of subindex 0."""
    entry = each.entry(0)
    return Access(0) if entry is None else entry.access


def _ports(device: ClonedDevice, information: Information | None, sii: Sii) -> tuple[int, ...]:
    if information is None:
        return ports_of(sii.general)
    usable = (PortKind.EBUS, PortKind.MII)
    found = tuple(port for port, kind in enumerate(information.ports) if kind in usable)
    return found if 0 in found else ports_of(sii.general)


def _information(information: Information | None) -> bytes:
    """Return the first registers; the virtual controller has at most 8 FMMUs and SyncManagers."""
    if information is None:
        return b""
    return replace(
        information,
        fmmu_count=min(information.fmmu_count, FMMUS_MAX),
        sync_manager_count=min(information.sync_manager_count, SYNC_MANAGERS_MAX),
    ).encode()
