"""The cycle over libethercat is measured every way; ours and C's make the same calls."""

from __future__ import annotations

from pathlib import Path

import pytest

from catenary.bench import igh
from tests.igh.double import Double, build

CYCLE = ["receive", "process 0", "domain_state 0", "master_state", "queue 0", "send"]
ROUND = 4  # cycles


def test_every_way_makes_the_same_calls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    library = build(tmp_path, "1.6.1")
    double = Double(library, slaves=3)
    monkeypatch.setattr(igh, "CYCLES", ROUND)
    monkeypatch.setattr(igh, "ROUNDS", 1)
    monkeypatch.setattr(igh, "WARM_UP", 30)
    times = igh.cycle_times(library)
    assert {name: len(each) for name, each in times.items()} == dict.fromkeys(times, 1)
    assert list(times) == ["catenary", "c", "ctypes"]
    calls = double.calls()
    assert calls[-2:] == ["deactivate", "release_master"]
    published = ROUND * ["receive", "process 0", "domain_state 0", "queue 0", "send"]
    native = calls[: -2 - len(published)]
    assert calls[len(native) : -2] == published
    assert native[-2 * ROUND * len(CYCLE) :] == 2 * ROUND * CYCLE
