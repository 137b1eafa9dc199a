"""`catenary bench clocks`, in little."""

from __future__ import annotations

import json
from pathlib import Path

from catenary.bench import clocks


def test_a_short_run_holds_and_is_told(tmp_path: Path) -> None:
    file = tmp_path / "clocks.json"
    assert clocks.measure(devices=[3], minutes=0.01, jitter=0.5e-6, seed=1, file=file)
    [run] = json.loads(file.read_text())["runs"]
    assert run["devices"] == 3
    assert 0 < run["locked_after"] < 2.0
    assert 0 < run["worst_true"] < 1.0
    assert run["looks"] > 100
    assert run["looks_beyond"] == 0


def test_a_segment_that_scatters_too_much_is_not_held() -> None:
    """The figures can be bad."""
    outcome = clocks.run(3, 0.5, 2.0e-6, 1)
    assert outcome.worst_true > 1.0
    assert not outcome.held


def test_the_same_seed_gives_the_same_figures() -> None:
    first, second = (clocks.run(2, 0.2, 0.5e-6, 7) for _ in range(2))
    assert first.worst_true == second.worst_true
    assert first.rms_true == second.rms_true
