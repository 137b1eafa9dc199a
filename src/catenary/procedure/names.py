"""Names and data types of mapped entries, and names of PDOs, from the object dictionary.

They complete the SII, which may contain neither names nor types. An entry without a data type would
be read as an unsigned integer. SOEM's slaveinfo.c also reads the dictionary (SDO information,
ETG.1000.6 §5.6.3). Names are optional, so a missing or negative answer is not an error.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from catenary.errors import MailboxError, ResponseTimeout, SdoAbort
from catenary.model.device import DeviceDescription, Direction, Entry, Pdo, mapped_pdos
from catenary.model.text import printable
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.sdo_information import (
    FAILURES_MAX,
    describe_entry,
    read_object_description,
)
from catenary.procedure.station import Deadline
from catenary.types import by_index
from catenary.wire.sdo_information import ObjectCode, ObjectDescription

TIMEOUT = 5.0  # [s] for all names of one device


def name_entries(
    channel: MailboxChannel, device: DeviceDescription
) -> Procedure[DeviceDescription]:
    """Read the names and data types of the assigned entries, and the names of the assigned PDOs.

    Return the description with those that are known. The ESI completes what the device lacks.

    Args:
        channel: The mailbox of the device.
        device: The description.
    """
    if device.mailbox is None or not (device.mailbox.coe and device.mailbox.sdo_information):
        return _documented(device)
    dictionary = _Names(channel)
    for direction in Direction:
        for pdo in mapped_pdos(device.assignments(direction)):
            named = yield from dictionary.name(pdo)
            if named != pdo:
                device = _with_pdo(device, direction, named)
    return _documented(device)


def _documented(device: DeviceDescription) -> DeviceDescription:
    """Return the description with the names and types that only the ESI dictionary has."""
    if not device.documented:
        return device
    for direction in Direction:
        for pdo in mapped_pdos(device.assignments(direction)):
            entries = tuple(_completed_by_esi(device, entry) for entry in pdo.entries)
            if entries != pdo.entries:
                device = _with_pdo(device, direction, replace(pdo, entries=entries))
    return device


def _completed_by_esi(device: DeviceDescription, entry: Entry) -> Entry:
    known = device.documented_object(entry.index, entry.subindex) if entry.index else None
    if known is None or (entry.name and entry.data_type and entry.unit):
        return entry
    named = _completed(entry, entry.name or known.name, known.data_type)
    return replace(named, unit=known.unit, enumeration=known.enumeration)


class _Names:
    """Object descriptions of one dictionary. Each is read at most once."""

    def __init__(self, channel: MailboxChannel) -> None:
        self._channel = channel
        self._deadline = Deadline(TIMEOUT)
        self._objects: dict[int, ObjectDescription | None] = {}

    def name(self, pdo: Pdo) -> Procedure[Pdo]:
        """Return the PDO with its name and the names of its entries."""
        if not pdo.name:
            pdo = replace(pdo, name=(yield from self._object_name(pdo.index)))
        entries = []
        for entry in pdo.entries:
            is_nameless = entry.index and not entry.name
            entries.append((yield from self._named(entry)) if is_nameless else entry)
        return replace(pdo, entries=tuple(entries))

    def _named(self, entry: Entry) -> Procedure[Entry]:
        """Return the entry with its name, or with the name of its object if the entry has none."""
        known = yield from self._object(entry.index)
        if known is not None and known.object_code == ObjectCode.VAR:
            return _completed(entry, printable(known.name), known.data_type)
        if self._ended:
            return entry
        found, _ = yield from describe_entry(self._channel, entry.index, entry.subindex)
        name = printable(found.name) if found is not None else ""
        if not name and known and known.name:
            name = f"{printable(known.name)} {entry.subindex}"
        return _completed(entry, name, found.data_type if found is not None else 0)

    def _object_name(self, index: int) -> Procedure[str]:
        found = yield from self._object(index)
        return "" if found is None else printable(found.name)

    def _object(self, index: int) -> Procedure[ObjectDescription | None]:
        if index in self._objects or self._ended:
            return self._objects.get(index)
        self._objects[index] = None
        try:
            self._objects[index] = yield from read_object_description(self._channel, index)
            self._channel.undescribed = 0
        except SdoAbort:
            pass  # the object does not exist or has no description
        except (MailboxError, ResponseTimeout):
            self._channel.undescribed += 1
        return self._objects[index]

    @property
    def _ended(self) -> bool:
        """True if the device answers too slowly, or not at all."""
        late = self._deadline.passed_at(self._channel.received_ns)
        return late or self._channel.undescribed >= FAILURES_MAX


def _completed(entry: Entry, name: str, data_type: int) -> Entry:
    """Return the entry with a name. Add the data type if it is missing and the length agrees."""
    try:
        fits = by_index(data_type).bit_length == entry.bit_length
    except ValueError:
        fits = False
    return replace(entry, name=name, data_type=entry.data_type or data_type * fits)


def _with_pdo(device: DeviceDescription, direction: Direction, named: Pdo) -> DeviceDescription:
    """Return the description with all occurrences of one PDO replaced."""

    def renamed(pdos: Iterable[Pdo]) -> tuple[Pdo, ...]:
        return tuple(named if pdo.index == named.index else pdo for pdo in pdos)

    assigned = tuple(
        replace(each, pdos=renamed(each.pdos)) for each in device.assignments(direction)
    )
    return device.with_process_data(direction, assigned, renamed(device.pdos(direction)))
