"""The whole program in virtual time: pushes, cut cables, a lost sensor and killed tasks."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("mujoco", reason="the body is simulated by MuJoCo: pip install 'catenary[sim]'")
pytest.importorskip("numba", reason="laws need Numba: pip install 'catenary[law]'")
pytest.importorskip("ruckig", reason="motions are made by ruckig: pip install 'catenary[traj]'")
pytest.importorskip("mcap", reason="recordings are MCAP files: pip install 'catenary[log]'")

import body
import numpy as np
import program
import report
from exchange import Cause, Verdict
from run import Setup
from scenarios import FAULTS, Scenario, kill, push

from catenary import record
from tests.share.names import own_name

PERIOD = 1e-3  # [s] of the loop; 250 us only takes longer
FORCE = (60.0, 0.0, 0.0)  # [N]


def started(scenario: Scenario, folder: Path, **options: Any) -> Any:
    with own_name("humanoid") as name:
        options = {"name": name, "period": PERIOD, **options}
        return program.run(Setup(scenario, folder, **options))


class Failing:
    """Policy that keeps the standing pose, and returns NaN from an action on."""

    def __init__(self, first: int) -> None:
        self._left = first

    def __call__(self, observation: Any) -> Any:
        self._left -= 1
        return np.full(33, 0.0 if self._left > 0 else np.nan)


def at(outcome: Any, text: str) -> float:
    """Return the time of the first event with a text [s]."""
    return float(next(event.time for event in outcome.events if text in event.text))


def test_it_withstands_a_push_by_which_plain_pd_falls(tmp_path: Path) -> None:
    pushed = [push(0.1, FORCE, 3.0)]
    balanced = started(Scenario("push", "", 2.0, pushed), tmp_path)
    assert balanced.verdict == Verdict.GO
    found = report.result(balanced)
    assert 0.0 < found.tilt < 0.1
    assert found.lost == found.late == (0, 0)
    plain = started(Scenario("push-pd", "", 4.0, pushed, mode="stand"), tmp_path)
    assert plain.verdict == Verdict.STOP
    assert plain.cause == Cause.FALLEN
    assert at(plain, "fallen: stop") - at(plain, "fallen: damping") == pytest.approx(1.0, abs=0.01)


def test_it_survives_cut_cables_a_lost_force_sensor_and_a_killed_log(tmp_path: Path) -> None:
    happenings = [*FAULTS, kill(1.5, "log")]
    outcome = started(Scenario("faults", "", 2.6, happenings), tmp_path)
    assert outcome.verdict == Verdict.GO
    texts = "\n".join(event.text for event in outcome.events)
    assert "upper: " in texts
    for expected in (
        "the ring is cut between 5 and 6",
        "the ring is cut between 8 and 9",
        "device 16 (left foot) does not answer",
        "device 16 (left foot) answers again",
    ):
        assert expected in texts
    assert [failure.task for failure in outcome.tasks.failures] == ["log"]
    [upper, lower] = sorted(tmp_path.glob("*.mcap"), reverse=True)
    for path, axes in ((upper, 18), (lower, 15)):
        recording = record.read(path)
        assert recording["position"].shape[1] == axes
        assert recording.lost == 0
    assert report.result(outcome).sway < 0.02
    report.report(tmp_path, [outcome])
    [found] = json.loads((tmp_path / "humanoid.json").read_text())
    assert found["stands"]
    assert found["lost"] == [0, 0]
    assert (tmp_path / "faults.png").stat().st_size > 10_000


def test_without_the_balance_task_the_joints_brake_and_the_drives_stop(tmp_path: Path) -> None:
    outcome = started(Scenario("kill-balance", "", 3.0, [kill(0.2, "balancing")]), tmp_path)
    assert outcome.verdict == Verdict.STOP
    assert outcome.cause == Cause.SILENT_BALANCE
    assert at(outcome, "silent balance: damping") - at(outcome, "killed") < 0.015
    torque = outcome.history["torque"][-1]
    assert abs(torque).max() < 0.5 * body.TORQUE.max()


def test_the_balance_replaces_a_policy_that_returns_nan(tmp_path: Path) -> None:
    outcome = started(Scenario("policy", "", 0.4), tmp_path, policy=Failing(80))
    assert outcome.verdict == Verdict.GO
    assert at(outcome, "the policy balances") < at(outcome, "the policy is replaced by the balance")
    assert report.result(outcome).sway < 0.01


def test_a_model_with_other_joints_is_refused_with_their_names(tmp_path: Path) -> None:
    model = tmp_path / "other.xml"
    text = body.MODEL.read_text()
    model.write_text(text.replace('joint name="left_knee"', 'joint name="left_wheel"'))
    setup = Setup(Scenario("stand", "", 0.1), tmp_path, model)
    with pytest.raises(ValueError, match=r"left_knee.*left_wheel"):
        program.run(setup)
