"""The examples of devices that come and go, and of two networks, run and say what they promise."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"

TOOL = """
[[device]]
kind = "coupler"
[[device]]
kind = "servo"
[[device]]
kind = "digital_outputs"
alias = 20
[[fault]]
kind = "power_cycle"
device = 2
at = 1.0
for = 0.5
"""


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


def test_a_tool_that_comes_and_goes(tmp_path: Path) -> None:
    cell = tmp_path / "cell.toml"
    cell.write_text(TOOL)
    out = run("tool.py", f"virtual:{cell}")
    assert "device 2" in out
    assert "does not answer any more" in out
    assert "answers again" in out
    assert out.endswith("the tool is there\n")


def test_two_networks() -> None:
    out = run("two_networks.py")
    assert "network 0: 0 lost" in out
    assert "network 1: 0 lost" in out
