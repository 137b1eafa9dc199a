from benchmarks.ratios import ratios
from catenary.bench.job import PHASES
from catenary.bench.statistics import combine
from tests.bench.test_statistics import make_round


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
