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
from catenary.bench.statistics import combine, ratios


def make_round(receive: int, process: int, send: int, lost: int = 0) -> Round:
    row = (1_000_000, 50_000, receive, process, send, 2_000)
    return Round(np.tile(np.array(row, np.int64), (100, 1)), lost, 100 * 20_000, "SCHED_FIFO 80")


def test_rounds_of_a_peer_are_one_run() -> None:
    run = combine("c", [make_round(5000, 300, 5000, 1), make_round(7000, 300, 5000, 2)])
    assert (run.cycles, run.lost, run.cpu_us_per_cycle) == (200, 3, 20.0)
    assert run.timing_us["receive"]["mean"] == 6.0
    assert run.timing_us["in_controller"]["min"] == 10.3
    assert run.timing_us["in_controller"]["max"] == 12.3
    assert set(run.timing_us) == {*PHASES, "in_controller"}
    assert set(run.timing_us["tail"]) == {"mean", "min", "max", "sd", "p50", "p99", "p999"}


def test_the_first_period_of_a_round_is_not_counted() -> None:
    first = make_round(1, 1, 1)
    first.samples[0, 0] = 10**12
    assert combine("c", [first, first]).timing_us["period"]["max"] == 1000.0


def test_ratios_are_of_medians_and_only_of_what_ran() -> None:
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
    assert back.lost == 4
    assert back.samples.shape == (100, len(PHASES))
