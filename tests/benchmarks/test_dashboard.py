"""The benchmarks of the page: what is made of their runs. The runs themselves need minutes."""

from __future__ import annotations

import os
import time

import numpy as np

from benchmarks.dashboard_times import line
from benchmarks.dashboard_viewers import NAMES, as_aims, processor_time, viewer_ratios
from benchmarks.peers import MODULES
from benchmarks.peers.dashboard_parts import subscription
from catenary.bench.job import PHASES, Round
from catenary.bench.statistics import Run, combine


def run(name: str, phase_ns: int) -> Run:
    samples = np.full((100, len(PHASES)), phase_ns, dtype=np.int64)
    return combine(name, [Round(samples, lost=0, cpu_per_cycle_ns=1.0)] * 2)


def test_a_watched_loop_is_compared_with_one_that_is_not() -> None:
    runs = [run(name, 1030 if name.endswith("-viewers") else 1000) for name in NAMES]
    ratios = viewer_ratios(runs)
    name = "in_controller: catenary-inline-viewers / catenary-inline-others"
    assert ratios[name] == 1.03
    assert set(NAMES) <= set(MODULES)
    aims = as_aims(ratios, 0.12).splitlines()
    assert aims[0] == f"  {name}: 1.030, limit 1.02: NOT REACHED"
    assert aims[-1].endswith("33 axes and 4 viewers: 12.0% of a core, limit 15%: reached")


def test_processor_time_is_that_of_the_process() -> None:
    before = processor_time(os.getpid())
    while time.process_time() < before + 0.1:
        pass
    assert before < processor_time(os.getpid()) <= time.process_time() + 0.02


def test_viewers_request_all_axes() -> None:
    assert subscription(2)["signals"] == [
        f"{name}[{axis}]" for axis in (0, 1) for name in ("position", "velocity", "torque")
    ]


def test_delays_are_compared_with_their_limit() -> None:
    assert line("stop", [0.02, 0.01, 0.06], 0.05) == (
        "stop: median 20.0 ms, maximum 60.0 ms of 3, limit 50 ms: NOT REACHED"
    )
