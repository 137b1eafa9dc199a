from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.teleoperation_link import AXES, main, measure


def test_every_cycle_uses_a_packet() -> None:
    cost = measure(2, 50)
    assert cost.used >= 48  # the first ones introduce the sides
    assert 0.0 < cost.median_us <= cost.p99_us


def test_the_program_writes_its_results(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["--cycles", "20", "--json", str(tmp_path / "link.json")])
    written = json.loads((tmp_path / "link.json").read_text())
    assert [each["axes"] for each in written["costs"]] == list(AXES)
    assert "receive and send of a peer, limit 50 us" in capsys.readouterr().out
