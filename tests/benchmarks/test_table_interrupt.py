"""The table of reactions: what is left out, and a run of every way as short as can be."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest

from benchmarks.tables import interrupt
from benchmarks.tables.sheet import Options, as_json
from catenary.errors import CatenaryError


def test_events_that_added_up_are_left_out() -> None:
    found = interrupt.of_samples(np.array([1000, -1, 3000], np.int64))
    assert (found.events, found.left_out) == (2, 1)
    assert (found.reaction_us["mean"], found.reaction_us["max"]) == (2.0, 3.0)
    with pytest.raises(CatenaryError, match="too busy"):
        interrupt.of_samples(np.array([-1], np.int64))


def test_every_way_reacts() -> None:
    sheet = interrupt.measure(Options(seconds=0.05))
    ways = json.loads(as_json("interrupt", sheet))["ways"]
    pairs = [(way["who"], way["event"]) for way in ways]
    python = [("Python", "eventfd"), ("Python, sporadic task", "realtime.Signal")]
    assert [pair for pair in pairs if pair[0] != "C"] == [*python, ("Python", "timerfd")]
    assert len(pairs) == (5 if shutil.which("cc") else 3)
    for way in ways:
        assert 0 < way["events"] <= 60
        assert way["reaction_us"]["min"] >= 0.0


def test_without_a_compiler_python_remains(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interrupt, "has_programs", lambda: False)
    monkeypatch.setattr(interrupt, "run", lambda *_: interrupt.of_samples(np.array([1000, 2000])))
    sheet = interrupt.measure(Options())
    assert sheet.left_out == ["C: no C compiler (sudo apt install gcc libc6-dev)"]
    assert "\nC " not in sheet.text
