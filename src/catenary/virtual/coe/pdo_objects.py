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
    WRONG_LENGTH,
    Abort,
    Dictionary,
    Entry,
)
from catenary.virtual.description import Channel, Pdo
from catenary.virtual.mapping_quirks import NO_MAPPING_QUIRKS, MappingQuirks

RX_ASSIGNMENT, TX_ASSIGNMENT = 0x1C12, 0x1C13
ENTRIES_MAX, PDOS_MAX = 32, 16
LOCAL_CONTROL = 0x0800_0021


class _Table:
    """Entries of one assignment or mapping: a count and the values.

    `allowed`: the PDOs that an assignment accepts; None for a mapping.
    """

    def __init__(
        self,
        values: Sequence[int],
        flag: int,
        allowed: Sequence[int] | None = None,
        *,
        fixed: bool = False,
    ) -> None:
        self.flag = flag
        self.allowed = allowed
        self.fixed = fixed
        self.is_mapping = allowed is None
        self.data_type, self._form, size = (
            (UNSIGNED32, "<I", ENTRIES_MAX) if self.is_mapping else (UNSIGNED16, "<H", PDOS_MAX)
        )
        size = len(values) if fixed else size
        self.places = list(values) + [0] * (size - len(values))
        self.count = len(values)

    @property
    def values(self) -> list[int]:
        return self.places[: self.count]

    def read(self, place: int) -> bytes:
        return struct.pack(self._form, self.places[place])

    def unpack(self, data: bytes) -> int:
        if len(data) != struct.calcsize(self._form):
            raise Abort(WRONG_LENGTH)
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
        channels: Sequence[Channel],
        rx: Sequence[Pdo],
        tx: Sequence[Pdo],
        quirks: MappingQuirks = NO_MAPPING_QUIRKS,
    ) -> None:
        self._dictionary = dictionary
        self._quirks = quirks
        self._mappings: dict[int, _Table] = {}
        self._pdos = {pdo.index: pdo for pdo in (*rx, *tx)}
        self._assigned: dict[int, _Table] = {}
        self._room = {channel.assignment: channel.room for channel in channels}
        for pdos, flag in ((rx, MAP_RX), (tx, MAP_TX)):
            for pdo in pdos:
                self._add_mapping(pdo, flag)
        for channel in channels:
            self._add_assignment(channel, rx if channel.outputs else tx)

    @property
    def indices(self) -> set[int]:
        """Indices of the assignments and mappings."""
        return {*self._mappings, *self._assigned}

    def _add_mapping(self, pdo: Pdo, flag: int) -> None:
        packed = [e.index << 16 | e.subindex << 8 | e.bits for e in pdo.entries]
        table = self._mappings[pdo.index] = _Table(packed, flag, fixed=pdo.fixed)
        self._add(pdo.index, pdo.name, table)

    def _add_assignment(self, channel: Channel, pdos: Sequence[Pdo]) -> None:
        assigned = [pdo.index for pdo in pdos if pdo.sync_manager == channel.sync_manager]
        if self._quirks.power_up is not None:
            assigned = [pdo.index for pdo in pdos if pdo.index in self._quirks.power_up]
        flag, name = (MAP_RX, "RxPDO assign") if channel.outputs else (MAP_TX, "TxPDO assign")
        table = _Table(assigned, flag, allowed=[pdo.index for pdo in pdos])
        self._assigned[channel.assignment] = table
        self._add(channel.assignment, name, table)

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
        if table.fixed:
            return "declared"
        return self._quirks.fixed_pdos if table.is_mapping else self._quirks.fixed_lists

    def _write_count(self, table: _Table, data: bytes) -> None:
        if self._fixed(table) != "no":
            raise Abort(self._quirks.abort_code)
        if len(data) != 1:
            raise Abort(WRONG_LENGTH)
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
        if not entry.mappable & flag or entry.bits != bits:
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
        if bits > 8 * max(self._room.values(), default=0):
            raise Abort(MAPPING_TOO_LONG)

    def contradicts(self, assignment: int) -> bool:
        """Return True if assigned PDOs exclude each other, or a mandatory PDO is not assigned.

        A PDO counts as missing only if no SyncManager carries it.
        """
        present = {pdo for table in self._assigned.values() for pdo in table.values}
        table = self._assigned[assignment]
        own = [self._pdos[pdo] for pdo in table.values if pdo in self._pdos]
        lacking = any(
            pdo.mandatory and pdo.index not in present and pdo.sync_manager + 0x1C10 == assignment
            for pdo in self._pdos.values()
        )
        return lacking or any(pdo.excludes & present for pdo in own)

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
