"""Two cobots on two machines in one ROS 2 graph: examples/two_machines, over a real cable."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import catenary as cat
from tests.machines.namespaces import Machine, connected_machines
from tests.share.names import own_name

pytest.importorskip("cyclonedds", reason="needs cyclonedds (catenary[ros2])")

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "two_machines"
LIMIT = 120.0  # [s]


@pytest.fixture
def machines(
    veth: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> Iterator[tuple[Machine, Machine]]:
    """Two machines; `veth` skips the test without a private network."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(1 + os.getpid() % 200))
    monkeypatch.delenv("ROS_AUTOMATIC_DISCOVERY_RANGE", raising=False)
    with connected_machines(2) as (first, second):
        yield first, second


@contextmanager
def robot(machine: Machine, role: str, name: str, namespace: str) -> Iterator[None]:
    """Run a robot; interrupt it at the end, as Ctrl-C does."""
    options = ("--name", name, "--namespace", namespace)
    process = machine.start(str(FOLDER / "robot.py"), role, *options)
    try:
        yield
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(LIMIT)


def test_two_arms_move_in_one_graph(machines: tuple[Machine, Machine]) -> None:
    first, second = machines
    with (
        own_name("left") as left,
        own_name("right") as right,
        robot(first, "arm", left, "left"),
        robot(second, "arm", right, "right"),
    ):
        command = second.command(str(FOLDER / "together.py"), "left", "right")
        done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT)
        assert (done.returncode, done.stderr) == (0, "")
        lines = done.stdout.splitlines()
        assert [line.partition(":")[0] for line in lines] == ["left", "right"]
        for name in (left, right):
            with cat.attach(name) as share:
                moved = share.rows(0)[0]["position"]
                assert moved.shape[1] == 6
                assert abs(share.read()["position"] - 0.3).max() < 0.02  # [rad]


def test_a_mobile_base_and_its_arm(machines: tuple[Machine, Machine]) -> None:
    """The wheels stop by the time-out of the bridge, without a command to stop."""
    first, second = machines
    with (
        own_name("base") as base,
        own_name("arm") as arm,
        robot(first, "base", base, "base"),
        robot(second, "arm", arm, "arm"),
    ):
        command = second.command(str(FOLDER / "drive.py"), "base", "arm")
        done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT)
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout.splitlines()[1] == "arm: 6 joints hold"
        with cat.attach(base) as share:
            assert share.read()["position"].min() > 2.0  # [rad]
            assert abs(share.read()["velocity"]).max() < 0.05  # [rad/s]


def test_one_machine_leaves_and_the_other_moves_on(machines: tuple[Machine, Machine]) -> None:
    first, second = machines
    with own_name("left") as left, own_name("right") as right, robot(first, "arm", left, "left"):
        with robot(second, "arm", right, "right"):
            both = first.command(str(FOLDER / "together.py"), "left", "right")
            subprocess.run(both, check=True, capture_output=True, timeout=LIMIT)
        command = first.command(str(FOLDER / "together.py"), "left")
        done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT)
        assert (done.returncode, done.stderr) == (0, "")
        with cat.attach(left) as share:
            assert abs(share.read()["position"] - 0.6).max() < 0.02  # [rad]
