"""NumPy records of a law: the blocks of the core, with their columns by name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
import numpy.typing as npt

from catenary.core import Engine
from catenary.plan.cycle import Bank, Column
from catenary.plan.request import RequestTables

Fields = Mapping[str, tuple[int, str, int | None]]  # name → offset, format, count
RecordType = np.dtype[np.void]

BANKS = {Bank.REAL: "reals", Bank.INTEGER: "integers", Bank.BIT: "bits"}


@dataclass(frozen=True, slots=True)
class LawLayout:
    """NumPy types of the blocks that a law reads and writes."""

    actual: RecordType
    target: RecordType


def law_layout(engine: Engine, tables: Sequence[RequestTables]) -> LawLayout:
    """Return the NumPy types for the laws of a loop."""
    (actual, target), (inputs, outputs) = engine.law_fields(), engine.blocks()
    return LawLayout(
        record_type(actual, (table.input_columns for table in tables), len(inputs)),
        record_type(target, (table.output_columns for table in tables), len(outputs)),
    )


def record_type(fields: Fields, columns: Iterable[Sequence[Column]], size: int) -> RecordType:
    """Return the NumPy type of a block.

    Empty fields are omitted. A column whose name is already in use is only in its bank's array.

    Args:
        fields: Fields of the block by name: (offset, format, count).
        columns: Columns of each request.
        size: Size of the block [bytes].
    """
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
    """Return every column as a field: a group as an array, a single column as a number.

    Names that occur several times are omitted.

    Args:
        fields: Fields of the block by name: (offset, format, count).
        columns: Columns of each request.
    """
    used = dict.fromkeys(Bank, 0)
    found: dict[str, tuple[int, str, int | None]] = {}
    twice: set[str] = set()
    for of_request in columns:
        for (group, bank), members in groupby(of_request, key=lambda c: (c.group, c.bank)):
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
    """Return the block as a record, without a copy, for a law that runs as Python.

    Args:
        block: Block of the core.
        layout: NumPy type of the block.
    """
    array: npt.NDArray[np.void] = np.frombuffer(block, layout)
    record: np.record = array.view(np.recarray)[0]
    return record
