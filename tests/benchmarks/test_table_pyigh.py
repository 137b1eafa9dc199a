"""The table of the in-controller delay: its shape, what it compares, a run as short as can be."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks.tables import pyigh
from benchmarks.tables.sheet import Options, as_json, show
from catenary.bench.statistics import combine
from tests.bench.test_statistics import make_round
from tests.benchmarks.patience import patiently


def test_without_a_network_the_published_table_remains() -> None:
    sheet = pyigh.measure(Options(refused="`unshare` is not installed"))
    text = show(sheet)
    assert "theirs: PyIgH" in text
    assert "81.11/137.00/74.00/-" in text  # in controller
    assert "4.55" in text  # of C's
    assert text.count("\nleft out: ") == 1
    assert "`unshare` is not installed" in text
    assert json.loads(as_json("pyigh", sheet))["runs"] == []


def test_ratios_are_over_c() -> None:
    runs = [
        combine("c", [make_round(1000, 0, 1000)]),
        combine("catenary-law", [make_round(1000, 1000, 1000)]),
    ]
    assert pyigh.ratios(runs) == {"c": 1.0, "catenary-law": 1.5}
    assert pyigh.ratios(runs[1:]) == {}
    rows = pyigh.as_table(runs).splitlines()
    assert rows[-2].startswith("catenary-law")
    assert rows[-2].endswith("1.50")
    assert rows[-1] == "cycles lost: c 0 of 100, catenary-law 0 of 100"


def test_what_a_peer_lacks_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pyigh, "find_spec", lambda _name: None)
    monkeypatch.setattr(pyigh, "has_programs", lambda: False)
    names, left_out = pyigh.peers(busy=True)
    assert names == ["catenary-inline", "catenary-threaded"]
    assert [each.split(":")[0] for each in left_out] == ["catenary-law", "pysoem", "c, c-ring"]


def test_c_busy_runs_next_to_a_busy_wait_only(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pyigh, "has_programs", lambda: True)
    assert "c-busy" in pyigh.peers(busy=True)[0]
    assert "c-busy" not in pyigh.peers()[0]


def test_c_is_compared_with_itself_and_all_with_c() -> None:
    rounds = {name: [make_round(1000, 0, 1000)] * 4 for name in ("c", "pysoem")}
    compared = pyigh.compare(rounds)
    assert [(each.name, each.pairs) for each in compared] == [
        ("c, odd rounds / even", 2),
        ("pysoem / c", 4),
    ]
    assert compared[1].rounds.distance == 0.0
    assert compared[1].within == "too few rounds"
    assert pyigh.compare({"pysoem": rounds["pysoem"]}) == []


def test_the_interval_says_what_matters() -> None:
    periods = [np.full(50, 1000.0)] * 8
    same = pyigh.comparison("a", periods, periods)
    worse = pyigh.comparison("b", [each + 20 for each in periods], periods)
    assert (same.within, worse.within) == ("yes", "no")
    assert worse.p99_deviation_us.estimate == 20.0


@pytest.mark.usefixtures("veth")
def test_all_peers_run_briefly() -> None:
    sheet = patiently(lambda: pyigh.measure(Options(seconds=0.02, rounds=1)))
    figures = json.loads(as_json("pyigh", sheet))
    names = [run["name"] for run in figures["runs"]]
    assert names == pyigh.peers()[0]
    assert set(figures["ratios_over_c"]) <= set(names)
    assert {"machine", "date", "command", "versions", "scheduling"} <= set(figures)
    for name in names:
        assert f"\n{name} " in sheet.text
