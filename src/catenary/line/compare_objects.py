"""Comparison of two object dictionaries: objects, descriptions and values.

A value that the device changes by itself is `VARIABLE`: one that is mapped into a PDO, one that
cannot be written, and those of `CHANGING`. The identity is a change of its own.
"""

from __future__ import annotations

from collections.abc import Iterator

from catenary.line.change import ABSENT, Change, ChangedEntry, Part, Severity
from catenary.line.compare_mapping import ASSIGNMENTS, MAPPINGS, mapped_places
from catenary.line.sides import Sides
from catenary.line.value_text import type_name, value_text, value_texts
from catenary.line.values import SERIAL_WITHHELD, ClonedDevice, ClonedEntry, ClonedObject
from catenary.wire.sdo_information import Access

IDENTITY = 0x1018
MANUFACTURER_SERIAL = 0xF9F0  # ETG.5001
# Error register, error list, diagnosis messages, time stamp, time distribution
CHANGING = frozenset((0x1001, 0x1003, 0x10F3, 0x10F8, 0x10F9))
# Constant texts and numbers that identify hardware and software, although they cannot be written
IDENTIFYING = frozenset((0x1000, 0x1009, 0x100A, IDENTITY, MANUFACTURER_SERIAL))
NAME = 0x1008
TEXTS = frozenset((0x0009, 0x000A, 0x000B, 0x000F))  # types of variable length
_ANY_WRITE = Access.WRITE_PRE_OP | Access.WRITE_SAFE_OP | Access.WRITE_OP
_IDENTITY_FIELDS = {1: "vendor", 2: "product", 3: "revision", 4: "serial"}


def compare_objects(sides: Sides) -> Iterator[Change]:
    """Yield the changes of the objects that both sides have read.

    Args:
        sides: The device.
    """
    if not (sides.old.objects and sides.new.objects):
        return
    old, new = ({each.index: each for each in d.objects} for d in (sides.old, sides.new))
    mapped = mapped_places(sides.old, sides.new)
    for index in sorted({*old, *new}):
        before, now = old.get(index), new.get(index)
        if before is None or now is None:
            yield from _presence(sides, before, now)
        else:
            yield from _object(sides, before, now, mapped)


def _presence(sides: Sides, old: ClonedObject | None, new: ClonedObject | None) -> Iterator[Change]:
    """Yield an object that only one device has, if the other dictionary is complete."""
    found = new if old is None else old
    other = sides.old if old is None else sides.new
    if found is not None and "objects" not in other.missing:
        texts = (ABSENT, "present") if old is None else ("present", ABSENT)
        yield sides.change(Part.OBJECT, f"0x{found.index:04X} {found.name}".rstrip(), texts)


def _object(
    sides: Sides, old: ClonedObject, new: ClonedObject, mapped: set[tuple[int, int]]
) -> Iterator[Change]:
    entries = ({each.subindex: each for each in of.entries} for of in (old, new))
    before, now = next(entries), next(entries)
    if old.code and new.code and old.name != new.name:
        texts = f'"{old.name}"', f'"{new.name}"'
        yield sides.change(Part.OBJECT, f"0x{new.index:04X} name", texts, Severity.INFO)
    listing = new.index in ASSIGNMENTS or new.index in MAPPINGS  # see compare_mapping
    for subindex in sorted({*before, *now}):
        one, other = before.get(subindex), now.get(subindex)
        if one is None or other is None:
            tried = not (old.reason if one is None else new.reason)  # else not read
            if tried and not listing:
                yield from _entry_presence(sides, new, one, other)
            continue
        yield from _description(sides, new, one, other)
        if not listing:
            yield from _value(sides, new, one, other, mapped)


def _entry_presence(
    sides: Sides, of: ClonedObject, old: ClonedEntry | None, new: ClonedEntry | None
) -> Iterator[Change]:
    found = new if old is None else old
    other = sides.old if old is None else sides.new
    if found is None or "objects" in other.missing:
        return
    severity = Severity.VARIABLE if of.index in CHANGING else Severity.EFFECT
    texts = (ABSENT, "present") if old is None else ("present", ABSENT)
    yield sides.change(Part.OBJECT, _name(of, found), texts, severity)


def _name(of: ClonedObject, entry: ClonedEntry) -> str:
    """Return the address and the names of an entry."""
    names = (of.name, entry.name) if entry.name != of.name else (of.name,)
    text = ", ".join(name for name in names if name)
    return f"0x{entry.index:04X}:{entry.subindex:02X} {text}".rstrip()


def _description(
    sides: Sides, of: ClonedObject, old: ClonedEntry, new: ClonedEntry
) -> Iterator[Change]:
    """Yield a changed type, length or access, if both devices describe the entry."""
    if not (old.data_type and new.data_type):
        return
    name = _name(of, new)
    types = _type_text(old), _type_text(new)
    if types[0] != types[1]:
        yield sides.change(Part.OBJECT, f"{name}, type", types)
    if old.access != new.access:
        texts = _access_text(old.access), _access_text(new.access)
        yield sides.change(Part.OBJECT, f"{name}, access", texts)


def _type_text(entry: ClonedEntry) -> str:
    name = type_name(entry.data_type)
    return name if entry.data_type in TEXTS else f"{name}, {entry.bit_length} bits"


def _access_text(access: Access) -> str:
    return ", ".join(str(each.name).lower().replace("_", " ") for each in access) or "none"


def _value(
    sides: Sides,
    of: ClonedObject,
    old: ClonedEntry,
    new: ClonedEntry,
    mapped: set[tuple[int, int]],
) -> Iterator[Change]:
    if (old.value, old.abort) == (new.value, new.abort) or _explained(sides, new):
        return
    described = new if new.access else old
    severity = _severity(described, mapped)
    if old.value is not None and new.value is not None:
        texts = value_texts(described.data_type, old.value, new.value)
    elif old.reason or new.reason or _unread(old) or _unread(new):
        return  # not read on one side: see `missing_values`
    else:
        severity = Severity.INFO if severity is Severity.VARIABLE else severity
        texts = _outcome(old), _outcome(new)
    part = Part.SERIAL if of.index == MANUFACTURER_SERIAL else Part.OBJECT
    writable = bool(described.access & Access.WRITE_PRE_OP)
    kind = type_name(described.data_type)
    entry = ChangedEntry(new.index, new.subindex, kind, old.value, writable)
    yield sides.change(part, _name(of, new), texts, severity, _note(severity), entry)


def _note(severity: Severity) -> str:
    return "the device changes it by itself" if severity is Severity.VARIABLE else ""


def _unread(entry: ClonedEntry) -> bool:
    return entry.value is None and entry.abort is None


def _outcome(entry: ClonedEntry) -> str:
    """Return the value, or the refusal of the device."""
    if entry.value is None:
        return f"refused with 0x{entry.abort or 0:08X}"
    return value_text(entry.data_type, entry.value)


def _explained(sides: Sides, entry: ClonedEntry) -> bool:
    """Return True if the change follows from another identity in the EEPROM."""
    old, new = sides.old.identity, sides.new.identity
    if old is None or new is None:
        return False
    if entry.index == MANUFACTURER_SERIAL or (entry.index, entry.subindex) == (IDENTITY, 4):
        return not sides.serials or sides.exchanged
    field = _IDENTITY_FIELDS.get(entry.subindex) if entry.index == IDENTITY else None
    return field is not None and getattr(old, field) != getattr(new, field)


def _severity(entry: ClonedEntry, mapped: set[tuple[int, int]]) -> Severity:
    """Return the severity of a changed value."""
    if entry.index in IDENTIFYING:
        return Severity.EFFECT
    if entry.index == NAME:
        return Severity.INFO
    if entry.index in CHANGING or (entry.index, entry.subindex) in mapped:
        return Severity.VARIABLE
    if not entry.access:  # not described
        return Severity.INFO
    if entry.access & Access.WRITE_PRE_OP:
        return Severity.EFFECT
    return Severity.INFO if entry.access & _ANY_WRITE else Severity.VARIABLE


def missing_values(old: ClonedDevice, new: ClonedDevice) -> tuple[int, str]:
    """Return the number of values that only the earlier clone has, and the first reason.

    Args:
        old: The device in the earlier clone.
        new: The device in the present clone.
    """
    known = {
        each.index: {entry.subindex for entry in each.entries if entry.value is not None}
        for each in old.objects
    }
    reasons = []
    for each in new.objects:
        lost = known.get(each.index, set())
        for entry in each.entries:
            failed = _unread(entry) and entry.reason not in ("", SERIAL_WITHHELD)
            if failed and entry.subindex in lost:
                reasons.append(f"0x{entry.index:04X}:{entry.subindex:02X}: {entry.reason}")
        if each.reason:
            absent = lost - {entry.subindex for entry in each.entries}
            reasons += [f"0x{each.index:04X}: {each.reason}"] * len(absent)
    return len(reasons), reasons[0] if reasons else ""
