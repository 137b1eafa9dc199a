"""The table of the gripper: its figures, a short run, and the experiments."""

from __future__ import annotations

import json
import math
from importlib.util import find_spec
from subprocess import TimeoutExpired

import numpy as np
import pytest

from benchmarks import gripper_experiments
from benchmarks.gripper_loop import Found
from benchmarks.tables import rdda
from benchmarks.tables.sheet import Options, as_json, show
from catenary.control import FrequencyResponse
from catenary.errors import CatenaryError

PRINTED = """\
open [rad]: -0.8 -0.8
closed [rad]: 0.6 0.6
meeting [rad]: 0.326 0.325
stiffness [N·m/rad]: 2.0, measured 2.0 2.01
stiffness [N·m/rad]: 4.0, measured 4.0 3.99
offset by friction [mrad]: -0.04 -0.04
felt 2.0 ms after contact, at 0.171 0.171
"""


def found(lateness_us: list[float], period_us: list[float]) -> Found:
    to_ns = [round(each * 1e3) for each in lateness_us], [round(each * 1e3) for each in period_us]
    return Found(*to_ns, [10_000] * len(period_us), 1, 2, "FIFO")


@pytest.mark.parametrize(("largest", "reached"), [(99.9, True), (100.0, False)])
def test_the_largest_latency_decides(largest: float, reached: bool) -> None:
    row = rdda.row_of("idle", found([1.0, largest, 2.0], [500.0] * 3), 500.0)
    assert row.reached is reached
    assert row.latency_us["max"] == largest
    word = "reached" if reached else "NOT REACHED"
    assert rdda.as_verdicts([row]) == [f"idle: latency below 100 us: {word}"]


def test_periods_within_a_tenth() -> None:
    row = rdda.row_of("idle", found([0.0] * 5, [449.9, 450.0, 500.0, 550.0, 550.1]), 500.0)
    assert row.within == 0.6
    assert "60.000%" in rdda.as_table([row])


def test_the_experiments_are_read() -> None:
    one = gripper_experiments.read(PRINTED, 7.0)
    assert one.open_rad == [-0.8, -0.8]
    assert one.meeting_rad == [0.326, 0.325]
    assert one.stiffness == [(2.0, [2.0, 2.01]), (4.0, [4.0, 3.99])]
    assert one.felt_ms == 2.0


@pytest.mark.parametrize("word", ["open", "closed", "meeting", "stiffness", "felt"])
def test_a_missing_result_is_named(word: str) -> None:
    text = "\n".join(line for line in PRINTED.splitlines() if not line.startswith(word))
    with pytest.raises(CatenaryError, match=word):
        gripper_experiments.read(text, 7.0)


def test_the_corner_of_a_first_order_response() -> None:
    frequency = np.linspace(0.1, 50.0, 300)
    response = 30.0 / (1 + 2j * math.pi * frequency / 7.4)
    coherence = np.ones(300)
    response[5], coherence[5] = 1e6, 0.5  # not reliable
    one = FrequencyResponse(frequency, response, coherence)
    assert gripper_experiments.corner_of(one) == pytest.approx(7.4)


def test_the_measured_corner_is_that_of_the_simulated_finger() -> None:
    pytest.importorskip("numba", reason="laws are compiled by Numba: pip install 'catenary[law]'")
    expected = gripper_experiments.VISCOUS / gripper_experiments.INERTIA
    assert gripper_experiments.corner() == pytest.approx(expected, rel=0.05)


def test_without_a_network_the_published_row_remains(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gripper_experiments, "why_not", lambda: "not today")
    text = show(rdda.measure(Options(refused="not here")))
    assert "< 100" in text
    assert "left out: the loop: no private network (not here)" in text
    assert "left out: the experiments: not today" in text
    assert "ours: -" in text


@pytest.mark.parametrize("error", [CatenaryError("it failed"), TimeoutExpired(["gripper"], 1.0)])
def test_failed_experiments_are_left_out(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> None:
        raise error

    monkeypatch.setattr(gripper_experiments, "run", fail)
    monkeypatch.setattr(gripper_experiments, "why_not", lambda: "")
    text = show(rdda.measure(Options(refused="not here")))
    assert f"left out: the experiments: {error}" in text


@pytest.mark.skipif(find_spec("numba") is None, reason="laws need Numba")
@pytest.mark.usefixtures("veth")
def test_a_short_run(monkeypatch: pytest.MonkeyPatch) -> None:
    one = gripper_experiments.read(PRINTED, 7.0)
    monkeypatch.setattr(gripper_experiments, "run", lambda: one)
    monkeypatch.setattr(gripper_experiments, "why_not", lambda: "")
    sheet = rdda.measure(Options(seconds=1.0, rates=(200,)))
    figures = json.loads(as_json("rdda", sheet))
    assert [row["load"] for row in figures["rows"]] == ["idle", "loaded"]
    for row in figures["rows"]:
        assert row["cycles"] == 200
        assert row["period_us"]["p50"] > 1000.0
    assert "felt 2.0 ms after the contact" in show(sheet)
