from dataclasses import replace

import numpy as np
import pytest

from catenary.bench.job import (
    PHASES,
    Body,
    Job,
    Round,
    read_job,
    read_round,
    write_job,
    write_round,
)
from catenary.bench.statistics import DERIVED, combine

LATENESS = 50_000


def make_round(
    receive: int, process: int, send: int, lost: int = 0, cpu_ns: float = 20_000.0
) -> Round:
    """Return a round of a hundred equal cycles of an inline loop."""
    delay = LATENESS + receive + process + send
    row = (1_000_000, LATENESS, receive, process, send, 2_000, delay, 990_000)
    return Round(np.tile(np.array(row, np.int64), (100, 1)), lost, cpu_ns, "SCHED_FIFO 80")


def test_combine_the_rounds_of_a_peer() -> None:
    run = combine("c", [make_round(5000, 300, 5000, 1), make_round(7000, 300, 5000, 2)])
    assert (run.cycles, run.lost, run.cpu_us_per_cycle) == (200, 3, 20.0)
    assert run.timing_us["receive"]["mean"] == 6.0
    assert run.timing_us["in_controller"]["min"] == 10.3
    assert run.timing_us["in_controller"]["max"] == 12.3
    assert set(run.timing_us) == {*PHASES, *DERIVED}
    assert set(run.timing_us["post_processing"]) == {
        "mean",
        "min",
        "max",
        "sd",
        "p50",
        "p99",
        "p999",
    }


def test_figures_of_each_round_are_kept() -> None:
    rounds = combine("c", [make_round(5000, 300, 5000, 1), make_round(7000, 300, 5000, 2)]).rounds
    assert (rounds.cycles, rounds.lost, rounds.uncommitted) == ([100, 100], [1, 2], [0, 0])
    assert rounds.cpu_us_per_cycle == [20.0, 20.0]
    assert rounds.timing_us["receive"]["p50"] == [5.0, 7.0]
    assert rounds.timing_us["output_delay"]["max"] == [60.3, 62.3]


def test_derived_columns_are_computed_in_every_cycle() -> None:
    one = make_round(5000, 300, 5000)
    one.samples[:50, PHASES.index("lateness")] = 10_000
    one.samples[:50, PHASES.index("output_delay")] = 21_000
    one.samples[0, PHASES.index("output_delay")] = -1  # nothing was sent in this cycle
    wake_to_sent = combine("c", [one]).timing_us["wake_to_sent"]
    assert (wake_to_sent["min"], wake_to_sent["max"]) == (10.3, 11.0)
    assert wake_to_sent["p50"] == 10.3  # 49 of 99 cycles have 11.0


def test_cpu_per_cycle_is_weighted_by_cycles() -> None:
    long, short = make_round(1, 1, 1, cpu_ns=10_000.0), make_round(1, 1, 1, cpu_ns=30_000.0)
    short = replace(short, samples=short.samples[:50])
    assert combine("c", [long, short]).cpu_us_per_cycle == pytest.approx(50 / 3)


def test_the_first_period_of_a_round_is_not_counted() -> None:
    first = make_round(1, 1, 1)
    first.samples[0, 0] = 10**12
    assert combine("c", [first, first]).timing_us["period"]["max"] == 1000.0


def test_write_and_read_a_job_and_a_round(tmp_path) -> None:
    job = Job("c", "peer", "cat0a", (2, 3), Body.PD, 1_000_000, 200, 1000, None, 80, 2.0**20, 1.0)
    write_job(job, tmp_path / "job.json")
    assert read_job(tmp_path / "job.json") == job
    write_round(make_round(1, 2, 3, 4), tmp_path / "r.npz")
    back = read_round(tmp_path / "r.npz")
    assert (back.lost, back.cpu_per_cycle_ns) == (4, 20_000.0)
    assert back.samples.shape == (100, len(PHASES))
