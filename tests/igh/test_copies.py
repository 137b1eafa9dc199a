"""Copies between devices on a double of the kernel master."""

from __future__ import annotations

import pytest

import catenary as cat
from tests.igh.double import Double

COUNTS = 1000  # position of the second drive


@pytest.mark.parametrize("execution", ["threaded", "inline"])
def test_the_cycle_copies_the_position_of_one_drive_to_the_other(
    main: cat.MainDevice, double: Double, execution: str
) -> None:
    first, second = main.subs
    copies = cat.Copies(cat.Copy(second, (0x6064, 0), first, (0x607A, 0)))
    with cat.Loop(copies, execution=execution) as loop:
        loop.run_for(0.01)
        assert double.value(0, 0x607A, 0) == COUNTS
        assert double.value(1, 0x607A, 0) == 0
    assert double.value(0, 0x607A, 0) == 0
