"""Objects of a virtual device from the dictionary of its ESI."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

from catenary import types
from catenary.esi.device import EsiDevice
from catenary.esi.dictionary import EsiObject, EsiObjectEntry
from catenary.esi.sii_process_data import type_number
from catenary.virtual.coe.dictionary import (
    FORMATS,
    MAP_RX,
    MAP_TX,
    READ_ANY,
    RECORD,
    UNSIGNED8,
    VARIABLE,
    WRITE_ANY,
    Entry,
    Variable,
    number,
)
from catenary.virtual.description import Pdo

ACCESS = {"ro": READ_ANY, "wo": WRITE_ANY, "rw": READ_ANY | WRITE_ANY}
SLOT_BITS_MAX = 64
TEXTS = (types.VISIBLE_STRING.index, types.OCTET_STRING.index, types.UNICODE_STRING.index)
BY_SIZE = {1: 0x01, 8: 0x05, 16: 0x06, 32: 0x07, 64: 0x1B}  # types of objects without a type
SlotEntry = Callable[[str, int, int, int, int], Entry]
Place = tuple[int, int]  # index and subindex
Objects = dict[int, tuple[str, dict[int, Entry]]]  # name and entries by index


def mapped_places(pdos: Collection[Pdo], flag: int) -> dict[Place, int]:
    """Return the objects in PDOs, and the access flag of their direction.

    Args:
        pdos: PDOs of one direction.
        flag: MAP_RX or MAP_TX.
    """
    return {
        (entry.index, entry.subindex): flag for pdo in pdos for entry in pdo.entries if entry.index
    }


def slots_of(rx: Collection[Pdo], tx: Collection[Pdo]) -> dict[Place, int]:
    """Return the slot of the model for each object in a PDO that has at most 64 bits.

    Args:
        rx: RxPDOs of the device.
        tx: TxPDOs of the device.
    """
    sizes: dict[Place, int] = {}
    for pdo in (*rx, *tx):
        for entry in pdo.entries:
            if entry.index:
                place = entry.index, entry.subindex
                sizes[place] = max(sizes.get(place, 0), entry.bits)
    small = [place for place, bits in sizes.items() if 0 < bits <= SLOT_BITS_MAX]
    return {place: slot for slot, place in enumerate(small)}


class EsiObjects:
    """Objects of one device: those of its dictionary, and those that only its PDOs name."""

    def __init__(
        self,
        device: EsiDevice,
        rx: Collection[Pdo],
        tx: Collection[Pdo],
        slot_entry: SlotEntry,
    ) -> None:
        self._device = device
        self._slot_entry = slot_entry
        self._slots = slots_of(rx, tx)
        self._flags: Mapping[Place, int] = _merged(
            mapped_places(rx, MAP_RX), mapped_places(tx, MAP_TX)
        )
        self._mapped = {
            (entry.index, entry.subindex): entry
            for pdo in (*rx, *tx)
            for entry in pdo.entries
            if entry.index
        }
        self.defaults: dict[int, bytes] = {}  # initial values by slot

    def make(self) -> Objects:
        """Return all objects. `defaults` then has the initial values of the slots."""
        found: Objects = {}
        dictionary = self._device.dictionary
        for each in dictionary.objects.values() if dictionary else ():
            found[each.index] = each.name, self._entries(each)
        for (index, subindex), entry in self._mapped.items():
            _, entries = found.setdefault(index, (entry.name, {}))
            if subindex not in entries:
                entries[subindex] = self._entry(
                    EsiObjectEntry(index, subindex, entry.name, "", entry.bits), entry.data_type
                )
        return {index: (name, _counted(entries)) for index, (name, entries) in found.items()}

    def _entries(self, each: EsiObject) -> dict[int, Entry]:
        dictionary = self._device.dictionary
        return {
            entry.subindex: self._entry(entry, type_number(entry.type, dictionary))
            for entry in each.entries
        }

    def _entry(self, entry: EsiObjectEntry, data_type: int) -> Entry:
        place = entry.index, entry.subindex
        mapped = self._flags.get(place, 0)
        access = ACCESS.get(entry.access, READ_ANY) | mapped | _mappable(entry.pdo_mapping)
        if mapped & MAP_RX:
            access |= READ_ANY | WRITE_ANY
        bits = entry.bit_length
        data_type = data_type or BY_SIZE.get(bits, 0)
        if data_type in FORMATS and FORMATS[data_type][0] != bits:
            data_type = 0  # a contradiction in the file: its length counts
        if place in self._slots and 0 < bits <= SLOT_BITS_MAX:
            slot = self._slots[place]
            self.defaults[slot] = _fitted(entry.default, bits)
            return self._slot_entry(entry.name, data_type, bits, slot, access)
        is_text = data_type in TEXTS
        value = (entry.default or b"") if is_text else _fitted(entry.default, bits)
        room = max(len(value), (bits + 7) // 8)
        variable = Variable(value, variable_length=is_text, limit=room)
        write = variable.write if access & WRITE_ANY else None
        return Entry(entry.name, data_type, bits, access, variable.read, write)


def _merged(one: Mapping[Place, int], other: Mapping[Place, int]) -> dict[Place, int]:
    return {place: one.get(place, 0) | other.get(place, 0) for place in (*one, *other)}


def _mappable(mapping: str) -> int:
    return (MAP_RX if "R" in mapping.upper() else 0) | (MAP_TX if "T" in mapping.upper() else 0)


def _fitted(default: bytes | None, bits: int) -> bytes:
    size = (bits + 7) // 8
    return (default or b"")[:size].ljust(size, b"\0")


def _counted(entries: dict[int, Entry]) -> dict[int, Entry]:
    """Return the entries with subindex 0, the number of the others."""
    if 0 in entries:
        return entries
    return {0: number("Number of entries", UNSIGNED8, max(entries, default=0)), **entries}


def code_of(entries: Mapping[int, Entry]) -> int:
    """Return the object code: a variable has only subindex 0."""
    return VARIABLE if set(entries) == {0} else RECORD
