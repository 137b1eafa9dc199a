"""The study of the balance states its results as a table, as JSON and as plots."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("mujoco", reason="the body is simulated by MuJoCo: pip install 'catenary[sim]'")

import study
from simulation import Plain, Push, Simulation


@pytest.fixture(scope="module")
def results() -> dict[str, dict[str, Any]]:
    quiet = Simulation().run(Plain(), 1.2)
    fast = Simulation().run(Plain(), 3.0, (Push((400.0, 0.0), 0.0),))
    found = {
        "push": {"forward": fast, "backward": quiet},
        "tilt": {"forward": quiet, "backward": quiet},
        "sway": quiet,
        "lost": {1: "", 2: "the pelvis is tilted by 30 degrees"},
        "impulse": dict(zip(study.DIRECTIONS, (30.04, 20.0, 40.0, 41.0), strict=True)),
    }
    return {"plain PD": found}


def test_the_summary_has_all_results(results: dict[str, dict[str, Any]]) -> None:
    [row] = json.loads(json.dumps(study.summary(results))).values()
    assert row["push_60_n"].startswith("falls: forward 0.")
    assert row["tilt_4_deg"] == "stands"
    assert 0 < row["sway_mm"][0] < 10
    assert row["impulse_n_s"] == {"forward": 30.0, "backward": 20.0, "left": 40.0, "right": 41.0}
    assert row["one_foot_sensor_lost"] == "stands"
    assert row["both_foot_sensors_lost"] == "the pelvis is tilted by 30 degrees"


def test_the_table_names_the_law_and_the_impulses(results: dict[str, dict[str, Any]]) -> None:
    text = study.table(study.summary(results))
    assert text.startswith("plain PD\n")
    assert "forward 30, backward 20, left 40, right 41 N·s" in text


@pytest.mark.parametrize("most", [0.0, 5.0, 31.0])
def test_the_largest_impulse_is_one_after_which_the_robot_stands(
    most: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Falling:
        """Simulation that falls after an impulse of more than `most` [N·s]."""

        def run(self, control: object, seconds: float, pushes: tuple[Push, ...]) -> Any:
            [push] = pushes
            return SimpleNamespace(fall="" if push.force[0] * push.length <= most else "fallen")

    monkeypatch.setattr(study, "simulation", lambda law: Falling())
    found = study.impulse("plain PD", "forward")
    assert found <= most < found + study.RESOLUTION


def test_a_fall_has_no_sway(results: dict[str, dict[str, Any]]) -> None:
    assert study.sway_of(results["plain PD"]["push"]["forward"]) == [float("inf")] * 2


def test_the_plots_are_written(results: dict[str, dict[str, Any]], tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="draws the plots: pip install matplotlib")
    paths = study.plot(results, tmp_path)
    assert [path.name for path in paths] == [
        "study_push.png",
        "study_tilt.png",
        "study_impulse.png",
    ]
    assert all(path.stat().st_size > 10_000 for path in paths)
