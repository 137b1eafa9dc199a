"""Description of a virtual device from an ESI: memory, SyncManagers, PDOs and rules."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from catenary.esi.device import EsiDevice, EsiEntry, EsiMailbox, EsiPdo, EsiSyncManager
from catenary.esi.sii_process_data import PART_BITS, type_number
from catenary.model.device import Direction
from catenary.virtual.blueprint import (
    BUFFER_MAX,
    EMULATION,
    RAM_LEAST,
    SYNC_MANAGERS_MAX,
    ram_for,
)
from catenary.virtual.description import (
    Channel,
    Description,
    FileFacts,
    MailboxDefault,
    MappedEntry,
    Pdo,
    SyncManagerDefault,
)
from catenary.virtual.mapping_quirks import MappingQuirks
from catenary.wire.sii import MailboxProtocol, Sii
from catenary.wire.sii_categories import CoeDetails, SyncManagerUse

MODULAR = 5001  # device profile without a number in the file
BITS_MAX = 255  # of an entry


def describe_esi(device: EsiDevice, sii: Sii, *, serial: int) -> Description:
    """Return the description of a virtual device.

    Args:
        device: The device, with its modules in place.
        sii: Its SII.
        serial: Serial number.
    """
    general, header = sii.general, sii.header
    mailbox = mailbox_of(device)
    return Description(
        name=device.name or device.type,
        order=device.type,
        group=device.group,
        product_code=device.key.product,
        serial=serial,
        alias=header.station_alias,
        emulation=bool(header.pdi_control & EMULATION),
        pdi_type=header.pdi_control & 0xFF,
        mailbox=mailbox,
        sync_managers=tuple(
            SyncManagerDefault(each.start, each.default_size, each.control, 1, int(each.use))
            for each in usable(device)
        ),
        fmmus=sii.fmmus,
        rx_pdos=pdos_of(device, Direction.OUTPUT),
        tx_pdos=pdos_of(device, Direction.INPUT),
        clock=device.has_clock,
        ram=ram_of(device),
        current_milliampere=general.current_ma if general else 0,
        mapping_quirks=_permissions(device.mailbox),
        lrw=not device.use_lrd_lwr,
        facts=FileFacts(
            vendor=device.key.vendor,
            revision=device.key.revision,
            channels=channels_of(device),
            device_type=device_type_of(device),
            sdo_information=device.mailbox is not None and device.mailbox.sdo_information,
            complete_access=device.mailbox is not None and device.mailbox.complete_access,
        ),
    )


def usable(device: EsiDevice) -> tuple[EsiSyncManager, ...]:
    """Return the SyncManagers that a virtual controller has."""
    return device.sync_managers[:SYNC_MANAGERS_MAX]


def mailbox_of(device: EsiDevice) -> MailboxDefault | None:
    """Return the mailboxes; None if the file gives no protocol or no size."""
    box = device.mailbox
    managers = {each.use: each for each in reversed(usable(device)) if each.default_size}
    receive = managers.get(SyncManagerUse.MAILBOX_OUT)
    send = managers.get(SyncManagerUse.MAILBOX_IN)
    if box is None or receive is None or send is None:
        return None
    details = CoeDetails.SDO if MailboxProtocol.COE in box.protocols else CoeDetails(0)
    return MailboxDefault(
        receive.start, receive.default_size, send.start, send.default_size, details
    )


def channels_of(device: EsiDevice) -> tuple[Channel, ...]:
    """Return the SyncManagers with process data: those that carry PDOs, or are made for them."""
    by_pdos = {pdo.sync_manager: pdo.direction for pdo in device.pdos}
    found = []
    for each in usable(device):
        if each.use in (SyncManagerUse.MAILBOX_OUT, SyncManagerUse.MAILBOX_IN):
            continue
        direction = by_pdos.get(each.index)
        outputs = each.use is SyncManagerUse.OUTPUTS or direction is Direction.OUTPUT
        if direction is not None or each.use in (SyncManagerUse.OUTPUTS, SyncManagerUse.INPUTS):
            room = each.max_size or BUFFER_MAX
            # SOEM leaves the length of the SII if no PDO is assigned (ec_config.c).
            found.append(Channel(each.index, outputs, each.start, room, each.default_size))
    return tuple(found)


def ram_of(device: EsiDevice) -> int:
    """Return the size of the memory from 0x1000 on, so that all buffers fit [bytes]."""
    buffers = []
    for each in usable(device):
        size = sum(pdo.bit_length for pdo in device.pdos if pdo.sync_manager == each.index) // 8 + 1
        buffers.append((each.start, max(size, each.default_size)))
    return ram_for(buffers, max(RAM_LEAST, device.controller.dpram_size))


def device_type_of(device: EsiDevice) -> int:
    """Return the value of object 0x1000."""
    entry = device.dictionary.entry(0x1000) if device.dictionary else None
    if entry is not None and entry.default:
        return int.from_bytes(entry.default[:4], "little")
    return device.profile or MODULAR


def _permissions(mailbox: EsiMailbox | None) -> MappingQuirks:
    """Return which PDO objects are read-only. A device without CoE has none."""
    return MappingQuirks(
        fixed_pdos="no" if mailbox and mailbox.pdo_configuration else "declared",
        fixed_lists="no" if mailbox and mailbox.pdo_assign else "declared",
    )


def pdos_of(device: EsiDevice, direction: Direction) -> tuple[Pdo, ...]:
    """Return the PDOs of one direction.

    If a file assigns PDOs that exclude each other, the device starts with the first one. Without
    CoE nothing can be chosen, so all of them stay assigned.

    Args:
        device: The device.
        direction: Outputs or inputs.
    """
    coe = device.mailbox is not None and MailboxProtocol.COE in device.mailbox.protocols
    assigned: dict[int, EsiPdo] = {}
    found = []
    for pdo in device.pdos_of(direction):
        rivals = [each for each in assigned.values() if pdo.index in each.excludes]
        rivals += [assigned[index] for index in pdo.excludes if index in assigned]
        if coe and rivals:
            pdo = replace(pdo, sync_manager=None, mandatory=False)
        elif not coe:
            pdo = replace(pdo, excludes=frozenset())
        if pdo.sync_manager is not None:
            assigned[pdo.index] = pdo
        found.append(_pdo(device, pdo))
    return tuple(found)


def _pdo(device: EsiDevice, pdo: EsiPdo) -> Pdo:
    return Pdo(
        pdo.index,
        pdo.name,
        tuple(part for entry in pdo.entries for part in _entry(device, entry)),
        0xFF if pdo.sync_manager is None else pdo.sync_manager,
        fixed=pdo.fixed,
        mandatory=pdo.mandatory,
        excludes=pdo.excludes,
    )


def _entry(device: EsiDevice, entry: EsiEntry) -> Iterator[MappedEntry]:
    """Yield an entry, in parts if its length does not fit into a byte, as in the SII."""
    data_type = type_number(entry.type, device.dictionary) if entry.type else 0
    left = entry.bit_length
    while left > 0:
        bits = left if left <= BITS_MAX else PART_BITS
        yield MappedEntry(entry.index, entry.subindex, bits, entry.name, data_type)
        left -= bits
