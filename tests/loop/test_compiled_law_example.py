"""examples/compiled_law.py: it is short, runs, and reaches its target."""

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "compiled_law.py"


def test_the_arm_reaches_its_target() -> None:
    pytest.importorskip("numba", reason="laws are compiled by Numba: pip install 'catenary[law]'")
    done = subprocess.run(
        [sys.executable, str(EXAMPLE)], capture_output=True, text=True, check=True
    )
    lines = done.stdout.splitlines()
    assert lines[0].startswith("5002 steps")
    errors = [float(number) for number in lines[1].partition("[")[2].partition("[")[2][:-1].split()]
    assert len(errors) == 3
    assert all(abs(error) < 0.01 for error in errors)
    assert lines[-3] == "5004 cycles: 0 late, 0 uncommitted, 0 underrun, 0 lost"
    assert lines[-1] == "No cycle was late, uncommitted, underrun or lost."


def test_it_is_short() -> None:
    assert len(EXAMPLE.read_text().splitlines()) <= 40
