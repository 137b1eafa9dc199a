"""The start of an arm is its first cycle with another commanded position."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed")

from benchmarks.common_start import Arm, figures

PERIOD_NS, UTC_NS = 2_000_000, 1_000_000_000_000


def arm(positions: list[float]) -> Arm:
    rows = np.zeros(len(positions), [("scheduled_ns", "<i8"), ("commanded_position", "<f8", (2,))])
    rows["scheduled_ns"] = PERIOD_NS * np.arange(len(positions))
    rows["commanded_position"][:, 1] = positions
    layout = SimpleNamespace(utc_offset_ns=UTC_NS)
    share = SimpleNamespace(layout=layout, rows=lambda after: (rows[after:], 0))
    return Arm(cast(Any, share), cast(Any, None))


@pytest.mark.parametrize(
    ("positions", "after", "cycle"),
    [([0.3, 0.3, 0.3, 0.4, 0.5], 0, 3), ([0.3, 0.3, 0.2, 0.2, 0.1], 2, 4)],
)
def test_the_first_cycle_that_moves(positions: list[float], after: int, cycle: int) -> None:
    assert arm(positions).start_ns(after) == UTC_NS + cycle * PERIOD_NS


@pytest.mark.parametrize("positions", [[], [0.3], [0.3, 0.3, 0.3]])
def test_an_arm_that_does_not_move(positions: list[float]) -> None:
    assert arm(positions).start_ns(0) is None


def test_the_figures() -> None:
    assert figures(np.array([3.0, 1.0, 2.0])) == {"min": 1.0, "p50": 2.0, "max": 3.0}
