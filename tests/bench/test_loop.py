from __future__ import annotations

import json
from importlib.util import find_spec
from pathlib import Path

import pytest

from catenary.bench import law_call, needed, scan, storm
from catenary.bench.job import PHASES, Round
from catenary.bench.loop import check_busy_wait, peer_names
from catenary.bench.report import as_json, as_text, machine
from catenary.bench.statistics import DERIVED, combine, ratios
from tests.bench.test_statistics import make_round


def test_ours_run_beside_the_chosen_peers() -> None:
    ours = ["catenary-inline", "catenary-threaded"]
    ours += ["catenary-law"] if find_spec("numba") else []
    assert peer_names(["c", "pysoem"]) == [*ours, "c", "pysoem"]
    assert peer_names([]) == ours


def test_an_unknown_peer_is_named() -> None:
    with pytest.raises(ValueError, match=r"peer 'soem'; known: .*c, c-ring, c-busy, pysoem"):
        peer_names(["soem"])


def test_a_busy_wait_must_be_possible_and_c_busy_needs_one() -> None:
    check_busy_wait(0.0, ["c"], 1000)
    check_busy_wait(50e-6, ["c", "c-busy"], 1000)
    for seconds in (1e-3, -1e-6):
        with pytest.raises(ValueError, match="less than the period"):
            check_busy_wait(seconds, ["c"], 1000)
    with pytest.raises(ValueError, match="c-busy needs a busy-wait: add --busy-wait"):
        check_busy_wait(0.0, ["c-busy"], 1000)


def test_what_is_not_installed_is_told_before_the_work(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(needed, "find_spec", lambda name: None)
    with pytest.raises(needed.PackageError, match="needs pysoem") as caught:
        peer_names(["c", "pysoem"])
    assert "or leave pysoem out" in caught.value.hint
    with pytest.raises(needed.PackageError, match="needs pysoem"):
        scan.measure(drives=1, file=None)
    with pytest.raises(needed.PackageError, match="needs pysoem"):
        storm.measure(drives=1, rate=1000, seconds=1.0, file=None)
    with pytest.raises(needed.PackageError, match="needs numba"):
        law_call.measure(axes=1, file=None)


def test_json_has_the_published_form(tmp_path: Path) -> None:
    rounds: list[Round] = [make_round(500, 4000, 5500)]
    runs = [combine("catenary-inline", rounds), combine("c", rounds)]
    figures = json.loads(json.dumps(as_json(runs, ratios(runs), {"drives": 3})))
    assert figures["machine"] == machine()
    assert [run["name"] for run in figures["runs"]] == ["catenary-inline", "c"]
    for run in figures["runs"]:
        assert {"name", "cycles", "lost", "timing_us", "cpu_us_per_cycle"} <= set(run)
        assert set(run["timing_us"]) == {*PHASES, *DERIVED}
        assert run["rounds"]["timing_us"]["input_age"]["p50"] == [990.0]
    assert figures["ratios"]["in_controller: catenary-inline / c"] == 1.0


def test_text_names_every_peer_in_every_table() -> None:
    runs = [combine(name, [make_round(500, 4000, 5500)]) for name in ("catenary-inline", "pysoem")]
    text = as_text(runs, ratios(runs))
    assert text.count("\npysoem ") == 5  # headlines, three figures of the phases, counters
    headings, figures = text.splitlines()[0], text.splitlines()[2]
    assert headings.split("  ")[-1].strip() == "CPU"
    assert figures.split() == [
        "catenary-inline",
        *["60.00"] * 3,
        *["10.00"] * 3,
        *["990.00"] * 3,
        "20.00",
    ]
    heading, *rows = text[text.index("\nratios ") + 1 :].splitlines()
    assert heading.split()[1:5] == ["output_delay", "wake_to_sent", "input_age", "cpu_per_cycle"]
    assert rows == [f"catenary-inline / pysoem  {rows[0][26:]}"]
    assert set(rows[0].split()[3:]) == {"1.00"}


def test_a_ratio_that_is_missing_is_a_dash() -> None:
    runs = [combine("c", [make_round(500, 4000, 5500)])]
    text = as_text(runs, {"tail: a / b": 1.5, "process: c / d": 2.0})
    assert text.splitlines()[-2].split() == ["a", "/", "b", "1.50", "-"]
    assert text.splitlines()[-1].split() == ["c", "/", "d", "-", "2.00"]
