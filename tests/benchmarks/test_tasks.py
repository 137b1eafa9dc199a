"""`python -m benchmarks tasks`: every way runs; figures come from its jobs."""

from __future__ import annotations

import json

import pytest

from benchmarks import tasks
from catenary.realtime import Task, Tasks


@pytest.mark.parametrize("way", tasks.WAYS)
def test_every_way_runs(way, monkeypatch):
    monkeypatch.setattr(tasks, "ROUND_SECONDS", 0.3)
    found = tasks.Found(tasks.Counter())
    tasks.run_round(way, found)
    assert found.jobs > 0
    assert found.responses.total() == found.jobs


def test_percentiles_and_report():
    found = {way: tasks.Found(tasks.Counter({1e-6: 98, 2e-6: 1, 5e-6: 1}), 100, 1) for way in "ab"}
    one = found["a"]
    assert [one.percentile(p) for p in (0.5, 0.99, 1.0)] == [1.0, 2.0, 5.0]
    assert "limit: 1.2" in tasks.as_text(found, 1.0)
    report = json.loads(json.dumps(tasks.as_json(found, 1.04)))
    assert report["ways"]["a"]["response_us"]["max"] == 5.0
    assert report["ratio"] == 1.04


def test_the_busy_task_is_busy(monkeypatch):
    monkeypatch.setattr(tasks, "LOW_BUSY", 1e-3)
    with Tasks(Task(tasks.compute_much, name="low", period=5e-3)) as running:
        while running["low"].statistics.jobs == 0:
            running.join(0.01)
    assert running["low"].statistics.execution.min > 0.9e-3
