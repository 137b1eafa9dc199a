from __future__ import annotations

import json
from importlib.util import find_spec
from pathlib import Path

import pytest

from catenary.bench import law_call, needed, scan, storm
from catenary.bench.job import PHASES, Round
from catenary.bench.loop import peer_names
from catenary.bench.report import as_json, as_text, machine
from catenary.bench.statistics import combine, ratios
from tests.bench.test_statistics import make_round


def test_ours_run_beside_the_chosen_peers() -> None:
    ours = ["catenary-inline", "catenary-threaded"]
    ours += ["catenary-law"] if find_spec("numba") else []
    assert peer_names(["c", "pysoem"]) == [*ours, "c", "pysoem"]
    assert peer_names([]) == ours


def test_an_unknown_peer_is_named() -> None:
    with pytest.raises(ValueError, match=r"no peer 'soem'; known: .*c, c-ring, pysoem"):
        peer_names(["soem"])


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
        assert set(run["timing_us"]) == {*PHASES, "in_controller"}
    assert figures["ratios"]["in_controller: catenary-inline / c"] == 1.0


def test_text_names_every_peer_in_every_table() -> None:
    runs = [combine(name, [make_round(500, 4000, 5500)]) for name in ("catenary-inline", "pysoem")]
    text = as_text(runs, ratios(runs))
    assert text.count("\npysoem ") == 5  # four quantiles and the totals
    assert "in_controller+tail: catenary-inline / pysoem" in text
