"""Dictionary entries of a device that is described by a file: stored values and slots."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from catenary import types
from catenary.virtual import _segment
from catenary.virtual.coe.dictionary import (
    FORMATS,
    MAP_RX,
    MAP_TX,
    READ_ANY,
    UNSIGNED8,
    WRITE_ANY,
    Abort,
    Entry,
    Variable,
)
from catenary.virtual.coe.object_facts import EntryFacts, ObjectFacts, Place
from catenary.virtual.description import MappedEntry, Pdo
from catenary.virtual.devices.axis_places import WRITTEN, axis_offsets, axis_slots, has_sign

SLOT_BITS_MAX = 64
SLOTS_MAX = 0xFFFF  # of a device
TEXTS = (types.VISIBLE_STRING.index, types.OCTET_STRING.index, types.UNICODE_STRING.index)
BY_SIZE = {1: 0x01, 8: 0x05, 16: 0x06, 32: 0x07, 64: 0x1B}  # types of objects without a type


@dataclass(frozen=True, slots=True)
class Layout:
    """Slots of the model: first those of the axes, then the other objects that PDOs can carry."""

    slots: Mapping[Place, int]
    offsets: tuple[int, ...]  # of the objects of each axis
    count: int


def layout_of(objects: Sequence[ObjectFacts], pdos: Sequence[Pdo], *, moves: bool) -> Layout:
    """Return the slots of a device.

    Args:
        objects: Objects of the device.
        pdos: PDOs of both directions.
        moves: True if CiA 402 axes have motors.
    """
    sizes: dict[Place, int] = {}
    for place, entry in _mapped(pdos):
        sizes[place] = max(sizes.get(place, 0), entry.bits)
    known = {(each.index, entry.subindex): entry.bits for each in objects for entry in each.entries}
    present = {place: bits for place, bits in (sizes | known).items() if 0 < bits <= SLOT_BITS_MAX}
    records = {index for index, subindex in present if subindex}
    for index in records:  # subindex 0 is the number of entries
        present.pop((index, 0), None)
    offsets = axis_offsets(present) if moves else ()
    slots = {place: slot for place, slot in axis_slots(offsets).items() if place in present}
    first = _segment.SLOTS_PER_AXIS * len(offsets)
    carried = dict.fromkeys([*sizes, *_mappable(objects)])
    others = [
        place
        for place in carried
        if 0 < sizes.get(place, known.get(place, 0)) <= SLOT_BITS_MAX and place not in slots
    ]
    others = others[: SLOTS_MAX - first]
    slots |= {place: slot for slot, place in enumerate(others, start=first)}
    return Layout(slots, offsets, first + len(others))


class TwinObjects:
    """Entries of one device: those of its file, and those that only its PDOs name.

    `values`: initial values of the slots, after `make`.
    """

    def __init__(
        self,
        objects: Sequence[ObjectFacts],
        rx: Sequence[Pdo],
        tx: Sequence[Pdo],
        layout: Layout,
        slot_entry: Callable[..., Entry],
        *,
        presets: Mapping[int, int],
        exact: bool = False,
    ) -> None:
        """Initialise the maker.

        Args:
            objects: Objects of the file.
            rx: RxPDOs of the device.
            tx: TxPDOs of the device.
            layout: Slots of the model.
            slot_entry: `Application.slot_entry`.
            presets: Initial values of the slots of the axes.
            exact: True if the access rights of the file are those of the real device.
        """
        self._objects = objects
        self._layout = layout
        self._slot_entry = slot_entry
        self._presets = presets
        self._exact = exact
        self._mapped = dict(_mapped([*rx, *tx]))
        self._flags: dict[Place, int] = {}
        for pdos, flag in ((rx, MAP_RX), (tx, MAP_TX)):
            for place, _ in _mapped(pdos):
                self._flags[place] = self._flags.get(place, 0) | flag
        self.values: dict[int, int] = {}

    def make(self) -> dict[int, tuple[ObjectFacts, dict[int, Entry]]]:
        """Return all objects by index, with their entries.

        A real device that describes none of its objects also has those in its PDOs.
        """
        found = {
            each.index: (
                each,
                {entry.subindex: self._entry(each.index, entry) for entry in each.entries},
            )
            for each in self._objects
        }
        if self._exact and any(each.code for each in self._objects):
            return found
        for (index, subindex), mapped in self._mapped.items():
            facts, entries = found.setdefault(index, (ObjectFacts(index, mapped.name, ()), {}))
            if subindex not in entries:
                access = READ_ANY | (WRITE_ANY if self._flags[index, subindex] & MAP_RX else 0)
                named = EntryFacts(subindex, mapped.name, mapped.data_type, mapped.bits, access)
                entries[subindex] = self._entry(facts.index, named)
        return {index: (facts, _counted(entries)) for index, (facts, entries) in found.items()}

    def _entry(self, index: int, entry: EntryFacts) -> Entry:
        place = index, entry.subindex
        flags, bits = self._flags.get(place, 0), entry.bits
        access, data_type = entry.access, entry.data_type
        if not self._exact:
            access |= flags | (READ_ANY | WRITE_ANY if flags & MAP_RX else 0)
            data_type = data_type or BY_SIZE.get(bits, 0)
            if data_type in FORMATS and FORMATS[data_type][0] != bits:
                data_type = 0  # a contradiction in the file: its length counts
        slot = self._layout.slots.get(place)
        if slot is not None and 0 < bits <= SLOT_BITS_MAX:
            made = self._of_slot(place, replace(entry, access=access, data_type=data_type), slot)
        else:
            made = self._stored(replace(entry, access=access, data_type=data_type))
        read = _aborts(entry.abort) if entry.abort else made.read
        return replace(made, unlisted=flags, read=read)

    def _stored(self, entry: EntryFacts) -> Entry:
        is_text = entry.data_type in TEXTS
        value = (entry.value or b"") if is_text else self._fitted(entry)
        room = max(len(value), (entry.bits + 7) // 8)
        variable = Variable(value, variable_length=is_text, limit=room)
        write = variable.write if entry.access & WRITE_ANY else None
        return Entry(entry.name, entry.data_type, entry.bits, entry.access, variable.read, write)

    def _of_slot(self, place: Place, entry: EntryFacts, slot: int) -> Entry:
        is_axis = slot < _segment.SLOTS_PER_AXIS * len(self._layout.offsets)
        made = self._slot_entry(
            entry.name,
            entry.data_type,
            entry.bits,
            slot,
            entry.access,
            signed=has_sign(place) if is_axis else None,
        )
        if is_axis and (entry.value is None or slot % _segment.SLOTS_PER_AXIS in WRITTEN):
            return made
        data = self._fitted(entry)[: (entry.bits + 7) // 8]  # a device may send more
        signed = made.signed or len(data) == SLOT_BITS_MAX // 8  # a slot has 64 bits with a sign
        value = int.from_bytes(data, "little", signed=signed)
        if not value and self._presets.get(slot):
            return _unset(made, self._presets[slot])
        self.values[slot] = value
        return made

    def _fitted(self, entry: EntryFacts) -> bytes:
        """Return the value of an entry; with exact facts, in the length that was read."""
        size = (entry.bits + 7) // 8
        value = entry.value or b""
        return value if self._exact and value else value[:size].ljust(size, b"\0")


def _mappable(objects: Iterable[ObjectFacts]) -> Iterator[Place]:
    """Yield the objects that a MainDevice can map to a PDO."""
    for each in objects:
        for entry in each.entries:
            if entry.access & (MAP_RX | MAP_TX) and entry.data_type not in TEXTS:
                yield each.index, entry.subindex


def _mapped(pdos: Iterable[Pdo]) -> Iterator[tuple[Place, MappedEntry]]:
    for pdo in pdos:
        for entry in pdo.entries:
            if entry.index:
                yield (entry.index, entry.subindex), entry


def _aborts(code: int) -> Callable[[], bytes]:
    def read() -> bytes:
        raise Abort(code)

    return read


def _unset(entry: Entry, preset: int) -> Entry:
    """Return an entry that shows 0 while the model uses its preset.

    A drive whose file gives 0 for its torque limit or window would otherwise be unable to move.
    Any other value, from an SDO or from process data, is shown.

    Args:
        entry: Entry of a slot.
        preset: Initial value of the slot.
    """
    size = (entry.bits + 7) // 8
    hidden = (preset & (1 << entry.bits) - 1).to_bytes(size, "little")

    def read() -> bytes:
        value = entry.read()
        return bytes(size) if value == hidden else value

    return replace(entry, read=read)


def _counted(entries: dict[int, Entry]) -> dict[int, Entry]:
    """Return the entries with subindex 0, the number of the others."""
    if 0 in entries:
        return entries
    count = bytes([max(entries, default=0)])
    first = Entry("Number of entries", UNSIGNED8, 8, READ_ANY, lambda: count)
    return {0: first, **entries}
