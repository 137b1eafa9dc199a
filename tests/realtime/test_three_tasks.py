"""examples/three_tasks.py runs, and shows the published responses."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "three_tasks.py"


def test_the_responses_equal_the_published_ones():
    done = subprocess.run(
        [sys.executable, str(EXAMPLE)], capture_output=True, text=True, check=True
    )
    lines = done.stdout.splitlines()
    assert [line.split()[1] for line in lines[1:4]] == ["400", "200", "100"]
    assert [line.split()[-1] for line in lines[5:8]] == ["3.000", "8.000", "29.000"]
    assert lines[8].startswith("schedulable: utilisation 80.0%")


def test_the_example_is_short():
    assert len(EXAMPLE.read_text().splitlines()) <= 40
