"""Figures of a loop as numbers, as a table and as advice."""

from __future__ import annotations

import pytest

from catenary.core._cycle import PHASE_NAMES
from catenary.loop.timing import Timing

FIGURES = {
    "mean": 5.25e-6,
    "max": 9.0e-6,
    "min": 4.0e-6,
    "sd": 0.5e-6,
    "p50": 5.0e-6,
    "p99": 8.0e-6,
    "p999": 8.9e-6,
}
FIFO = "SCHED_FIFO 80, 1.7 MB locked"


def timing(scheduling: str = FIFO, /, **counters: int) -> Timing:
    phases = {"lateness": {"count": 10.0, **FIGURES}, "process": {"count": 0.0}}
    return Timing(phases, {"cycles": 10, **counters}, period=1e-3, scheduling=scheduling)


def with_phase(name: str, maximum: float, **counters: int) -> Timing:
    phases = {name: {"count": 10.0, **FIGURES, "max": maximum}}
    return Timing(phases, {"cycles": 10, **counters}, period=1e-3, scheduling=FIFO)


def test_phases_that_did_not_occur_are_left_out() -> None:
    assert list(timing()) == ["lateness"]
    assert timing()["lateness"]["p99"] == 8.0e-6


def test_the_table_shows_every_figure_the_counts_and_the_verdict() -> None:
    head, row, counts, verdict = str(timing()).splitlines()
    assert head.split() == ["[us]", "mean", "max", "min", "sd", "p50", "p99", "p99.9"]
    assert row.split() == ["lateness", "5.25", "9.00", "4.00", "0.50", "5.00", "8.00", "8.90"]
    assert counts == "10 cycles: 0 late, 0 uncommitted, 0 underrun, 0 lost"
    assert verdict == "No cycle was late, uncommitted, underrun or lost."


def test_the_columns_are_aligned_for_every_phase() -> None:
    found = Timing(
        {name: {"count": 1.0, **FIGURES} for name in PHASE_NAMES}, {}, period=1e-3, scheduling=FIFO
    )
    table = str(found).splitlines()[: 1 + len(PHASE_NAMES)]
    assert len({len(line) for line in table}) == 1
    assert all(len(line.split()) == 8 for line in table)


def test_each_kind_has_a_line_of_its_own() -> None:
    found = timing(late=1, uncommitted=2, underrun=3, lost=4)
    assert str(found).splitlines()[2] == "10 cycles: 1 late, 2 uncommitted, 3 underrun, 4 lost"
    assert [line.split()[:5] for line in found.verdict.splitlines()] == [
        ["1", "of", "10", "cycles", "late"],
        ["2", "of", "10", "cycles", "uncommitted:"],
        ["3", "of", "10", "cycles", "underrun:"],
        ["4", "of", "10", "cycles", "lost:"],
    ]


@pytest.mark.parametrize(
    ("found", "cause"),
    [
        (with_phase("lateness", 340e-6, late=12), "by up to 340 us: another process"),
        (timing("SCHED_OTHER: not permitted (EPERM)", late=1), "no real-time priority"),
        (timing("virtual time", late=1), "used the virtual time"),
        (with_phase("process", 2.5e-3, late=1), "the body took up to 2500 us of a period of 1000"),
        (with_phase("process", 2.5e-3, uncommitted=1), "the body took up to 2500 us"),
        (timing(uncommitted=1), "loop.stream()"),
        (timing(underrun=1), "keep more rows in it"),
        (timing(lost=1), "catenary diag"),
        (with_phase("lateness", 300e-6), "300 us after its cycle start"),
    ],
)
def test_the_verdict_names_the_cause_and_the_next_step(found: Timing, cause: str) -> None:
    assert cause in found.verdict


def test_virtual_time_is_named() -> None:
    assert timing("virtual time").is_virtual
    assert "virtual time: the segment's own clock, not this machine's" in str(
        timing("virtual time")
    )
    assert "virtual time" not in str(timing())


def test_a_second_busy_thread_is_reported() -> None:
    waits = {"count": 10.0, **FIGURES, "p99": 4900.0e-6}
    options = {"period": 1e-3, "scheduling": FIFO}
    assert "switch_interval" in str(Timing({"interpreter": waits}, {"cycles": 1}, **options))
    waits["p99"] = 300.0e-6
    assert "switch_interval" not in str(Timing({"interpreter": waits}, {"cycles": 1}, **options))


def test_a_notebook_shows_a_table() -> None:
    html = timing(late=1)._repr_html_()
    assert "<th>p99.9</th>" in html
    assert "<td>5.25</td>" in html
    assert "10 cycles: 1 late" in html
    assert "catenary doctor" in html
