"""The table of three spinning tasks: bounds against the published ones, samples of C by hand, a
run as short as can be."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest

from benchmarks.tables import tasks
from benchmarks.tables.sheet import Options, as_json

MS = 1_000_000


def found(response: float, execution: float, jitter: float = 0.0) -> tasks.Found:
    alike = {"mean": response, "max": response, "min": response, "sd": 0.0}
    figures = {"period": alike, "jitter": {**alike, "max": jitter}, "response": alike}
    return tasks.Found("tau1", 10, 0, figures, execution)


def test_the_published_bounds() -> None:
    assert tasks.bounds(tasks.EXECUTIONS) == pytest.approx([3.0, 8.0, 29.0])


def test_measured_bounds_take_executions_and_releases() -> None:
    ours = [found(3.1, 3.1, 0.05), found(8.2, 5.1), found(29.95, 10.1)]
    bounds = tasks.measured_bounds(ours)
    # each job 0.05 longer: 10.15 + 3 x 3.15 + 2 x 5.15
    assert bounds == pytest.approx([3.15, 8.3, 29.9])
    assert [tasks.within(*pair) for pair in zip(ours, bounds, strict=True)] == ["yes", "yes", "no"]


def test_an_overload_has_no_bound() -> None:
    assert tasks.bounds((6e-3, 12e-3, 30e-3))[2] is None
    assert tasks.within(found(1.0, 1.0), None) == "no"


def test_samples_of_the_c_program() -> None:
    jobs = [[10 * MS, 1, 3 * MS, 3 * MS], [11 * MS, 2 * MS, 12 * MS, 4 * MS]]
    numbers = np.concatenate([np.array([2, *np.ravel(jobs)], np.int64)] * 3)
    tau1, tau2, tau3 = tasks.read_samples(numbers)
    assert (tau1.jobs, tau1.missed, tau2.missed, tau3.missed) == (2, 1, 0, 0)
    assert tau1.figures_ms["period"]["mean"] == 11.0  # the first has none
    assert tau1.figures_ms["response"]["max"] == 12.0
    assert tau1.execution_ms == 4.0


def test_every_way_runs_and_what_is_missing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    here = shutil.which
    monkeypatch.setattr(tasks, "which", lambda name: None if name == "stress-ng" else here(name))
    sheet = tasks.measure(Options(seconds=0.2))
    assert any("stress-ng is not installed" in reason for reason in sheet.left_out)
    figures = json.loads(as_json("tasks", sheet))
    ways = [way["way"] for way in figures["ways"]]
    assert ways[-2:] == [tasks.PROCESSES, tasks.THREADS]
    assert (tasks.C in ways) == bool(here("cc"))
    for way in figures["ways"]:
        assert [each["name"] for each in way["tasks"]] == list(tasks.NAMES)
        assert all(each["jobs"] > 0 for each in way["tasks"])
    assert sheet.text.count("theirs: C ") == 2  # idle and stress


def test_stress_takes_its_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    """With another program in stress-ng's place."""
    monkeypatch.setattr(tasks, "which", lambda _name: "/bin/true")
    monkeypatch.setattr(tasks, "stressed", lambda: tasks.start_program(["sleep", "60"]))
    monkeypatch.setattr(tasks, "run", lambda _way, _seconds: [found(3.0, 3.0)] * 3)
    sheet = tasks.measure(Options(seconds=0.1))
    assert not sheet.left_out
    assert len(sheet.figures["ways"]) == 6  # type: ignore[arg-type]
