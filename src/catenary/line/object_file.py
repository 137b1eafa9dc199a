"""objects.tsv: the object dictionary of a device, one line per object and per entry.

A line has eight fields, separated by tabs: index, subindex, type, bits, access, name, value, and
the reason for a missing value. The line of an object has no subindex. Its type is the object code
and the data type, and its bits are the largest subindex.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from catenary.errors import CloneError
from catenary.line.object_text import (
    abort_of,
    access_of,
    access_text,
    code_of,
    code_text,
    escaped,
    number_of,
    type_of,
    type_text,
    unescaped,
)
from catenary.line.values import ClonedEntry, ClonedObject

HEADINGS = ("index", "subindex", "type", "bits", "access", "name", "value", "reason")
FIELDS = len(HEADINGS)
EMPTY = "empty"  # a value of 0 bytes


def objects_text(objects: Sequence[ClonedObject]) -> str:
    """Return the text of a dictionary, in the order of the indices."""
    lines = ["\t".join(HEADINGS)]
    for each in sorted(objects, key=lambda each: each.index):
        lines.append(_object_line(each))
        lines += map(_entry_line, sorted(each.entries, key=lambda entry: entry.subindex))
    return "\n".join(lines) + "\n"


def _object_line(of: ClonedObject) -> str:
    kind = f"{code_text(of.code)} {type_text(of.data_type)}"
    name, reason = escaped(of.name), escaped(of.reason)
    return "\t".join(
        (f"0x{of.index:04X}", "", kind, str(of.maximum_subindex), "", name, "", reason)
    )


def _entry_line(of: ClonedEntry) -> str:
    reason = f"0x{of.abort:08X}" if of.abort is not None else escaped(of.reason)
    return "\t".join(
        (
            *(f"0x{of.index:04X}", f"0x{of.subindex:02X}", type_text(of.data_type)),
            *(str(of.bit_length), access_text(of.access), escaped(of.name)),
            *(_value_text(of.value), reason),
        )
    )


def _value_text(value: bytes | None) -> str:
    return "" if value is None else value.hex() or EMPTY


def parse_objects(text: str, file: str) -> tuple[ClonedObject, ...]:
    """Return the objects of a text.

    Args:
        text: The text.
        file: Name of the file, for errors.

    Raises:
        CloneError: A line is not valid.
    """
    objects: list[ClonedObject] = []
    entries: list[ClonedEntry] = []
    for number, fields in _rows(text, file):
        try:
            if fields[1]:
                entries.append(_entry(fields, objects, entries))
                continue
            if objects:
                objects[-1] = replace(objects[-1], entries=tuple(entries))
            entries = []
            objects.append(_object(fields, objects))
        except ValueError as error:
            raise CloneError(
                str(error), file=file, line=number, hint="correct the line, or clone again"
            ) from error
    if objects:
        objects[-1] = replace(objects[-1], entries=tuple(entries))
    return tuple(objects)


def _rows(text: str, file: str) -> Iterator[tuple[int, list[str]]]:
    """Yield the number and the fields of each line after the headings."""
    for number, line in enumerate(text.split("\n"), start=1):
        if number == 1:
            if line.split("\t") != list(HEADINGS):
                message = f"the first line must be the headings {', '.join(HEADINGS)}"
                raise CloneError(message, file=file, line=1, hint="separate them by tabs")
            continue
        if not line:
            continue
        fields = line.split("\t")
        if len(fields) != FIELDS:
            message = f"{len(fields)} fields, expected {FIELDS}"
            hint = "separate the fields by tabs; check that your editor kept them"
            raise CloneError(message, file=file, line=number, hint=hint)
        yield number, fields
    if not text.endswith("\n"):
        message = "the last line is not complete"
        raise CloneError(message, file=file, line=text.count("\n") + 1, hint="clone again")


def _object(fields: Sequence[str], before: Sequence[ClonedObject]) -> ClonedObject:
    index = number_of("index", fields[0], 0xFFFF)
    if before and before[-1].index >= index:
        raise ValueError(f"object 0x{index:04X} after 0x{before[-1].index:04X}: not ascending")
    code, _, data_type = fields[2].partition(" ")
    if fields[4] or fields[6]:
        raise ValueError("the line of an object has no access and no value")
    return ClonedObject(
        *(index, code_of(code), type_of(data_type)),
        number_of("bits", fields[3], 0xFF),
        unescaped(fields[5]),
        reason=unescaped(fields[7]),
    )


def _entry(
    fields: Sequence[str], objects: Sequence[ClonedObject], before: Sequence[ClonedEntry]
) -> ClonedEntry:
    index = number_of("index", fields[0], 0xFFFF)
    subindex = number_of("subindex", fields[1], 0xFF)
    if not objects or objects[-1].index != index:
        raise ValueError(f"entry 0x{index:04X}:{subindex:02X} without a line of its object before")
    if before and before[-1].subindex >= subindex:
        raise ValueError(
            f"entry 0x{index:04X}:{subindex:02X} after subindex 0x{before[-1].subindex:02X}: "
            "not ascending"
        )
    value = None if not fields[6] else b"" if fields[6] == EMPTY else _bytes(fields[6])
    abort = abort_of(fields[7])
    return ClonedEntry(
        *(index, subindex, type_of(fields[2]), number_of("bits", fields[3], 0xFFFF)),
        *(access_of(fields[4]), unescaped(fields[5]), value, abort),
        "" if abort is not None else unescaped(fields[7]),
    )


def _bytes(text: str) -> bytes:
    try:
        return bytes.fromhex(text)
    except ValueError as error:
        raise ValueError(f"value: not hexadecimal bytes: {error}") from error
