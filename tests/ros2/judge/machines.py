"""A virtual machine in the background, and `catenary ros2` under rclpy as a process."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

import pytest

import catenary as cat
from catenary.virtual import Segment
from catenary.virtual.devices import Coupler, Servo
from tests.remote.programs import Running, program
from tests.ros2.judge.process import FOLDER, Graph

COMMAND_PERIOD = 0.002  # [s]


@contextmanager
def background_machine(servo: Servo) -> Iterator[Running]:
    """Run a loop of one axis in the background. A thread applies the leased commands."""
    stop = threading.Event()
    policy = cat.StopPolicy(on_axis_stopped="event", raise_faults=False)
    with program(segment=Segment([Coupler(), servo]), stop=policy) as running:

        def apply() -> None:
            while not stop.wait(COMMAND_PERIOD):
                with running.loop.update():
                    running.share.apply(running.arm)

        thread = threading.Thread(target=apply)
        thread.start()
        try:
            yield running
        finally:
            stop.set()
            thread.join()


def loader_for(judge: Path) -> Path:
    """Return the loader of Catenary's editable installation; skip if the judge cannot use it."""
    found = find_spec("_editable_skbc_catenary")
    if found is None or found.origin is None:
        pytest.skip(
            "needs an editable installation of Catenary, whose modules rclpy's Python loads"
        )
    ask = "import sys; print(*sys.version_info[:2])"
    version = subprocess.run([judge, "-c", ask], capture_output=True, text=True, check=True).stdout
    own = " ".join(map(str, sys.version_info[:2]))
    if version.strip() != own:
        pytest.skip(f"rclpy's Python is {version.strip()}; the compiled modules are for {own}")
    return Path(found.origin)


@contextmanager
def bridge_under_rclpy(name: str, graph: Graph, *options: str) -> Iterator[subprocess.Popen[str]]:
    """Run `catenary ros2` as /left/catenary in the judge's environment."""
    command = [str(graph.judge), str(FOLDER / "command.py"), str(loader_for(graph.judge))]
    with subprocess.Popen(
        [*command, "ros2", name, "--backend", "rclpy", "--namespace", "/left", *options],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, **graph.environment},
    ) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline().startswith("/left/catenary by rclpy")
            yield process
        finally:
            process.terminate()
