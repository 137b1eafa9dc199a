"""Faults during a motion of the cobot's program: its tasks are killed one by one (kill -9), a drive
reports a fault, the bus is lost, or a joint does not follow. The arm holds or stops within one
cycle, reports the reason, and returns home after recovery.
"""

from __future__ import annotations

import importlib
import os
import signal
import sys
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the arm is simulated by MuJoCo: pip install 'catenary[sim]'")
pytest.importorskip("ruckig", reason="motions are made by ruckig: pip install 'catenary[traj]'")
pytest.importorskip("mcap", reason="recordings are MCAP files: pip install 'catenary[log]'")

from benchmarks.cobot import reactions
from catenary import record
from catenary.drive import Phase, Recovery
from catenary.errors import CatenaryError, TaskError
from catenary.virtual.faults import Fault, cut, drive_fault, safe_torque_off

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "cobot"
AT = 1000  # cycle: half-way up


@pytest.fixture
def cobot(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(FOLDER))
    module = importlib.import_module("cobot")
    yield module
    sys.modules.pop("cobot", None)


def run(
    cobot: Any,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    befalls: Callable[[int, Any], None],
    goals: Sequence[float] = (np.pi / 2, 0.0),
) -> Any:
    """Run one motion up and home, and call `befalls(number, tasks)` in every cycle."""
    running: list[Any] = []
    tasks_class = cobot.realtime.Tasks

    def tasks(*arguments: Any, **options: Any) -> Any:
        running.append(tasks_class(*arguments, **options))
        return running[0]

    class Watched(Recovery):
        def step(self, cycle: Any, reason: str | None = None, *, ready: bool = True) -> Phase:
            befalls(cycle.number, running[0])
            return super().step(cycle, reason, ready=ready)

    monkeypatch.setattr(cobot.realtime, "Tasks", tasks)
    monkeypatch.setattr(cobot.cat.drive, "Recovery", Watched)
    options = {
        "arm": str(FOLDER / "arm.xml"),
        "folder": folder,
        "name": f"cobot-of-{os.getpid()}",
        "goals": [np.full(6, goal) for goal in goals],
    }
    segment = str(FOLDER / "segment.toml")
    return cobot.run(segment, virtual=True, gravity=True, key_at=None, **options)


def with_fault(cobot: Any, monkeypatch: pytest.MonkeyPatch, fault: Fault) -> None:
    """Inject a fault into the segment of the run."""
    read_segment = cobot.read_segment

    def faulty(path: str, **options: Any) -> Any:
        segment = read_segment(path, **options)
        segment.inject(fault)
        return segment

    monkeypatch.setattr(cobot, "read_segment", faulty)


def nothing(number: int, tasks: Any) -> None:
    """Do nothing to the tasks."""


def kill(name: str, at: Collection[int] = (AT,)) -> Callable[[int, Any], None]:
    def befalls(number: int, tasks: Any) -> None:
        if number in at and tasks[name].running:
            os.kill(tasks[name].process, signal.SIGKILL)

    return befalls


def came_home(outcome: Any) -> bool:
    recording = record.read(outcome.path)
    return bool(abs(recording["target_position"][-1]).max() < 1e-6)


def reasons(outcome: Any) -> list[str]:
    """Return the reasons of the stops, after checking that each was sent within a cycle."""
    answers = reactions(record.read(outcome.path))
    assert [answer.reason for answer in answers] == [stop.reason for stop in outcome.stopped]
    assert all(answer.cycles <= 1 for answer in answers)
    return [stop.reason for stop in outcome.stopped]


def test_the_killed_dynamics_task_restarts_in_time(
    cobot: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    outcome = run(cobot, tmp_path, monkeypatch, kill("dynamics"))
    assert reasons(outcome) == []
    assert "dynamics" in str(outcome.tasks.failures[0])
    assert came_home(outcome)


def test_without_the_dynamics_task_the_arm_stops_and_the_program_ends(
    cobot: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The task is killed more often than it is restarted, which ends all tasks."""
    read_segment, segments = cobot.read_segment, []
    reasons: list[str | None] = []

    def kept(path: str, **options: Any) -> Any:
        segments.append(read_segment(path, **options))
        return segments[0]

    def watched(*arguments: Any) -> Any:
        reasons.append(why_stop(*arguments))
        return reasons[-1]

    why_stop = cobot.why_stop
    monkeypatch.setattr(cobot, "why_stop", watched)
    monkeypatch.setattr(cobot, "read_segment", kept)
    with pytest.raises(TaskError, match="dynamics"):
        run(cobot, tmp_path, monkeypatch, kill("dynamics", range(AT, AT + 250, 50)))
    assert set(reasons) == {None, "silent dynamics"}
    assert "OPERATION ENABLED" not in {servo.drive_state() for servo in segments[0]}


def test_a_killed_trajectory_task_continues_its_motion(
    cobot: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The restarted task begins with the velocity of the reference at the last row."""
    outcome = run(cobot, tmp_path, monkeypatch, kill("trajectory"))
    assert "trajectory" in str(outcome.tasks.failures[0])
    assert reasons(outcome) == []
    reference = record.read(outcome.path)["target_position"]
    assert abs(np.diff(reference, 2, axis=0)).max() <= 4.0 * 1e-6 * 1.001  # [rad] a cycle squared
    assert came_home(outcome)


def test_missing_set_points_stop_the_arm_until_new_ones_arrive(
    cobot: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The rows of the trajectory are lost for a while at full speed."""
    take = cobot.realtime.Queue.take
    number = 0

    def befalls(now: int, tasks: Any) -> None:
        nonlocal number
        number = now

    def lossy(queue: Any) -> Any:
        row = take(queue)
        return None if AT < number < AT + 20 else row

    monkeypatch.setattr(cobot.realtime.Queue, "take", lossy)
    outcome = run(cobot, tmp_path, monkeypatch, befalls)
    assert reasons(outcome) == ["dry set-points"]
    assert AT < outcome.stopped[0].number < AT + 3
    assert came_home(outcome)


def test_an_unreachable_target_is_reported_and_the_arm_holds(
    cobot: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The motion to the first goal ends, and the next one does not begin.

    Restarts of the trajectory task do not help, and the program ends with its error.
    """
    with pytest.raises(TaskError, match=r"trajectory(.|\n)*position_max"):
        run(cobot, tmp_path, monkeypatch, nothing, goals=[0.1, 4.0])
    recording = record.read(tmp_path / "cobot.mcap")
    assert 0.09 < abs(recording["position"]).max() < 0.11


def test_a_killed_log_task_does_not_affect_the_arm(
    cobot: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    outcome = run(cobot, tmp_path, monkeypatch, kill("log"))
    assert outcome.stopped == []
    assert "log" in str(outcome.tasks.failures[0])
    recording = record.read(outcome.path)  # up to the kill
    assert recording.ended == "cut off"
    assert len(recording["number"]) <= AT


@pytest.mark.parametrize("lasting", [0.3, 2.5])
def test_a_drive_fault_stops_the_arm_and_the_motion_continues_later(
    cobot: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lasting: float
) -> None:
    with_fault(cobot, monkeypatch, drive_fault(2, at=1.5, for_=lasting))
    outcome = run(cobot, tmp_path, monkeypatch, nothing)
    assert reasons(outcome) == ["drive fault"]
    assert came_home(outcome)


@pytest.mark.parametrize(
    ("lasting", "between"), [(0.01, ("main", 0)), (0.7, (2, 3))], ids=["all", "the wrist"]
)
def test_the_program_waits_for_a_lost_bus(
    cobot: Any,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    lasting: float,
    between: tuple[int, int],
) -> None:
    """The loss is shorter than the drives' watchdogs, or so long that the drives are in fault."""
    with_fault(cobot, monkeypatch, cut(between=between, at=1.5, for_=lasting))
    outcome = run(cobot, tmp_path, monkeypatch, nothing)
    assert reasons(outcome) == ["lost bus"]
    assert came_home(outcome)


def test_a_permanently_lost_bus_ends_the_program(
    cobot: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with_fault(cobot, monkeypatch, cut(between=("main", 0), at=1.5))
    with pytest.raises(CatenaryError, match="lost for 3000 cycles"):
        run(cobot, tmp_path, monkeypatch, nothing)


def test_a_joint_that_does_not_follow_stops_the_arm(
    cobot: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its torque is off for a short time, and its brake is closed."""
    with_fault(cobot, monkeypatch, safe_torque_off(1, at=1.5, for_=0.8))
    outcome = run(cobot, tmp_path, monkeypatch, nothing)
    assert reasons(outcome) == ["following error"]
    assert came_home(outcome)


def test_a_joint_out_of_its_range_returns(
    cobot: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Angles above 1 rad are out of range, from the middle of the motion until the arm stands."""
    reach = cobot.REACH

    def befalls(number: int, tasks: Any) -> None:
        cobot.REACH = 1.0 if AT - 400 < number < AT + 900 else reach

    outcome = run(cobot, tmp_path, monkeypatch, befalls)
    assert reasons(outcome) == ["limit"]
    recording = record.read(outcome.path)
    assert recording["position"].max() > 1.5  # it reached the goal
    assert came_home(outcome)
