"""The object dictionary of a device, as text and as JSON."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from catenary.bus import SubDevice
from catenary.cli.failure import one_line
from catenary.cli.text import escaped
from catenary.errors import CatenaryError, MailboxError, ResponseTimeout, SdoAbort
from catenary.procedure.sdo_information import FAILURES, DescribedObject
from catenary.types import Value, by_index
from catenary.wire.sdo_information import Access, EntryDescription, ObjectCode, ObjectDescription

ANY_READ = Access.READ_PRE_OP | Access.READ_SAFE_OP | Access.READ_OP
ANY_WRITE = Access.WRITE_PRE_OP | Access.WRITE_SAFE_OP | Access.WRITE_OP
STATES = "PSO"  # PRE-OP, SAFE-OP, OP: bits 0 to 2 for reading, 3 to 5 for writing


@dataclass(frozen=True, slots=True)
class Row:
    """An entry, or the heading of an object with several entries."""

    index: int
    subindex: int | None  # None for a heading
    name: str
    type: str
    bit_length: int
    access: Access
    value: Value | None = None
    problem: str = ""  # reason for a missing value


def rows_of(device: SubDevice, notes: list[str], *, values: bool) -> Iterator[Row]:
    """Read all objects one by one, and yield their rows.

    If an object has no description, its row contains the reason.

    Args:
        device: The device to read.
        notes: Receives notes about missing descriptions.
        values: True to also read the values of readable entries.
    """
    known = device.sdo.list()
    notes += device.sdo.notes
    for each in known:
        if not (each.object_code or each.name):
            yield _undescribed(each, "not described")
            continue
        try:
            described = device.sdo.describe(each.index)
        except FAILURES as error:
            yield _undescribed(each, error.message)
            continue
        notes += described.notes
        yield from _rows(device, described, values)


def _undescribed(known: ObjectDescription, problem: str) -> Row:
    return Row(known.index, None, known.name, "", 0, Access(0), problem=problem)


def _rows(device: SubDevice, described: DescribedObject, values: bool) -> Iterator[Row]:
    """Yield a heading for an object of several entries, and its entries."""
    single = described.description.object_code == ObjectCode.VAR
    if not single:
        yield Row(described.index, None, described.name, shape(described), 0, Access(0))
    for entry in described.entries:
        row = _row(entry, described.name if single and not entry.name else entry.name)
        readable = values and entry.access & Access.READ_PRE_OP
        yield _with_value(device, entry, row) if readable else row


def _row(entry: EntryDescription, name: str) -> Row:
    kind = type_name(entry.data_type)
    return Row(entry.index, entry.subindex, name, kind, entry.bit_length, entry.access)


def _with_value(device: SubDevice, entry: EntryDescription, row: Row) -> Row:
    try:
        data = device.sdo.read(entry.index, entry.subindex)
    except SdoAbort as error:
        return replace(row, problem=f"refused with 0x{error.code:08X}")
    except (MailboxError, ResponseTimeout) as error:
        return replace(row, problem=error.message)
    try:
        return replace(row, value=by_index(entry.data_type).decode(data))
    except (ValueError, CatenaryError):  # a manufacturer-specific type, or a wrong length
        return replace(row, value=data)


def shape(described: DescribedObject) -> str:
    try:
        return ObjectCode(described.description.object_code).name
    except ValueError:
        return f"code {described.description.object_code}"


def type_name(data_type: int) -> str:
    try:
        return by_index(data_type).name
    except ValueError:
        return f"0x{data_type:04X}"


def access_text(access: Access) -> str:
    """Return the access rights as text, such as "rw", "rwP RT" or "r"."""
    text = ""
    for letter, shift in (("r", 0), ("w", 3)):
        states = access >> shift & 0b111
        if states:
            where = "".join(STATES[bit] for bit in range(3) if states >> bit & 1)
            text += letter + (where if states != 0b111 else "")
    mapped = "R" * bool(access & Access.RXPDO_MAPPABLE) + "T" * bool(access & Access.TXPDO_MAPPABLE)
    return f"{text or '-'} {mapped}".rstrip()


def as_lines(rows: Iterable[Row]) -> Iterator[str]:
    for row in rows:
        place = f"0x{row.index:04X}" + ("" if row.subindex is None else f":{row.subindex:02X}")
        access = "" if row.subindex is None else access_text(row.access)
        line = f"{place:9}  {row.type:14}  {access:9}  {escaped(row.name)}"
        yield f"{line}{_value_text(row)}".rstrip()


def _value_text(row: Row) -> str:
    if row.problem:
        return f"  ({one_line(row.problem)})"
    if row.value is None:
        return ""
    if isinstance(row.value, bytes):
        return f" = {row.value.hex(' ')}"
    if isinstance(row.value, str):
        return f" = {row.value!r}"  # also escapes control characters
    hexadecimal = f" (0x{row.value:X})" if isinstance(row.value, int) and row.value > 9 else ""
    return f" = {row.value}{hexadecimal}"


def as_json(rows: Iterable[Row]) -> str:
    return json.dumps([_json(row) for row in rows], indent=2)


def _json(row: Row) -> dict[str, object]:
    value = row.value.hex() if isinstance(row.value, bytes) else row.value
    return {
        "index": row.index,
        "subindex": row.subindex,
        "name": row.name,
        "type": row.type,
        "bits": row.bit_length,
        "access": access_text(row.access),
        "value": value,
        "problem": row.problem or None,
    }
