"""Published tables beside ours."""

from __future__ import annotations

import pytest

from catenary.bench.tables.published import COBOT
from catenary.bench.task_times import as_table, of_loop

TIMING = {
    "period": {"min": 990.0, "max": 1010.0, "mean": 1000.0, "sd": 2.0},
    "lateness": {"min": 1.0, "max": 20.0, "mean": 3.0, "sd": 0.5},
    "in_controller": {"min": 100.0, "max": 300.0, "mean": 130.0, "sd": 10.0},
}


def test_a_loop_responds_once_its_frame_is_sent() -> None:
    times = of_loop(TIMING)
    assert times.period == pytest.approx((0.99, 1.01, 1.0, 0.002))  # [ms]
    assert times.jitter == (1.0, 20.0, 3.0, 0.5)  # [us]
    assert times.response == (101.0, 320.0, 133.0, 10.5)


def test_what_is_published_stands_below_ours() -> None:
    lines = as_table(
        {"main control": of_loop(TIMING), "other": of_loop(TIMING)}, COBOT
    ).splitlines()
    assert [line.split()[0] for line in lines] == ["task", "main", "published", "other"]
    assert "133.5/339.4/225.2/19.4" in lines[2]
