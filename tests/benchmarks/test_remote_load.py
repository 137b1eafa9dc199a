"""The benchmark of the remote service: the evaluation of its runs."""

from __future__ import annotations

import numpy as np

from benchmarks.peers import MODULES
from benchmarks.remote_load import NAMES, as_aims, request_ratios
from catenary.bench.job import PHASES, Round
from catenary.bench.statistics import Run, combine


def run(name: str, phase_ns: int) -> Run:
    samples = np.full((100, len(PHASES)), phase_ns, dtype=np.int64)
    return combine(name, [Round(samples, lost=0, cpu_per_cycle_ns=1.0)] * 2)


def test_requests_are_compared_with_an_idle_client() -> None:
    runs = [run(name, 1100 if name.endswith("-requests") else 1000) for name in NAMES]
    ratios = request_ratios(runs)
    assert ratios["in_controller: catenary-inline-requests / catenary-inline-idle"] == 1.1
    assert set(NAMES) <= set(MODULES)
    assert as_aims(ratios).count("NOT REACHED") == 2
