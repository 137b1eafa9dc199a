"""The table of two networks: its shape, and a run as short as can be, on lines and on rings."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks.networks import KEPT, NetworkRound
from benchmarks.tables import tocabi
from benchmarks.tables.sheet import Options, as_json, show
from tests.benchmarks.patience import patiently


def network_round(values: list[int], lost: int = 0, late: int = 0) -> NetworkRound:
    return NetworkRound(lost, late, dict.fromkeys(KEPT, values))


def test_rounds_of_a_network_are_one_column() -> None:
    found = tocabi.column(
        "loop, upper", [network_round([1000, 3000], 1), network_round([2000], 0, 2)]
    )
    assert (found.cycles, found.lost, found.overflows) == (3, 1, 2)
    assert found.channel().latency[:3] == (2.0, 3.0, 1.0)
    assert found.channel().overflows == "2"


def test_a_phase_that_did_not_occur_does_not_count() -> None:
    values = [-1, 5000, 7000]
    timing = tocabi.column("x", [network_round(values)]).timing_us
    assert timing["send"]["min"] == 5.0
    assert timing["lateness"]["min"] == -0.001  # woken before its instant
    assert np.isclose(timing["send"]["mean"], 6.0)


def test_without_a_network_the_published_table_remains() -> None:
    text = show(tocabi.measure(Options(refused="not here")))
    assert "7.28 million" in text
    assert "left out: all of ours: no private network (not here)" in text


def test_what_is_left_out_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    ways, left_out = tocabi.ways_for(Options(ring=True))
    assert list(ways) == [tocabi.LOOP, tocabi.LAWS, tocabi.LAW, tocabi.TRIGGERED]
    assert "ring" in left_out[0]
    monkeypatch.setattr(tocabi, "has_programs", lambda: False)
    assert "gcc" in tocabi.ways_for(Options())[1][0]
    monkeypatch.setattr(tocabi, "find_spec", lambda _name: None)
    ways, left_out = tocabi.ways_for(Options())
    assert list(ways) == [tocabi.LOOP]
    assert "Numba" in left_out[0]


def test_only_the_peers_asked_for_run_or_are_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tocabi, "has_programs", lambda: False)
    ways, left_out = tocabi.ways_for(Options(peers=(tocabi.LAW,)))
    assert (list(ways), left_out) == ([tocabi.LAW], [])
    with pytest.raises(
        ValueError,
        match="unknown peer 'rust' of tocabi; known peers: loop, laws, law, triggered, c",
    ):
        tocabi.ways_for(Options(peers=("rust",)))


def test_the_rates_that_hold_are_named() -> None:
    def way(lost: int = 0, late: int = 0) -> tocabi.WayRounds:
        rounds = [network_round([1000], lost, late), network_round([1000])]
        return tocabi.WayRounds([rounds], [], [])

    found = {4000: way(), 5000: way(), 6000: way(lost=1), 8000: way(late=1)}
    lines = tocabi.as_verdicts({rate: {tocabi.LAW: each} for rate, each in found.items()})
    assert lines == ["law: nothing lost, late or missed at 4000, 5000 Hz; not at 6000, 8000 Hz"]


@pytest.mark.usefixtures("veth")
@pytest.mark.parametrize("ring", [False, True])
def test_all_ways_run_briefly(ring: bool) -> None:
    options = Options(seconds=0.1, rounds=1, rates=(500,), ring=ring)
    sheet = patiently(lambda: tocabi.measure(options))
    figures = json.loads(as_json("tocabi", sheet))
    assert figures["ring"] is ring
    [rate] = figures["rates"]
    names = [column["name"] for column in rate["columns"]]
    ways = tocabi.ways_for(options)[0]
    assert names == [f"{way}, {network}" for way in ways for network in ("upper", "lower")]
    assert all(column["cycles"] > 0 for column in rate["columns"])
    for timing in (column["timing_us"] for column in rate["columns"]):
        assert timing["output_delay"]["min"] >= timing["lateness"]["min"]
    assert "output delay" in sheet.text
    assert [task["name"] for task in rate["task_beside"]] == ["python"] * 3
    assert "lower: " in sheet.text.partition("cycles without a trigger")[0]
    [shares] = rate["shares"][tocabi.LAW]
    assert {name for name, share in shares.items() if share > 0} == {
        f"{what}, {network}" for what in ("law", "segment") for network in tocabi.NETWORKS
    }


def test_axes_of_each_network():
    assert tocabi.axes_of(Options()) == (18, 15)
    assert tocabi.axes_of(Options(axes=(3, 3))) == (3, 3)
    with pytest.raises(ValueError, match="2 networks, not 3"):
        tocabi.axes_of(Options(axes=(1, 2, 3)))
