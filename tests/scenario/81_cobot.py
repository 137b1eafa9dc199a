"""The cobot of `examples/cobot`: six tasks, an arm under torque control, and a key press during a
motion. The arm tracks the reference, keeps its limits, stops within one cycle and then continues.
The complete program runs as for a user, in virtual time.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the arm is simulated by MuJoCo: pip install 'catenary[sim]'")
pytest.importorskip("ruckig", reason="motions are made by ruckig: pip install 'catenary[traj]'")
pytest.importorskip("mcap", reason="recordings are MCAP files: pip install 'catenary[log]'")

from catenary import record

COBOT = Path(__file__).resolve().parents[2] / "examples" / "cobot" / "cobot.py"
LIMITS = {1: 1.5, 2: 4.0, 3: 40.0}  # of the motions: velocity, acceleration, jerk
TORQUE = np.array([431.97, 431.97, 197.23, 79.79, 79.79, 79.79])  # limits of the gears, arm.xml
CASCADE = np.array([430, 430, 195, 79, 79, 79])  # limits of the cascade
SPEED = np.array([2.6, 2.6, 2.6, 3.1, 3.1, 3.1])
GIVEN = 1.001  # torques are sent in whole per mille of the rated one
QUICK_STOP, ENABLE_VOLTAGE = 0x04, 0x02  # controlword
OPERATION_ENABLED = 0x27  # statusword, masked by 0x6F
PERIOD = 1e-3


def run(folder: Path, *options: str) -> str:
    """Run the whole program in virtual time, and return its output."""
    program = [sys.executable, str(COBOT), "--name", f"cobot-of-{os.getpid()}"]
    done = subprocess.run(
        [*program, "--headless", "--out", str(folder), *options],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        env={**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"},
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cobot")
    printed = run(folder)
    assert "published: utilisation 73.7%" in printed
    return folder


def test_the_arm_tracks_only_with_gravity_compensation(out: Path) -> None:
    found = json.loads((out / "cobot.json").read_text())
    assert found["rms_deg"] <= 0.5
    assert found["rms_deg_without"] >= 5 * found["rms_deg"]


def test_all_deadlines_are_met(out: Path) -> None:
    found = json.loads((out / "cobot.json").read_text())
    assert found["schedulable"]
    assert 0 < found["utilisation"] < 0.737
    assert [task["name"] for task in found["tasks"]] == [
        "dynamics",
        "main control",
        "trajectory",
        "ros2",
        "log",
        "stop",
    ]


def motions(recording: record.Recording) -> list[np.ndarray]:
    """Return the reference [rad] of each motion, without the parts that follow the arm."""
    reference = recording["target_position"]
    free = (reference != recording["position"]).any(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], free, [False]])))
    runs = [reference[a:b] for a, b in edges.reshape(-1, 2)]
    return [run for run in runs if abs(run[-1] - run[0]).max() > 0.1]


def test_every_cycle_is_recorded_and_no_sample_exceeds_a_limit(out: Path) -> None:
    recording = record.read(out / "cobot.mcap")
    assert recording.lost == 0
    assert (np.diff(recording["number"]) == 1).all()
    assert (abs(recording["velocity"]) <= SPEED).all()
    assert (abs(recording["torque"]) <= TORQUE).all()
    assert (abs(recording["commanded_torque"]) <= TORQUE).all()
    assert (abs(recording["target_torque"]) <= CASCADE).all()
    assert abs(recording["target_torque"][:, 1]).max() > 30  # the torque of gravity, not zero
    found = motions(recording)
    assert len(found) >= 2  # up and down, up to the stop; from there; down
    for motion in found:
        for order, limit in LIMITS.items():
            difference = abs(np.diff(motion, order, axis=0)).max() / PERIOD**order
            assert difference <= limit * (1 + 1e-6)
            assert difference > limit * 0.5 or order == 1  # limits that are used


def test_the_stop_is_sent_within_a_cycle_and_the_arm_continues_later(out: Path) -> None:
    """The recording has the marker of the cause, and the controlwords that were sent."""
    recording = record.read(out / "cobot.mcap")
    [cause] = [event for event in recording.events if event.kind == "Marker"]
    assert cause.message == "stop: key"
    words = recording["controlword"].astype(int)
    braking = (words & (QUICK_STOP | ENABLE_VOLTAGE) == ENABLE_VOLTAGE).all(axis=1)
    enabled = ((recording["statusword"] & 0x6F) == OPERATION_ENABLED).all(axis=1)
    begun = np.flatnonzero(recording["scheduled_ns"] >= round(cause.time * 1e9))[0]
    assert enabled[begun]
    assert braking[begun]  # the first frame of a cycle that began after the key was hit
    assert not braking[enabled][: np.count_nonzero(enabled[: begun - 1])].any()  # none before
    assert 0.5 < recording["position"][begun].max() < 1.5  # during the motion
    found = json.loads((out / "cobot.json").read_text())
    [stop], [reaction] = found["stops"], found["reactions"]
    assert stop["reason"] == reaction["reason"] == "key"
    assert 0 <= reaction["cycles"] <= 1
    assert 0 < reaction["seconds"] <= PERIOD + 130e-6  # and the declared execution time
    assert (abs(recording["velocity"][-1]) < 0.05).all()
    assert abs(recording["target_position"][-1]).max() < 1e-6  # it still returned home


@pytest.mark.shared_data
def test_the_published_arm_from_its_description_file(shared_data: Path, tmp_path: Path) -> None:
    """The URDF of the Indy7 is used for the plant and the model, with the masses of its maker."""
    description = shared_data / "robots/indy7/derived_indy7_flat.urdf"
    plant, devices = (COBOT.parent / "segment.toml").read_text().split("[[device]]", 1)
    plant = plant.replace('model = "arm.xml"', f'model = "{description}"\ncontacts = false')
    for n, name in enumerate(("base", "shoulder", "elbow", "wrist1", "wrist2", "wrist3")):
        plant = plant.replace(f'name = "{name}"', f'name = "joint{n}"')
    segment = tmp_path / "indy7.toml"
    segment.write_text(f"{plant}[[device]]{devices}")
    run(tmp_path, "--arm", str(description), "--segment", str(segment))
    found = json.loads((tmp_path / "cobot.json").read_text())
    assert found["rms_deg"] <= 0.5
    assert found["rms_deg_without"] >= 5 * found["rms_deg"]
    assert [each["cycles"] <= 1 for each in found["reactions"]] == [True]
