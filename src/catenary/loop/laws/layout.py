"""What a law sees: the blocks of the core as NumPy records, with the columns by their names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
import numpy.typing as npt

from catenary.core import Engine
from catenary.plan.cycle import Bank, Column
from catenary.plan.request import WishTables

Fields = Mapping[str, tuple[int, str, int | None]]  # name → offset, format, count
RecordType = np.dtype[np.void]

BANKS = {Bank.REAL: "reals", Bank.INTEGER: "integers", Bank.BIT: "bits"}


@dataclass(frozen=True, slots=True)
class LawLayout:
    actual: RecordType
    target: RecordType


def law_layout(engine: Engine, tables: Sequence[WishTables]) -> LawLayout:
    """The records of a loop's law."""
    (actual, target), (inputs, outputs) = engine.law_fields(), engine.blocks()
    return LawLayout(
        record_type(actual, (table.input_columns for table in tables), len(inputs)),
        record_type(target, (table.output_columns for table in tables), len(outputs)),
    )


def record_type(fields: Fields, columns: Iterable[Sequence[Column]], size: int) -> RecordType:
    """Fields of no length are left out; a column whose name is taken keeps to its bank's array."""
    all_fields = {**named(fields, columns), **fields}
    present = {name: field for name, field in all_fields.items() if field[2] != 0}
    return np.dtype(
        {
            "names": list(present),
            "offsets": [offset for offset, _, _ in present.values()],
            "formats": [
                code if count is None else (code, (count,)) for _, code, count in present.values()
            ],
            "itemsize": size,
        }
    )


def named(
    fields: Fields, columns: Iterable[Sequence[Column]]
) -> dict[str, tuple[int, str, int | None]]:
    """Every column as a field of its own: a group as an array, a single one as a number."""
    used = dict.fromkeys(Bank, 0)
    found: dict[str, tuple[int, str, int | None]] = {}
    twice: set[str] = set()
    for of_wish in columns:
        for (group, bank), members in groupby(of_wish, key=lambda c: (c.group, c.bank)):
            columns_here = list(members)
            names = [group] if group else [column.name for column in columns_here]
            count = len(columns_here) if group else None
            for name in names:
                offset, code, _ = fields[BANKS[bank]]
                at = offset + used[bank] * np.dtype(code).itemsize
                used[bank] += 1 if count is None else count
                if name in found:
                    twice.add(name)
                found[name] = (at, code, count)
    return {name: field for name, field in found.items() if name not in twice}


def record_at(block: memoryview, layout: RecordType) -> np.record:
    """The block as the record a law gets when it runs as Python: no copy."""
    array: npt.NDArray[np.void] = np.frombuffer(block, layout)
    record: np.record = array.view(np.recarray)[0]
    return record
