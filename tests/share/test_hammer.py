"""A native writer at full speed and a reader in another process: no record is torn."""

from __future__ import annotations

import ctypes
from pathlib import Path

import catenary as cat
from catenary.plan.sink import SinkField, SinkLayout
from tests.core.hammer import compiled
from tests.share.processes import started

ROWS = 1_000_000
CHUNK = 20_000
SIZES = (64, 640, 320)  # bytes of the blocks, as for a few axes

LAYOUT = SinkLayout(
    period=1e-6,
    axes=(),
    fields=(
        SinkField("number", "record", 0, "<u8"),
        SinkField("record", "record", 8, "<u8", SIZES[0] // 8 - 1),
        SinkField("actual", "actual", 0, "<u8", SIZES[1] // 8),
        SinkField("target", "target", 0, "<u8", SIZES[2] // 8),
    ),
    record_size=SIZES[0],
    actual_size=SIZES[1],
    target_size=SIZES[2],
    utc_offset_ns=0,
    virtual_time=True,
)

READER = """
import sys
import catenary as cat

def torn(rows):
    number = rows["number"][..., None]
    return sum(int((rows[part] != number).sum()) for part in ("record", "actual", "target"))

found = [0, 0, 0, 0, 0]  # records, rows, lost rows, torn, wrong
with cat.attach(sys.argv[1]) as share:
    print("attached", flush=True)
    after = 0
    while share.wait():
        for _ in range(20):
            found[0] += 1
            found[3] += torn(share.read())
        rows, lost = share.rows(after=after)
        numbers = rows["number"].tolist()
        found[1] += len(rows)
        found[2] += lost
        found[3] += torn(rows)
        found[4] += sorted(set(numbers)) != numbers or (bool(numbers) and numbers[0] <= after)
        if numbers:
            found[4] += numbers[-1] - after != len(rows) + lost and numbers[-1] == share.number
            after = max(numbers[-1], after)
print(*found, flush=True)
"""


def table_of(capsule: object) -> int:
    pointer = ctypes.pythonapi.PyCapsule_GetPointer
    pointer.restype, pointer.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    return int(pointer(capsule, b"catenary.sink"))


def test_a_million_rows_are_read_without_torn_records(name: str) -> None:
    hammer = compiled(Path(__file__).with_name("hammer.c"))
    with cat.Share(name, history=1e-6) as share:
        capsule = share.open(LAYOUT)
        assert share.layout.rows.count == 64  # the writer often overtakes the reader
        table = ctypes.c_void_p(table_of(capsule))
        with started(READER, name) as reader:
            assert reader.line() == "attached"
            written = 0
            while written < ROWS:
                hammer.hammer_sink(table, ctypes.c_uint64(written + 1), ctypes.c_uint64(CHUNK))
                written += CHUNK
            share.close()
            records, rows, lost, torn, wrong = map(int, reader.line().split())
    assert (torn, wrong) == (0, 0)
    assert records > 0
    assert rows > 0
    assert lost > 0  # the reader was overtaken and counted the loss
