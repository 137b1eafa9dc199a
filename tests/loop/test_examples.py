"""Every example runs without arguments. The output of some of them is checked."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
TESTED_ELSEWHERE = (
    "compiled_law.py",
    "sensors.py",
    "three_tasks.py",
    "tool.py",
    "two_networks.py",
)


def run(name: str, *arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / name), *arguments],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize(
    "name",
    sorted(path.name for path in EXAMPLES.glob("*.py") if path.name not in TESTED_ELSEWHERE),
)
def test_it_runs_without_arguments(name: str) -> None:
    assert run(name)


def test_a_tool_that_is_connected_and_disconnected() -> None:
    out = run("tool.py")
    assert "device 2" in out
    assert "does not answer any more" in out
    assert "answers again" in out
    assert out.endswith("the tool is present\n")


def test_two_networks() -> None:
    out = run("two_networks.py")
    assert "network 0: 0 lost" in out
    assert "network 1: 0 lost" in out


def test_a_sensor_that_becomes_stale() -> None:
    out = run("sensors.py")
    turned = re.fullmatch(r"axis 0 at (\d\.\d\d) rad; stopped: .+\n", out)
    assert turned is not None, out
    assert float(turned[1]) > 0.1
