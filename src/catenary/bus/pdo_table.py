"""PdoTable: the mapped process data of a device, as a printable sequence."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import overload

from catenary.model.device import DeviceDescription, Direction
from catenary.plan.numbers import entry_places
from catenary.types import by_index

NAMES_SHOWN = 4  # named values of one object
HEADINGS = ("PDO", "object", "name", "type", "bits", "bit offset")


@dataclass(frozen=True, slots=True)
class PdoRow:
    """One mapped object, or a gap. `bit_offset` counts from the first byte of its direction, as in
    `ProcessData.inputs` and `ProcessData.outputs`."""

    direction: Direction
    pdo: int
    pdo_name: str
    index: int  # 0 for a gap
    subindex: int
    name: str  # empty if neither the SII nor the dictionary has one
    type: str  # empty if unknown
    bit_length: int
    bit_offset: int
    unit: str = ""  # from the ESI file
    enumeration: tuple[tuple[int, str], ...] = ()  # values with texts, from the ESI file


class PdoTable(Sequence[PdoRow]):
    """Mapped objects of a device, outputs first. `print` shows them as a table."""

    def __init__(self, device: DeviceDescription) -> None:
        self._title = f"{device}, mapping from {device.mapping_source}"
        self._sizes = {
            direction: sum(each.byte_length for each in device.assignments(direction))
            for direction in Direction
        }
        self._rows = tuple(row for direction in Direction for row in _rows(device, direction))

    @overload
    def __getitem__(self, key: int) -> PdoRow: ...
    @overload
    def __getitem__(self, key: slice) -> tuple[PdoRow, ...]: ...
    def __getitem__(self, key: int | slice) -> PdoRow | tuple[PdoRow, ...]:
        return self._rows[key]

    def __len__(self) -> int:
        return len(self._rows)

    def __str__(self) -> str:
        lines = [self._title]
        for direction in Direction:
            lines.append(f"{direction.noun}: {self._sizes[direction]} bytes")
            lines.extend(_table([row for row in self._rows if row.direction is direction]))
        return "\n".join(lines)

    __repr__ = __str__


def _rows(device: DeviceDescription, direction: Direction) -> Iterator[PdoRow]:
    for pdo, entry, bit in entry_places(device.assignments(direction), 0):
        yield PdoRow(
            direction,
            pdo.index,
            pdo.name,
            entry.index,
            entry.subindex,
            entry.name,
            _type_name(entry.data_type),
            entry.bit_length,
            bit,
            entry.unit,
            entry.enumeration,
        )


def _type_name(data_type: int) -> str:
    try:
        return by_index(data_type).name
    except ValueError:
        return ""


def _table(rows: Sequence[PdoRow]) -> Iterator[str]:
    if not rows:
        return
    cells = [HEADINGS, *map(_cells, rows)]
    if any(row.unit or row.enumeration for row in rows):
        facts = ["unit, values", *map(_facts, rows)]
        cells = [(*each, fact) for each, fact in zip(cells, facts, strict=True)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    for each in cells:
        texts = (text.ljust(width) for text, width in zip(each, widths, strict=True))
        yield f"    {'  '.join(texts)}".rstrip()


def _facts(row: PdoRow) -> str:
    """Return the unit and the named values, `rad` or `8 = CSP, 9 = CSV`."""
    names = [f"{value} = {text}" for value, text in row.enumeration[:NAMES_SHOWN]]
    names += ["..."] * (len(row.enumeration) > NAMES_SHOWN)
    return ", ".join(filter(None, (row.unit, *names)))


def _cells(row: PdoRow) -> tuple[str, ...]:
    what = f"0x{row.index:04X}:{row.subindex:02X}" if row.index else "gap"
    kind = row.type or "?" * bool(row.index)
    return (
        f"0x{row.pdo:04X} {row.pdo_name}".rstrip(),
        what,
        row.name,
        kind,
        str(row.bit_length),
        str(row.bit_offset),
    )
