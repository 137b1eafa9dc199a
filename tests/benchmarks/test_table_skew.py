"""The table of the skew: virtual time, so figures can be told."""

from __future__ import annotations

import json

import pytest

from benchmarks.tables import skew
from benchmarks.tables.sheet import Options, as_json
from catenary.errors import CatenaryError
from catenary.virtual import DigitalOutputs


def test_outputs_switch_together_with_sync0_and_later_by_the_line_without() -> None:
    sheet = skew.measure(Options(seconds=0.05))
    figures = json.loads(as_json("skew", sheet))
    exact, synchronous, by_frame = (figures["ways"][name] for name in skew.WAYS)
    assert [way["cycles"] for way in (exact, synchronous, by_frame)] == [50] * 3
    assert exact["amount"]["max"] < 0.1  # [us]
    assert synchronous["amount"]["max"] < 1.0
    assert by_frame["skew"]["min"] > 1.0
    assert by_frame["skew"]["sd"] == 0.0
    assert "theirs: oscilloscope" in sheet.text
    assert figures["published_us"]["mean"] == 1.45


def test_the_same_in_every_run() -> None:
    once, again = (skew.run(skew.make_line(real_crystals=True), 0.02, dc=True) for _ in range(2))
    assert once == again


def test_outputs_that_are_never_taken_over_end_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(DigitalOutputs, "outputs_taken_ns", property(lambda self: None))
    with pytest.raises(CatenaryError, match="switched only 0 times in 1 s"):
        skew.run(skew.make_line(real_crystals=False), 0.02, dc=False)
