"""What befalls the cobot's program in mid-motion: its tasks are killed one by one (`kill -9`), a
drive reports a fault. The arm holds or stops, says so, and comes home when what was lost is back.
"""

from __future__ import annotations

import importlib
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the arm is simulated by MuJoCo: pip install 'catenary[sim]'")
pytest.importorskip("ruckig", reason="motions are made by ruckig: pip install 'catenary[traj]'")
pytest.importorskip("mcap", reason="recordings are MCAP files: pip install 'catenary[log]'")

from catenary import record
from catenary.errors import TaskError
from catenary.virtual.faults import drive_fault

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "cobot"
AT = 1000  # cycle: half-way up


@pytest.fixture
def cobot(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(FOLDER))
    module = importlib.import_module("cobot")
    monkeypatch.setattr(module, "GOALS", module.GOALS[:2])  # home before the key is hit
    yield module
    sys.modules.pop("cobot", None)


def run(
    cobot: Any, folder: Path, monkeypatch: pytest.MonkeyPatch, befalls: Callable[[Any], None]
) -> Any:
    """One run; `befalls(tasks)` in cycle AT."""
    running: list[Any] = []
    tasks_class = cobot.realtime.Tasks

    def tasks(*arguments: Any, **options: Any) -> Any:
        running.append(tasks_class(*arguments, **options))
        return running[0]

    why_stop = cobot.why_stop

    def watched(cycle: Any, *more: Any) -> Any:
        if cycle.number == AT:
            befalls(running[0])
        return why_stop(cycle, *more)

    monkeypatch.setattr(cobot.realtime, "Tasks", tasks)
    monkeypatch.setattr(cobot, "why_stop", watched)
    files = {"target": str(FOLDER / "segment.toml"), "arm": str(FOLDER / "arm.xml")}
    return cobot.run(virtual=True, compensate=True, folder=folder, **files)


def kill(name: str) -> Callable[[Any], None]:
    return lambda tasks: os.kill(tasks[name].process, signal.SIGKILL)


def came_home(outcome: Any) -> bool:
    recording = record.read(outcome.path)
    return bool(abs(recording["target_position"][-1]).max() < 1e-6)


def test_dynamics_that_are_killed_are_back_before_they_are_missed(
    cobot: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    outcome = run(cobot, tmp_path, monkeypatch, kill("dynamics"))
    assert outcome.stopped == []
    assert "dynamics" in str(outcome.tasks.failures[0])
    assert came_home(outcome)


def test_without_dynamics_it_stops_and_gives_up(
    cobot: Any,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """Killed more often than a task is restarted."""
    why_stop, kills = cobot.why_stop, []

    def again(cycle: Any, *more: Any) -> Any:
        if cycle.number in range(AT + 50, AT + 250, 50):
            kills[0]()
        return why_stop(cycle, *more)

    monkeypatch.setattr(cobot, "why_stop", again)
    read_segment, segments = cobot.read_segment, []

    def kept(path: str, **options: Any) -> Any:
        segments.append(read_segment(path, **options))
        return segments[0]

    monkeypatch.setattr(cobot, "read_segment", kept)

    def befalls(tasks: Any) -> None:
        kills.append(lambda: tasks["dynamics"].running and kill("dynamics")(tasks))
        kills[0]()

    with pytest.raises(TaskError, match="dynamics"):
        run(cobot, tmp_path, monkeypatch, befalls)
    assert "stopped: silent dynamics" in capfd.readouterr().out
    assert "OPERATION ENABLED" not in {servo.drive_state() for servo in segments[0]}


def test_without_the_trajectory_it_holds(
    cobot: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    outcome = run(cobot, tmp_path, monkeypatch, kill("trajectory"))
    assert "trajectory" in str(outcome.tasks.failures[0])
    recording = record.read(outcome.path)
    way = abs(np.diff(recording["target_position"], axis=0)).max(axis=1)
    middle = (recording["target_position"][1:, 0] > 0.5) & (
        recording["target_position"][1:, 0] < 1.5
    )
    assert (way[middle] < 1e-6).any()  # nothing was left to follow: the next motion begins at rest
    assert came_home(outcome)


def test_without_the_log_the_arm_knows_nothing_of_it(
    cobot: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    outcome = run(cobot, tmp_path, monkeypatch, kill("log"))
    assert outcome.stopped == []
    assert "log" in str(outcome.tasks.failures[0])
    recording = record.read(outcome.path)  # as far as it got
    assert recording.ended == "cut off"
    assert len(recording["number"]) <= AT


@pytest.mark.parametrize("lasting", [0.3, 2.5])
def test_a_drive_in_fault_stops_all_and_the_motion_goes_on_after_it(
    cobot: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lasting: float
) -> None:
    read_segment = cobot.read_segment

    def with_fault(path: str, **options: Any) -> Any:
        segment = read_segment(path, **options)
        segment.inject(drive_fault(2, at=1.5, for_=lasting))
        return segment

    monkeypatch.setattr(cobot, "read_segment", with_fault)
    outcome = run(cobot, tmp_path, monkeypatch, lambda tasks: None)
    assert outcome.stopped[0][2] == "drive fault"
    assert came_home(outcome)
