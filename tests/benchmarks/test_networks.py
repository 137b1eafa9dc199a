"""Two networks beside C: what is made of the rounds, and a short round of each on real wires."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import catenary as cat
from benchmarks import network_law, networks
from benchmarks.networks import KEPT, NetworkRound, of_samples, phases_of, tally
from catenary.bench.job import PHASES
from catenary.bench.segment import make_segment
from catenary.errors import WorkingCounterError


def test_a_cycle_begun_a_period_late_is_late() -> None:
    samples = np.zeros((4, len(PHASES)), dtype=np.int64)
    samples[:, PHASES.index("lateness")] = [-5, 200_000, 250_000, 1_000_000]
    found = of_samples(2, samples, 250_000)
    assert (found.lost, found.late) == (2, 2)
    assert found.phases_ns["lateness"] == [-5, 200_000, 250_000, 1_000_000]
    assert found.phases_ns["send"] == [0, 0, 0, 0]


def lateness(lost: int, late: int, values: list[int]) -> NetworkRound:
    return NetworkRound(lost, late, {name: values for name in KEPT})


def test_the_networks_are_tallied_apart() -> None:
    rounds = [
        [lateness(1, 0, [1000, 2000]), lateness(0, 3, [4000])],
        [lateness(1, 1, [3000]), lateness(0, 0, [4000])],
    ]
    first, second = tally("x", 2, rounds)
    assert (first.lost, first.late, first.cycles, first.lateness_us["p50"]) == (2, 1, 4, 2.0)
    assert (second.network, second.lost, second.late, second.lateness_us["max"]) == (1, 0, 3, 4.0)


def test_the_last_cycles_of_a_log_are_taken() -> None:
    columns = [("number", "u8"), *((f"{name}_ns", "i4") for name in KEPT)]
    log = np.array([(n, 10 * n, n, 2 * n, 12 * n) for n in range(6)], dtype=columns)
    found = phases_of(SimpleNamespace(log=log), 5)
    assert found["lateness"] == [10, 20, 30, 40, 50]
    assert found["send"] == [2, 4, 6, 8, 10]


def test_virtual_networks_are_complete() -> None:
    assert networks.in_virtual_time(8000, 0.05) == (400, 0)


def test_a_loop_that_stands_still_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(network_law.time, "sleep", lambda seconds: None)
    segment = make_segment(2, clock="virtual")
    job = SimpleNamespace(cycles=1000, period_ns=1_000_000)

    def run() -> None:
        with cat.MainDevice(segment) as main:
            arm = cat.Drives(main.scan().drives, counts_per_turn=1000, velocity_limit=100.0)
            with cat.Loop(arm) as loop:
                segment.unplug()
                network_law.count(loop, job)

    with pytest.raises(WorkingCounterError, match="no device answers"):
        run()


@pytest.mark.wire
def test_both_run_on_wires() -> None:
    ours_and_c = networks.on_wires(500, 0.2, 1)
    assert [(each.name, each.network) for each in ours_and_c] == [
        ("catenary", 0),
        ("catenary", 1),
        ("c", 0),
        ("c", 1),
    ]
    for each in ours_and_c:
        assert each.cycles == 100
        assert each.lost < each.cycles  # they do exchange; how well is not for a test
