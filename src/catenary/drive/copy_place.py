"""Place of a copy in the process data of a device: a PDO, an object, or some bytes."""

from __future__ import annotations

import re
from dataclasses import dataclass
from difflib import get_close_matches
from typing import TypeAlias

from catenary.bus import SubDevice
from catenary.drive.modules import described
from catenary.errors import MappingError
from catenary.model.device import DeviceDescription, Direction, Entry, Pdo, mapped_pdos
from catenary.plan.numbers import ANY, Which
from catenary.plan.request import ImageLayout, ObjectReference

# Name of a PDO or an object, "0x1A00", "0x6000:01" or "bytes 0 to 5"; index of a PDO; (index,
# subindex); range of bytes
CopyPlace: TypeAlias = str | int | tuple[int, int] | range

_PDO = re.compile(r"0x([0-9A-Fa-f]{4})")
_OBJECT = re.compile(r"0x([0-9A-Fa-f]{4}):([0-9A-Fa-f]{1,2})")
_BYTES = re.compile(r"bytes (\d{1,4}) to (\d{1,4})")


@dataclass(frozen=True, slots=True)
class FoundPlace:
    """Resolved place of a copy. Exactly one of the last three fields is set."""

    device: DeviceDescription
    direction: Direction
    label: str  # text for messages, without the device
    pdo: int = 0
    entry: tuple[int, int, Which] | None = None  # index, subindex, and which of several places
    bytes: range | None = None

    def __str__(self) -> str:
        noun = self.direction.noun
        return f"{noun} of {self.device.position} {self.device.full_name}, {self.label}"

    def reference(self) -> ObjectReference | None:
        """Return the object to map; None if the place is not an object, or has no known length."""
        if self.entry is None or not self.entry[2].bit_length:
            return None
        return ObjectReference(*self.entry[:2], self.entry[2].bit_length)

    def bits(self, layout: ImageLayout) -> range:
        """Return the bits of the place in the image of its direction.

        Raises:
            MappingError: The place is not in the process data of the device.
        """
        if self.bytes is not None:
            return self._bits_of_bytes(layout, self.bytes)
        if self.entry is not None:
            return self._bits_of_entry(layout, *self.entry)
        bits = layout.pdo_bits(self.device.position, self.direction, self.pdo)
        if bits is None:
            raise MappingError(
                f"{self}: the PDO is not assigned",
                hint=f"assign it: ProcessData(sub, outputs={{}}, pdos=[0x{self.pdo:04X}, ...])",
            )
        return bits

    def _bits_of_bytes(self, layout: ImageLayout, chosen: range) -> range:
        own = layout.byte_range(self.device.position, self.direction)
        if chosen.stop > len(own):
            raise MappingError(
                f"{self}: the device has {len(own)} bytes of {self.direction.noun}",
                hint="print(main.plan(...)) shows the process data of each device",
            )
        return range(8 * (own.start + chosen.start), 8 * (own.start + chosen.stop))

    def _bits_of_entry(self, layout: ImageLayout, index: int, subindex: int, which: Which) -> range:
        find = layout.output if self.direction is Direction.OUTPUT else layout.input
        number = find(self.device.position, index, subindex, which)
        if number is None:
            raise MappingError(
                f"{self}: the object is not in the process data of the device",
                hint="choose PDOs that contain it, with pdos= of another request",
            )
        return range(number.bit_offset, number.bit_offset + number.bit_length)


def find_place(sub: SubDevice, direction: Direction, place: CopyPlace) -> FoundPlace:
    """Return the place of a copy.

    Args:
        sub: Device of the place.
        direction: Inputs for the source of a copy, outputs for its destination.
        place: The place; see `CopyPlace`.

    Raises:
        TypeError: The place has another type.
        ValueError: The range of bytes is not valid.
        MappingError: The device has no PDO and no object with this name, or several of them.
    """
    device = described(sub, None)
    if isinstance(place, str):
        return _from_text(device, direction, place)
    if isinstance(place, range):
        return _bytes(device, direction, place)
    if isinstance(place, int) and not isinstance(place, bool):
        return _pdo(device, direction, place)
    if isinstance(place, tuple) and [type(each) for each in place] == [int, int]:
        return _object(device, direction, *place)
    raise TypeError(
        f"{place!r} is not a place of a copy: give the name or index of a PDO, the name of an "
        "object, (index, subindex), or a range of bytes"
    )


def place_text(place: CopyPlace) -> str:
    """Return a place as text, as a machine file contains it."""
    if isinstance(place, range):
        return f"bytes {place.start} to {place.stop - 1}"
    if isinstance(place, tuple):
        return f"0x{place[0]:04X}:{place[1]:02X}"
    return f"0x{place:04X}" if isinstance(place, int) else place


def _from_text(device: DeviceDescription, direction: Direction, text: str) -> FoundPlace:
    if (pdo := _PDO.fullmatch(text)) is not None:
        return _pdo(device, direction, int(pdo[1], 16))
    if (found := _OBJECT.fullmatch(text)) is not None:
        return _object(device, direction, int(found[1], 16), int(found[2], 16))
    if (span := _BYTES.fullmatch(text)) is not None:
        return _bytes(device, direction, range(int(span[1]), int(span[2]) + 1))
    return _named(device, direction, text)


def _bytes(device: DeviceDescription, direction: Direction, chosen: range) -> FoundPlace:
    if not chosen or chosen.step != 1 or chosen.start < 0:
        raise ValueError(f"{chosen}: a range of bytes must have at least one byte, in order")
    return FoundPlace(device, direction, place_text(chosen), bytes=chosen)


def _pdo(device: DeviceDescription, direction: Direction, index: int) -> FoundPlace:
    known = [pdo for pdo in device.pdos(direction) if pdo.index == index]
    if not known:
        raise MappingError(
            f"{device}: no PDO 0x{index:04X} for {direction.noun}",
            hint=_known(device, direction),
        )
    return FoundPlace(device, direction, _pdo_label(known[0]), pdo=index)


def _object(
    device: DeviceDescription, direction: Direction, index: int, subindex: int
) -> FoundPlace:
    label = place_text((index, subindex))
    found = [
        (pdo, entry)
        for pdo, entry in _entries(device, direction)
        if (entry.index, entry.subindex) == (index, subindex)
    ]
    if not found:  # another request may map it
        return FoundPlace(device, direction, label, entry=(index, subindex, ANY))
    return _entry(device, direction, *found[0])


def _named(device: DeviceDescription, direction: Direction, name: str) -> FoundPlace:
    wanted = name.casefold()
    pdos = [pdo for pdo in _pdos(device, direction) if pdo.name.casefold() == wanted]
    entries = [e for e in _entries(device, direction) if e[1].name.casefold() == wanted]
    assigned = {pdo.index for pdo in mapped_pdos(device.assignments(direction))}
    if len(pdos) > 1:
        pdos = [pdo for pdo in pdos if pdo.index in assigned] or pdos
    if len(entries) > 1:
        entries = [each for each in entries if each[0].index in assigned] or entries
    if len(pdos) == 1:
        return _pdo(device, direction, pdos[0].index)
    if not pdos and len(entries) == 1:
        return _entry(device, direction, *entries[0])
    if not pdos and not entries:
        raise MappingError(
            f"{device}: no PDO and no object of its {direction.noun} has the name {name!r}",
            hint=_known(device, direction, name),
        )
    places = [f"0x{pdo.index:04X}" for pdo in pdos]
    places += [f"0x{e.index:04X}:{e.subindex:02X} in 0x{pdo.index:04X}" for pdo, e in entries]
    raise MappingError(
        f"{device}: {len(places)} places of its {direction.noun} have the name {name!r}: "
        f"{', '.join(places)}",
        hint="give the index of the PDO, or (index, subindex) of the object",
    )


def _entry(device: DeviceDescription, direction: Direction, pdo: Pdo, entry: Entry) -> FoundPlace:
    label = f"{place_text((entry.index, entry.subindex))} {entry.name}".rstrip()
    which = Which(pdo.index, entry.bit_length)
    return FoundPlace(device, direction, label, entry=(entry.index, entry.subindex, which))


def _pdos(device: DeviceDescription, direction: Direction) -> tuple[Pdo, ...]:
    """Return all PDOs of a direction, the assigned ones first."""
    assigned = mapped_pdos(device.assignments(direction))
    known = {pdo.index for pdo in assigned}
    return (*assigned, *(pdo for pdo in device.pdos(direction) if pdo.index not in known))


def _entries(device: DeviceDescription, direction: Direction) -> list[tuple[Pdo, Entry]]:
    pdos = _pdos(device, direction)
    return [(pdo, entry) for pdo in pdos for entry in pdo.entries if entry.index]


def _pdo_label(pdo: Pdo) -> str:
    return f"PDO 0x{pdo.index:04X} {pdo.name}".rstrip()


def _known(device: DeviceDescription, direction: Direction, name: str = "") -> str:
    """Return the names of the PDOs and objects, or those near `name`, as a hint."""
    pdos = _pdos(device, direction)
    if not pdos:
        return f"the device has no PDOs for {direction.noun}"
    names = [pdo.name for pdo in pdos if pdo.name]
    names += [entry.name for _, entry in _entries(device, direction) if entry.name]
    near = get_close_matches(name, names, n=3)
    shown = near or [_pdo_label(pdo) for pdo in pdos[:8]]
    return f"known: {', '.join(dict.fromkeys(shown))}"
