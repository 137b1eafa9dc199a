"""PDO assignment (0x1C12, 0x1C13) and mapping (0x1600.., 0x1A00..), ETG.1000.6 §5.6.7.4.

Both can be written only in PRE-OP. A MainDevice clears subindex 0 first and sets it last. The size
of the result is checked.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from catenary.virtual.coe.dictionary import (
    ARRAY,
    CANNOT_BE_MAPPED,
    MAP_RX,
    MAP_TX,
    MAPPING_TOO_LONG,
    OUT_OF_RANGE,
    READ_ANY,
    RECORD,
    SUBINDEX_0_FIRST,
    UNSIGNED8,
    UNSIGNED16,
    UNSIGNED32,
    WRITE_PRE_OP,
    Abort,
    Dictionary,
    Entry,
)
from catenary.virtual.description import Pdo
from catenary.virtual.mapping_quirks import NO_MAPPING_QUIRKS, MappingQuirks

RX_ASSIGNMENT, TX_ASSIGNMENT = 0x1C12, 0x1C13
ENTRIES_MAX, PDOS_MAX = 32, 16
LOCAL_CONTROL = 0x0800_0021


class _Table:
    """Entries of one assignment or mapping: a count and the values.

    `allowed`: the PDOs that an assignment accepts; None for a mapping.
    """

    def __init__(
        self, values: Sequence[int], flag: int, allowed: Sequence[int] | None = None
    ) -> None:
        self.flag = flag
        self.allowed = allowed
        self.is_mapping = allowed is None
        self.data_type, self._form, size = (
            (UNSIGNED32, "<I", ENTRIES_MAX) if self.is_mapping else (UNSIGNED16, "<H", PDOS_MAX)
        )
        self.places = list(values) + [0] * (size - len(values))
        self.count = len(values)

    @property
    def values(self) -> list[int]:
        return self.places[: self.count]

    def read(self, place: int) -> bytes:
        return struct.pack(self._form, self.places[place])

    def unpack(self, data: bytes) -> int:
        return int(struct.unpack(self._form, data)[0])


@dataclass(frozen=True, slots=True)
class Placed:
    """Mapped object in the buffer of a SyncManager."""

    bit: int
    bits: int
    index: int
    subindex: int


class PdoObjects:
    """Selection and order of the objects in the process data of a device."""

    def __init__(
        self,
        dictionary: Dictionary,
        rx: Sequence[Pdo],
        tx: Sequence[Pdo],
        limit: int,
        quirks: MappingQuirks = NO_MAPPING_QUIRKS,
    ) -> None:
        self._dictionary = dictionary
        self._quirks = quirks
        self._limit_bits = 8 * limit
        self._mappings: dict[int, _Table] = {}
        self._assigned = {
            RX_ASSIGNMENT: self._add_direction(RX_ASSIGNMENT, "RxPDO assign", rx, MAP_RX),
            TX_ASSIGNMENT: self._add_direction(TX_ASSIGNMENT, "TxPDO assign", tx, MAP_TX),
        }

    def _add_direction(self, index: int, name: str, pdos: Sequence[Pdo], flag: int) -> _Table:
        for pdo in pdos:
            packed = [e.index << 16 | e.subindex << 8 | e.bits for e in pdo.entries]
            table = self._mappings[pdo.index] = _Table(packed, flag)
            self._add(pdo.index, pdo.name, table)
        assigned = [pdo.index for pdo in pdos if pdo.sync_manager != 0xFF]
        if self._quirks.power_up is not None:
            assigned = [pdo.index for pdo in pdos if pdo.index in self._quirks.power_up]
        table = _Table(assigned, flag, allowed=[pdo.index for pdo in pdos])
        self._add(index, name, table)
        return table

    def _add(self, index: int, name: str, table: _Table) -> None:
        """Add an assignment or mapping to the dictionary."""
        access = READ_ANY if self._fixed(table) == "declared" else READ_ANY | WRITE_PRE_OP
        count = Entry(
            "Subindex 000",
            UNSIGNED8,
            8,
            access,
            lambda: bytes([table.count]),
            partial(self._write_count, table),
        )
        places = {
            place + 1: Entry(
                f"Subindex {place + 1:03d}",
                table.data_type,
                32 if table.is_mapping else 16,
                access,
                partial(table.read, place),
                partial(self._write_place, table, place),
            )
            for place in range(len(table.places))
        }
        code = RECORD if table.is_mapping else ARRAY
        self._dictionary.add(index, name, {0: count, **places}, code=code)

    def _fixed(self, table: _Table) -> str:
        return self._quirks.fixed_pdos if table.is_mapping else self._quirks.fixed_lists

    def _write_count(self, table: _Table, data: bytes) -> None:
        if self._fixed(table) != "no":
            raise Abort(self._quirks.abort_code)
        count = data[0]
        if count > len(table.places):
            raise Abort(MAPPING_TOO_LONG if table.is_mapping else OUT_OF_RANGE)
        before, table.count = table.count, count
        try:
            self._check(table)
        except Abort:
            table.count = before
            raise

    def _write_place(self, table: _Table, place: int, data: bytes) -> None:
        if self._fixed(table) != "no":
            raise Abort(self._quirks.abort_code)
        if table.count:
            raise Abort(SUBINDEX_0_FIRST)
        value = table.unpack(data)
        if table.allowed is None:
            self._check_entry(value, table.flag)
        elif value not in table.allowed and value != 0:
            raise Abort(CANNOT_BE_MAPPED)
        table.places[place] = value

    def _check_entry(self, value: int, flag: int) -> None:
        index, subindex, bits = value >> 16, value >> 8 & 0xFF, value & 0xFF
        if index == 0:  # a gap
            return
        if index in self._quirks.refused_objects:
            raise Abort(CANNOT_BE_MAPPED)
        try:
            entry = self._dictionary.entry(index, subindex)
        except Abort:
            raise Abort(CANNOT_BE_MAPPED) from None
        if not entry.access & flag or entry.bits != bits:
            raise Abort(CANNOT_BE_MAPPED)

    def _check(self, table: _Table) -> None:
        if table.allowed is not None:
            if any(pdo not in table.allowed for pdo in table.values):
                raise Abort(CANNOT_BE_MAPPED)
            values = [value for pdo in table.values for value in self._mappings[pdo].values]
            places = [value >> 8 for value in values if value >> 16]
            if self._quirks.exclusive and len(set(places)) < len(places):
                raise Abort(LOCAL_CONTROL)
            bits = sum(value & 0xFF for value in values)
        else:
            for value in table.values:
                self._check_entry(value, table.flag)
            bits = sum(value & 0xFF for value in table.values)
        if bits > self._limit_bits:
            raise Abort(MAPPING_TOO_LONG)

    def placed(self, assignment: int) -> list[Placed]:
        """Return the mapped objects of one direction in buffer order, without gaps."""
        placed: list[Placed] = []
        bit = 0
        for pdo in self._assigned[assignment].values:
            for value in self._mappings[pdo].values:
                if value >> 16:
                    placed.append(Placed(bit, value & 0xFF, value >> 16, value >> 8 & 0xFF))
                bit += value & 0xFF
        return placed

    def size(self, assignment: int) -> int:
        """Return the buffer size of one direction [bytes]."""
        pdos = self._assigned[assignment].values
        bits = sum(value & 0xFF for pdo in pdos for value in self._mappings[pdo].values)
        return (bits + 7) // 8
