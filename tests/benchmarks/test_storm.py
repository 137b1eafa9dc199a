"""The storm of SDOs: what is made of its runs. The runs themselves: test_peers.py."""

from __future__ import annotations

import numpy as np

from benchmarks.peers import MODULES
from benchmarks.storm import NAMES, storm_ratios
from benchmarks.upload import Upload
from catenary.bench.job import PHASES, Round
from catenary.bench.statistics import Run, combine


def run(name: str, in_controller_ns: int, answers: int) -> Run:
    samples = np.full((100, len(PHASES)), in_controller_ns // 3, dtype=np.int64)
    return combine(name, [Round(samples, lost=0, cpu_per_cycle_ns=1.0, answers=answers)] * 2)


def test_each_storm_stands_beside_its_calm() -> None:
    runs = [run(name, 3000 + 300 * name.endswith("-sdo"), 7) for name in NAMES]
    ratios = storm_ratios(runs)
    assert ratios["in_controller: catenary-inline-sdo / catenary-inline"] == 1.1
    assert ratios["post_processing: catenary-threaded-sdo / catenary-threaded"] == 1.1
    assert runs[1].answers == 14
    assert set(NAMES) <= set(MODULES)


def test_an_upload_says_how_fast_it_was() -> None:
    assert "102 kB/s" in str(Upload("catenary", 2048, 0.02))
