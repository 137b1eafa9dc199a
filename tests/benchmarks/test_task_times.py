"""Published tables beside ours."""

from __future__ import annotations

import pytest

from benchmarks.tables.published import COBOT
from benchmarks.task_times import as_table, of_loop

TIMING = {
    "period": {"min": 990e-6, "max": 1010e-6, "mean": 1000e-6, "sd": 2e-6},
    "lateness": {"min": 1e-6, "max": 20e-6, "mean": 3e-6, "sd": 0.5e-6},
    "in_controller": {"min": 100e-6, "max": 300e-6, "mean": 130e-6, "sd": 10e-6},
}


def test_a_loop_responds_once_its_frame_is_sent() -> None:
    times = of_loop(TIMING)
    assert times.period == pytest.approx((1.0, 1.01, 0.99, 0.002))  # [ms]
    assert times.jitter == pytest.approx((3.0, 20.0, 1.0, 0.5))  # [us]
    assert times.response == pytest.approx((133.0, 320.0, 101.0, 10.5))


def test_what_is_published_stands_below_ours() -> None:
    lines = as_table(
        {"main control": of_loop(TIMING), "other": of_loop(TIMING)}, COBOT
    ).splitlines()
    assert [line.split()[0] for line in lines] == ["task", "main", "published", "other"]
    assert "225.2/339.4/133.5/19.4" in lines[2]
