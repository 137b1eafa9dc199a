from __future__ import annotations

import json
from importlib.util import find_spec

import pytest

from benchmarks import law_call, needed, scan, storm
from benchmarks.loop import check_busy_peer, peer_names
from benchmarks.ratios import ratios
from catenary.bench.job import PHASES, Round
from catenary.bench.report import as_json, as_text, machine
from catenary.bench.statistics import DERIVED, combine
from tests.bench.test_statistics import make_round


def test_ours_run_beside_the_chosen_peers() -> None:
    ours = ["catenary-inline", "catenary-threaded"]
    ours += ["catenary-law"] if find_spec("numba") else []
    assert peer_names(["c", "pysoem"]) == [*ours, "c", "pysoem"]
    assert peer_names([]) == ours


def test_an_unknown_peer_is_named() -> None:
    with pytest.raises(ValueError, match=r"peer 'soem'; known: .*c, c-ring, c-busy, pysoem"):
        peer_names(["soem"])


def test_c_busy_needs_a_busy_wait() -> None:
    check_busy_peer(0.0, ["c"])
    check_busy_peer(50e-6, ["c", "c-busy"])
    with pytest.raises(ValueError, match="c-busy needs a busy-wait: add --busy-wait"):
        check_busy_peer(0.0, ["c-busy"])


def test_what_is_not_installed_is_told_before_the_work(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(needed, "find_spec", lambda name: None)
    with pytest.raises(needed.PackageError, match="needs pysoem") as caught:
        peer_names(["c", "pysoem"])
    assert "or omit pysoem" in caught.value.hint
    with pytest.raises(needed.PackageError, match="needs pysoem"):
        scan.measure(drives=1, file=None)
    with pytest.raises(needed.PackageError, match="needs pysoem"):
        storm.measure(drives=1, rate=1000, seconds=1.0, file=None)
    with pytest.raises(needed.PackageError, match="needs numba"):
        law_call.measure(axes=1, file=None)


def test_json_has_the_published_form() -> None:
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
