"""Rings of rows: results of a reader that the writer overtakes during the copy."""

from __future__ import annotations

import pytest

from catenary.share._rows import Ring, memory_size

COUNT, SIZE = 8, 8
SLOTS, STRIDE = 64, 64  # offset of the first slot and distance of the slots, ring.h


class Overtaken:
    """A ring whose reader was paused after it had read `newest`."""

    def __init__(self, written: int) -> None:
        self.memory = bytearray(memory_size(COUNT, SIZE))
        self.ring = Ring(self.memory, 0, COUNT, SIZE, writable=True)
        for number in range(1, written + 1):
            self.ring.write(number.to_bytes(SIZE, "little"))

    def overwrite(self, number: int) -> None:
        """Mark the slot of this row as being overwritten by the row of the next round."""
        at = SLOTS + number % COUNT * STRIDE
        self.memory[at : at + 8] = (2 * (number + COUNT) + 1).to_bytes(8, "little")

    def after(self, number: int) -> tuple[list[int], int]:
        rows, lost = self.ring.copy_after(number)
        numbers = [
            int.from_bytes(rows[at : at + SIZE], "little") for at in range(0, len(rows), SIZE)
        ]
        return numbers, lost


def test_overwritten_rows_are_counted_as_lost() -> None:
    ring = Overtaken(8)
    ring.overwrite(1)
    ring.overwrite(2)
    assert ring.after(0) == ([3, 4, 5, 6, 7, 8], 2)


@pytest.mark.parametrize("gone", [[8], [6, 7, 8], [1, 2, 3, 4, 5, 6, 7, 8]])
def test_rows_after_the_last_copied_row_are_counted_by_the_next_call(gone: list[int]) -> None:
    """Otherwise they would be counted twice."""
    ring = Overtaken(8)
    for number in gone:
        ring.overwrite(number)
    rows, lost = ring.after(0)
    assert (rows, lost) == ([n for n in range(1, 9) if n not in gone], 0)
    for number in range(9, 17):
        ring.ring.write(number.to_bytes(SIZE, "little"))
    again, lost = ring.after(max(rows, default=0))
    assert (again, lost) == (list(range(9, 17)), len(gone))


def test_gap_between_rows_is_counted_as_lost() -> None:
    ring = Overtaken(8)
    ring.overwrite(4)
    assert ring.after(0) == ([1, 2, 3, 5, 6, 7, 8], 1)
