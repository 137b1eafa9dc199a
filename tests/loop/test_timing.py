"""The figures of a loop as a table."""

from catenary.loop.timing import Timing

FIGURES = {"mean": 5.25, "max": 9.0, "min": 4.0, "sd": 0.5, "p50": 5.0, "p99": 8.0, "p999": 8.9}


def timing() -> Timing:
    empty = {"count": 0.0}
    phases = {"receive": {"count": 10.0, **FIGURES}, "process": empty}
    return Timing(phases, {"cycles": 10, "lost": 1, "late": 2})


def test_phases_that_did_not_occur_are_left_out() -> None:
    assert list(timing()) == ["receive"]
    assert timing()["receive"]["p99"] == 8.0


def test_the_table_shows_every_figure_and_the_counts() -> None:
    head, row, counts = str(timing()).splitlines()
    assert head.split() == ["[us]", "mean", "max", "min", "sd", "p50", "p99", "p999"]
    assert row.split() == ["receive", "5.25", "9.00", "4.00", "0.50", "5.00", "8.00", "8.90"]
    assert counts == "10 cycles, 1 lost, 2 late"


def test_a_second_busy_thread_is_reported() -> None:
    waits = {"count": 10.0, **FIGURES, "p99": 4900.0}
    counters = {"cycles": 10, "lost": 0, "late": 0}
    assert "switch_interval" in str(Timing({"interpreter": waits}, counters))
    waits["p99"] = 300.0
    assert "switch_interval" not in str(Timing({"interpreter": waits}, counters))
