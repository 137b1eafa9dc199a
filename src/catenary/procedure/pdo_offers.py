"""PDOs that a device offers, read before planning. Nothing is written to the device.

The returned descriptions note differences from the SII, include the PDOs that are not assigned,
and mark the PDOs and assignments that cannot be changed.
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
from catenary.procedure.sdo import OBJECT_MISSING, upload, upload_small
from catenary.procedure.sdo_information import describe_entry
from catenary.procedure.station import within
from catenary.wire.sdo_information import Access

MAPPING_TIMEOUT = 15.0  # [s] for the mapping of one device in a scan
OFFERS_MAX = 64  # number of PDOs read per direction; an EL6731 has 250


def read_first_mapping(
    channel: MailboxChannel, device: DeviceDescription
) -> Procedure[DeviceDescription]:
    """Read the mapping that the device reports. Return the description with it.

    Notes name the differences from the SII, or the reason why the mapping of the SII is used.

    Args:
        channel: The mailbox of the device.
        device: The description from the SII.
    """
    reading = within(MAPPING_TIMEOUT, channel.station, read_mapping(channel, device))
    try:
        found = yield from reading
    except (MappingError, MailboxError, ResponseTimeout) as error:
        note = f"its mapping cannot be read, so that of its SII is used: {error.message}"
        return replace(device, notes=(*device.notes, note))
    notes = [note for direction in Direction for note in _differences(device, found, direction)]
    return replace(found, notes=(*device.notes, *notes))


def read_offers(
    channel: MailboxChannel, device: DeviceDescription, direction: Direction
) -> Procedure[DeviceDescription]:
    """Read the PDOs that are not assigned. Return the description with them.

    PDOs and assignments that cannot be changed are marked as `fixed`. Use this function for a
    direction in which requested objects are missing. After a missing or malformed reply, the
    entries of the remaining PDOs are those of the SII.

    Args:
        channel: The mailbox of the device.
        device: The description.
        direction: Outputs or inputs.
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
        elif known[index].source and (yield from _is_missing(channel, index)):
            known[index] = replace(known[index], missing=True)
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
    """Read some objects, which a plan displays. Return the description with their values.

    The value is None if the device refuses. After a missing or malformed reply, the remaining
    objects are not read.

    Args:
        channel: The mailbox of the device.
        device: The description.
        places: Index and subindex of each object.
    """
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


def _is_missing(channel: MailboxChannel, index: int) -> Procedure[bool]:
    """Return True if the device reports that its dictionary does not have an object."""
    try:
        yield from upload_small(channel, index, 0)
    except SdoAbort as abort:
        return abort.code in OBJECT_MISSING
    return False


def _is_read_only(
    channel: MailboxChannel, device: DeviceDescription, index: int
) -> Procedure[bool]:
    """Return True if subindex 0 cannot be written in PRE-OP according to the dictionary.

    An entry without read access is inconclusive: some devices leave the access word empty.
    """
    if device.mailbox is None or not device.mailbox.sdo_information:
        return False
    entry, _ = yield from describe_entry(channel, index, 0)
    if entry is None:
        return False
    return bool(entry.access & READABLE) and Access.WRITE_PRE_OP not in entry.access


def _differences(
    described: DeviceDescription, found: DeviceDescription, direction: Direction
) -> Iterator[str]:
    """Yield the differences between ESI or SII and the dictionary; none without known PDOs."""
    if not described.pdos(direction):
        return
    source = described.mapping_source
    before = {each.sync_manager: each.pdos for each in described.assignments(direction)}
    known = {pdo.index: pdo for pdo in described.pdos(direction)}
    for each in found.assignments(direction):
        now = pdo_names(each.pdos, empty="none")
        then = pdo_names(before.get(each.sync_manager, ()), empty="none")
        if now != then:
            manager = f"SyncManager {each.sync_manager}"
            yield f"{manager} carries PDOs {now}, but its {source} specifies {then}"
        for pdo in each.pdos:
            other = known.get(pdo.index)
            if other is not None and shape(other) != shape(pdo):
                has = place_names(shape(pdo), empty="no entries")
                expected = place_names(shape(other), empty="no entries")
                where = f" ({other.source})" * bool(other.source)
                name = "ESI" if other.source else "SII"
                yield (
                    f"PDO 0x{pdo.index:04X} has {has}, but its {name}{where} specifies {expected}"
                )
