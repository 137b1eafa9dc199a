"""The time to publish is measured for every call."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed")


def test_every_call_is_measured(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from benchmarks import ros2_publish

    monkeypatch.setattr(ros2_publish, "CALLS", 20)
    monkeypatch.setenv("ROS_DOMAIN_ID", "99")
    times = ros2_publish.measure_times(7)
    assert {name: len(found) for name, found in times.items()} == {"encode": 20, "publish": 20}
    file = tmp_path / "ros2.json"
    ros2_publish.measure(axes=7, file=file)
    assert json.loads(file.read_text())["publish"]["p50"] > 0
