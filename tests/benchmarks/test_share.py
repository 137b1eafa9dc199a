"""The bench of the share: what is made of its runs. The runs themselves: test_peers.py."""

from __future__ import annotations

import numpy as np

from benchmarks.peers import MODULES
from benchmarks.share import NAMES, Reading, as_aims, measure_reading, share_ratios
from catenary.bench.job import PHASES, Round
from catenary.bench.statistics import Run, combine


def run(name: str, phase_ns: int) -> Run:
    samples = np.full((100, len(PHASES)), phase_ns, dtype=np.int64)
    return combine(name, [Round(samples, lost=0, cpu_per_cycle_ns=1.0)] * 2)


def test_readers_stand_beside_a_share_without_and_that_beside_none() -> None:
    cost = {"-shared": 1100, "-readers": 1210, "-bystanders": 1200}
    runs = [run(name, cost.get(name[name.rindex("-") :], 1000)) for name in NAMES]
    ratios = share_ratios(runs)
    assert ratios["in_controller: catenary-inline-readers / catenary-inline-shared"] == 1.1
    assert (
        ratios["post_processing: catenary-threaded-readers / catenary-threaded-bystanders"] == 1.008
    )
    assert ratios["post_processing: catenary-threaded-shared / catenary-threaded"] == 1.1
    assert set(NAMES) <= set(MODULES)


def test_limits_are_printed_with_the_measured_values() -> None:
    name = "post_processing: catenary-inline-readers / catenary-inline-bystanders"
    told = as_aims([Reading(3, 472, read=1.5, copy=0.25)], {name: 1.02, "x / y": 3.0})
    assert told.splitlines() == [
        "  read 472 bytes (3 axes): 1.50 us, the copy alone 0.25 us: difference 1.25 us, "
        "limit 1 us: NOT REACHED",
        f"  {name}: 1.020, limit 1.05: reached",
    ]


def test_a_reading_is_of_the_whole_cycle() -> None:
    small, large = measure_reading(1), measure_reading(4)
    assert large.bytes > small.bytes > 0
    assert small.read > 0
