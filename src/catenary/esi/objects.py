"""Objects of an ESI dictionary (`Objects`; ETG.2000, ObjectType), with one entry per subindex.

The data type of an object gives its entries: a variable has one, a record one per member, an array
one per element. `Info` gives their default values, limits and units.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

from catenary.esi.data_types import (
    ELEMENTS_MAX,
    base_of,
    default_of,
    enumeration_of,
    read_access,
    read_data_types,
    read_pdo_mapping,
)
from catenary.esi.default_values import read_value
from catenary.esi.dictionary import (
    EsiDataType,
    EsiDictionary,
    EsiObject,
    EsiObjectEntry,
    EsiSubItem,
)
from catenary.esi.findings import Findings, text_of
from catenary.esi.xml import Element
from catenary.types import by_name

ENTRIES_MAX = 200_000  # in one dictionary; arrays make many entries from few bytes


class _Types(NamedTuple):
    """Data types of a dictionary, and their elements, which contain default values."""

    by_name: Mapping[str, EsiDataType]
    elements: Mapping[str, Element]


class _Part(NamedTuple):
    """Entry of an object before `Info` is applied."""

    subindex: int
    member: EsiSubItem
    default: Element | None = None


def read_dictionary(element: Element, findings: Findings) -> EsiDictionary:
    """Return a dictionary: its data types, and its objects by index.

    Args:
        element: The element `Dictionary`.
        findings: The warnings of the reader.
    """
    parent = element.find("DataTypes")
    declared = parent.all("DataType") if parent is not None else ()
    types = _Types(
        read_data_types(element, findings),
        {text_of(each, "Name"): each for each in reversed(declared)},
    )
    objects: dict[int, EsiObject] = {}
    parent = element.find("Objects")
    count = 0
    for each in parent.all("Object") if parent is not None else ():
        if count > ENTRIES_MAX:
            findings.warn(each, f"more than {ENTRIES_MAX} entries; further objects are ignored")
            break
        found = _object(each, types, findings)
        count += len(found.entries) if found is not None else 0
        if found is not None and found.index in objects:
            findings.warn(each, f"object 0x{found.index:04X} occurs again; the first one counts")
        elif found is not None:
            objects[found.index] = found
    return EsiDictionary(types.by_name, objects)


def _object(element: Element, types: _Types, findings: Findings) -> EsiObject | None:
    index = findings.required(element, "Index", bits=16)
    if index is None:
        return None
    type_name, name = text_of(element, "Type"), text_of(element, "Name")
    bit_length = findings.integer(element.find("BitSize"))
    flags = element.find("Flags")
    whole = EsiSubItem(
        name,
        type_name,
        bit_length,
        0,
        access=read_access(flags, findings, "ro"),
        pdo_mapping=read_pdo_mapping(flags),
    )
    parts = _parts(whole, types)
    entries = _entries(index, whole, parts, element, types.by_name, findings)
    return EsiObject(
        index=index,
        name=name,
        type=type_name,
        bit_length=bit_length,
        entries=tuple(sorted(entries, key=lambda entry: entry.subindex)),
        depends_on_slot=findings.flag(element.find("Index"), "DependOnSlot"),
        source=findings.source(element),
    )


def _parts(whole: EsiSubItem, types: _Types) -> list[_Part]:
    """Return the entries that the data type of an object declares."""
    found = types.by_name.get(whole.type)
    if found is not None and found.members:
        return list(_of_record(found, types))
    if found is not None and found.arrays and found.arrays[0].lower_bound > 0:
        return list(_of_array(whole, found, found.arrays[0].lower_bound))
    element = types.elements.get(whole.type)
    return [_Part(0, whole, default_of(element) if element is not None else None)]


def _of_record(record: EsiDataType, types: _Types) -> Iterator[_Part]:
    """Yield the members of a record. A member without a subindex follows the one before it.

    A member of an array type without a subindex stands for all elements of the array.
    """
    declared = types.elements[record.name].all("SubItem")
    following = 0
    for member, element in zip(record.members, declared, strict=True):
        array = types.by_name.get(member.type)
        if member.subindex is None and array is not None and array.arrays:
            first = max(array.arrays[0].lower_bound, following)
            for part in _of_array(member, array, first):
                following = part.subindex + 1
                yield part
            continue
        subindex = following if member.subindex is None else member.subindex
        if subindex > ELEMENTS_MAX:
            return
        following = subindex + 1
        yield _Part(subindex, member, default_of(element))


def _of_array(member: EsiSubItem, array: EsiDataType, first: int) -> Iterator[_Part]:
    """Yield the elements of an array."""
    count = 1
    for bounds in array.arrays:
        count = min(count * bounds.elements, ELEMENTS_MAX)
    length = array.bit_length // count if count else 0
    for subindex in range(first, min(first + count, ELEMENTS_MAX + 1)):
        name = f"SubIndex {subindex:03d}"
        yield _Part(
            subindex, replace(member, name=name, type=array.base or member.type, bit_length=length)
        )


def _entries(
    index: int,
    whole: EsiSubItem,
    parts: list[_Part],
    element: Element,
    types: Mapping[str, EsiDataType],
    findings: Findings,
) -> Iterator[EsiObjectEntry]:
    info = element.find("Info")
    infos = _infos_of(parts, info)
    unit = findings.number(info.find("Unit")) if info is not None else None  # of all elements
    seen: set[int] = set()
    for part, (name, each) in zip(parts, infos, strict=True):
        if part.subindex in seen:
            findings.warn(
                element,
                f"subindex {part.subindex} of 0x{index:04X} occurs again; the first one counts",
            )
            continue
        seen.add(part.subindex)
        entry = _entry(index, whole, part, types, findings, each, name)
        yield replace(entry, unit=unit) if unit and part.subindex and not entry.unit else entry


def _entry(
    index: int,
    whole: EsiSubItem,
    part: _Part,
    types: Mapping[str, EsiDataType],
    findings: Findings,
    info: Element | None,
    name: str,
) -> EsiObjectEntry:
    member = part.member
    base = base_of(member.type, types)
    bits = member.bit_length or _length_of(member.type, base, types)
    default = (default_of(info) if info is not None else None) or part.default
    return EsiObjectEntry(
        index=index,
        subindex=part.subindex,
        name=name or member.name,
        type=member.type,
        bit_length=bits,
        access=member.access or whole.access,
        pdo_mapping=member.pdo_mapping or (whole.pdo_mapping if part.subindex else ""),
        default=read_value(default, base, bits, findings),
        minimum=read_value(_limit(info, "Min"), base, bits, findings),
        maximum=read_value(_limit(info, "Max"), base, bits, findings),
        unit=findings.number(info.find("Unit")) if info is not None else None,
        enumeration=enumeration_of(member.type, types),
    )


def _limit(info: Element | None, which: str) -> Element | None:
    if info is None:
        return None
    return info.find(f"{which}Data") or info.find(f"{which}Value")


def _length_of(name: str, base: str, types: Mapping[str, EsiDataType]) -> int:
    found = types.get(name)
    if found is not None and found.bit_length:
        return found.bit_length
    try:
        return by_name(base).bit_length
    except ValueError:
        return 0


def _infos_of(parts: list[_Part], info: Element | None) -> list[tuple[str, Element | None]]:
    """Return the name and the `Info` of each entry.

    Names decide. Elements of arrays have only generic names in the data type, and some files
    translate names; then the position decides.
    """
    if info is None or not parts:
        return [("", None)] * len(parts)
    items = list(info.all("SubItem"))
    if not items:
        return [("", info)] * len(parts) if len(parts) == 1 else [("", None)] * len(parts)
    names = [text_of(item, "Name") for item in items]
    left: dict[str, list[int]] = {}
    for position, name in reversed(list(enumerate(names))):
        left.setdefault(name, []).append(position)
    found: list[int | None] = []
    for part in parts:
        same = left.get(part.member.name)
        found.append(same.pop() if same else None)
    used = set(found)
    if len(items) == len(parts):
        found = [
            at if at is not None or position in used else position
            for position, at in enumerate(found)
        ]
    return [("", None) if at is None else (names[at], items[at].find("Info")) for at in found]
