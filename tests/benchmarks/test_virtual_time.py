"""The bench of virtual time runs on what it is given; how fast is not for a test."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import benchmarks

COBOT = Path(__file__).resolve().parents[2] / "examples" / "cobot" / "segment.toml"


def test_a_segments_file_with_its_arm(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "virtual.json"
    benchmarks.measure_virtual(drives=3, seconds=0.2, file=file, config=COBOT)
    found = json.loads(file.read_text())
    assert (found["drives"], found["config"]) == (6, "segment.toml")
    assert set(found["times_real_time"]) == {"inline", "threaded", "law"}
    assert "6 drives" in capsys.readouterr().out
