"""A native writer at full speed and the C reader: no row is torn."""

from __future__ import annotations

import ctypes
import threading

import numpy as np

import catenary as cat
from tests.core.hammer import compiled
from tests.share.c.compile import HERE
from tests.share.c.library import CError, Library
from tests.share.test_hammer import CHUNK, LAYOUT, table_of

READS = 20_000


def test_rows_are_never_torn(name: str, library: Library) -> None:
    hammer = compiled(HERE.parent / "hammer.c")
    done = threading.Event()
    with cat.Share(name, history=1e-6) as share:
        table = ctypes.c_void_p(table_of(share.open(LAYOUT)))

        def write() -> None:
            number = 1
            while not done.is_set():
                hammer.hammer_sink(table, ctypes.c_uint64(number), ctypes.c_uint64(CHUNK))
                number += CHUNK

        writer = threading.Thread(target=write)
        writer.start()
        try:
            numbers, overwritten = read_rows(library, name, share.layout.dtype)
        finally:
            done.set()
            writer.join()
        share.close()
    assert numbers == sorted(numbers)
    assert numbers[-1] > numbers[0]
    assert overwritten < READS


def read_rows(library: Library, name: str, dtype: np.dtype[np.void]) -> tuple[list[int], int]:
    """Read rows and check that each has one number everywhere.

    Return their numbers, and how many stored rows were overwritten before the second copy.
    """
    numbers, overwritten = [], 0
    with library.attach(name) as reader:
        assert library.checked("wait", reader.handle, 0, -1.0) == 1
        for _ in range(READS):
            number = reader.read()
            numbers.append(number)
            check(reader.row, dtype, number)
            try:
                reader.read_cycle(number)
                check(reader.row, dtype, number)
            except CError:
                overwritten += 1
    return numbers, overwritten


def check(row: ctypes.Array[ctypes.c_char], dtype: np.dtype[np.void], number: int) -> None:
    record = np.frombuffer(row, dtype)[0]
    assert record["number"] == number
    for part in ("record", "actual", "target"):
        assert (record[part] == number).all()
