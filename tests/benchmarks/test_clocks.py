"""`python -m benchmarks clocks`, in little."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from benchmarks import clocks


def test_a_short_run_holds_and_is_told(tmp_path: Path) -> None:
    file = tmp_path / "clocks.json"
    assert clocks.measure(devices=[3], minutes=0.01, jitter=0.5e-6, seed=1, file=file)
    [run] = json.loads(file.read_text())["runs"]
    assert run["devices"] == 3
    assert 0 < run["locked_after"] < 2.0
    assert 0 < run["worst_true"] < 1.0
    assert run["looks"] > 100
    assert run["looks_beyond"] == 0


def test_what_scatters_more_is_further_off_and_not_held_beyond_the_bound() -> None:
    """The figures can be bad."""
    quiet, loud = (clocks.run(3, 0.5, jitter, 1) for jitter in (0.1e-6, 1.5e-6))
    assert loud.worst_true > 2 * quiet.worst_true
    assert quiet.held
    assert not replace(quiet, worst_true=1.001).held
    assert not replace(quiet, worst_reported=1.001).held


def test_the_same_seed_gives_the_same_figures() -> None:
    first, second = (clocks.run(2, 0.2, 0.5e-6, 7) for _ in range(2))
    assert first.worst_true == second.worst_true
    assert first.rms_true == second.rms_true
