from dataclasses import replace

import numpy as np
import pytest

from catenary.bench.cost import Point, fit
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
from catenary.bench.statistics import DERIVED, combine, ratios

LATENESS = 50_000


def make_round(
    receive: int, process: int, send: int, lost: int = 0, cpu_ns: float = 20_000.0
) -> Round:
    """A hundred equal cycles of an inline loop."""
    delay = LATENESS + receive + process + send
    row = (1_000_000, LATENESS, receive, process, send, 2_000, delay, 990_000)
    return Round(np.tile(np.array(row, np.int64), (100, 1)), lost, cpu_ns, "SCHED_FIFO 80")


def test_rounds_of_a_peer_are_one_run() -> None:
    run = combine("c", [make_round(5000, 300, 5000, 1), make_round(7000, 300, 5000, 2)])
    assert (run.cycles, run.lost, run.cpu_us_per_cycle) == (200, 3, 20.0)
    assert run.timing_us["receive"]["mean"] == 6.0
    assert run.timing_us["in_controller"]["min"] == 10.3
    assert run.timing_us["in_controller"]["max"] == 12.3
    assert set(run.timing_us) == {*PHASES, *DERIVED}
    assert set(run.timing_us["tail"]) == {"mean", "min", "max", "sd", "p50", "p99", "p999"}


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


def test_ratios_are_the_medians_of_the_rounds_ratios() -> None:
    ours = [
        make_round(n, 1000, 1000, cpu_ns=cpu) for n, cpu in ((1000, 2.0), (9000, 2.0), (9, 6.0))
    ]
    theirs = [make_round(n, 1000, 1000, cpu_ns=1.0) for n in (2000, 9000, 1000)]
    found = ratios([combine("catenary-law", ours), combine("c", theirs)])
    assert found["receive: catenary-law / c"] == 0.5
    assert found["cpu_per_cycle: catenary-law / c"] == 2.0
    assert found["wake_to_sent: catenary-law / c"] == 0.75


def test_a_round_without_a_phase_is_left_out_of_its_ratio() -> None:
    lacking = make_round(4000, 1000, 1000)
    lacking.samples[:, PHASES.index("process")] = -1
    ours = combine("catenary-threaded", [lacking, make_round(4000, 3000, 1000)])
    theirs = combine("c", [make_round(4000, 1000, 1000)] * 2)
    assert ours.rounds.timing_us["process"]["p50"] == [None, 3.0]
    found = ratios([ours, theirs])
    assert found["process: catenary-threaded / c"] == 3.0
    assert found["receive: catenary-threaded / c"] == 1.0


def test_ratios_are_only_of_peers_that_ran() -> None:
    runs = [
        combine("catenary-inline", [make_round(500, 4000, 5500)]),
        combine("pysoem", [make_round(5000, 4000, 11000)]),
    ]
    found = ratios(runs)
    assert found["in_controller: catenary-inline / pysoem"] == 0.5
    assert found["receive: catenary-inline / pysoem"] == 0.1
    assert not any(name.endswith("/ c") for name in found)


def test_cost_is_found_again() -> None:
    points = [
        Point(n, size, 3.0 + 0.5 * n + 0.002 * size)
        for n, size in ((3, 78), (10, 260), (33, 858), (3, 400), (10, 1000))
    ]
    cost = fit(points)
    assert (cost.base_us, cost.per_axis_us, cost.per_byte_us) == pytest.approx((3.0, 0.5, 0.002))
    assert cost.residual_us == pytest.approx(0.0, abs=1e-9)


def test_cost_of_proportional_segments_is_refused() -> None:
    with pytest.raises(ValueError, match="do not tell"):
        fit([Point(n, 26 * n, float(n)) for n in (3, 10, 33)])


def test_job_and_round_survive_a_file(tmp_path) -> None:
    job = Job("c", "cat0a", (2, 3), Body.PD, 1_000_000, 200, 1000, None, 80, 2.0**20, 1.0)
    write_job(job, tmp_path / "job.json")
    assert read_job(tmp_path / "job.json") == job
    write_round(make_round(1, 2, 3, 4), tmp_path / "r.npz")
    back = read_round(tmp_path / "r.npz")
    assert (back.lost, back.cpu_per_cycle_ns) == (4, 20_000.0)
    assert back.samples.shape == (100, len(PHASES))
