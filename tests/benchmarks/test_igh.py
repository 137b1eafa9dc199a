"""The cycle over libethercat is measured every way; ours and C's make the same calls."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import igh
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
    end = len(calls) - 1 - calls[::-1].index("deactivate")
    # Leaving reads the states until all devices are in PRE-OP.
    reading = {"master", *(f"get_slave {position}" for position in range(3))}
    assert set(calls[end + 1 : -1]) == reading
    assert calls[-1] == "release_master"
    published = ROUND * ["receive", "process 0", "domain_state 0", "queue 0", "send"]
    native = calls[: end - len(published)]
    assert calls[len(native) : end] == published
    assert native[-2 * ROUND * len(CYCLE) :] == 2 * ROUND * CYCLE
