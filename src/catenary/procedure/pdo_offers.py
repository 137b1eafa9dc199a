"""Reports of a device on its PDOs before a plan: differences from its SII, contents of PDOs that
are not assigned, and lists and entries that cannot be changed. Nothing is written.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from catenary.errors import MailboxError, MappingError, ResponseTimeout, SdoAbort
from catenary.model.device import Assignment, DeviceDescription, Direction, ObjectValue, mapped_pdos
from catenary.plan.pdo_mapping import ASSIGNMENT_BASE, shape
from catenary.plan.pdo_search import pdo_names, place_names
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.pdo import read_entries, read_list, read_mapping
from catenary.procedure.profile import READABLE
from catenary.procedure.sdo import upload
from catenary.procedure.sdo_information import describe_entry
from catenary.procedure.station import within
from catenary.wire.sdo_information import Access

MAPPING_TIMEOUT = 15.0  # [s] for the mapping of one device in a scan
OFFERS_MAX = 64  # PDOs read in one direction; an EL6731 has 250 of them


def read_first_mapping(
    channel: MailboxChannel, device: DeviceDescription
) -> Procedure[DeviceDescription]:
    """Return the description with the mapping that the device reports. Notes show where its SII
    differs, or why the SII's is used."""
    reading = within(MAPPING_TIMEOUT, channel.station, read_mapping(channel, device))
    try:
        found = yield from reading
    except (MappingError, MailboxError, ResponseTimeout) as error:
        note = f"its mapping cannot be read, its SII's is used: {error.message}"
        return replace(device, notes=(*device.notes, note))
    notes = [note for direction in Direction for note in _differences(device, found, direction)]
    return replace(found, notes=(*device.notes, *notes))


def read_offers(
    channel: MailboxChannel, device: DeviceDescription, direction: Direction
) -> Procedure[DeviceDescription]:
    """Return the description with the entries of PDOs that are not assigned, and with `fixed` as
    the dictionary says. For a direction in which objects are missing.

    After a reply that is missing or malformed, the entries of the other PDOs are those of the SII.
    """
    taken = {pdo.index for pdo in mapped_pdos(device.assignments(direction))}
    known = {pdo.index: pdo for pdo in device.pdos(direction)}
    for index in [index for index in known if index not in taken][:OFFERS_MAX]:
        try:
            words = yield from read_list(channel, index)
        except (MailboxError, ResponseTimeout):
            break
        if words is not None:
            entries = read_entries(words, known[index].entries)
            known[index] = replace(known[index], entries=entries)
    for index in taken & set(known):
        if (yield from _is_read_only(channel, device, index)):
            known[index] = replace(known[index], fixed=True)
    assignments = []
    for each in device.assignments(direction):
        locked = yield from _is_read_only(channel, device, ASSIGNMENT_BASE + each.sync_manager)
        pdos = tuple(known.get(pdo.index, pdo) for pdo in each.pdos)
        assignments.append(Assignment(each.sync_manager, pdos, each.fixed or locked))
    return device.with_process_data(direction, tuple(assignments), tuple(known.values()))


def read_values(
    channel: MailboxChannel, device: DeviceDescription, places: Sequence[tuple[int, int]]
) -> Procedure[DeviceDescription]:
    """Return the description with the values of these objects, for a plan to show. After a reply
    that is missing or malformed, the others are not read."""
    values = []
    for index, subindex in dict.fromkeys(places):
        try:
            data = yield from upload(channel, index, subindex)
        except SdoAbort:
            values.append(ObjectValue(index, subindex, None))
        except (MailboxError, ResponseTimeout):
            break
        else:
            values.append(ObjectValue(index, subindex, data))
    return replace(device, values=tuple(values))


def _is_read_only(
    channel: MailboxChannel, device: DeviceDescription, index: int
) -> Procedure[bool]:
    """Return True if the dictionary says that subindex 0 cannot be written in PRE-OP. An entry
    without any right to read it is inconclusive: some devices leave the access word empty."""
    if device.mailbox is None or not device.mailbox.sdo_information:
        return False
    entry, _ = yield from describe_entry(channel, index, 0)
    if entry is None:
        return False
    return bool(entry.access & READABLE) and Access.WRITE_PRE_OP not in entry.access


def _differences(
    described: DeviceDescription, found: DeviceDescription, direction: Direction
) -> Iterator[str]:
    """Yield the differences between the SII and the dictionary. An SII without PDOs has none."""
    if not described.pdos(direction):
        return
    before = {each.sync_manager: each.pdos for each in described.assignments(direction)}
    known = {pdo.index: pdo for pdo in described.pdos(direction)}
    for each in found.assignments(direction):
        now = pdo_names(each.pdos, empty="none")
        then = pdo_names(before.get(each.sync_manager, ()), empty="none")
        if now != then:
            yield f"SyncManager {each.sync_manager} carries PDOs {now}, its SII says {then}"
        for pdo in each.pdos:
            other = known.get(pdo.index)
            if other is not None and shape(other) != shape(pdo):
                has = place_names(shape(pdo), empty="no entries")
                said = place_names(shape(other), empty="no entries")
                yield f"PDO 0x{pdo.index:04X} has {has}, its SII says {said}"
