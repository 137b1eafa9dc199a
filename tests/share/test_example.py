"""The example reads cycles, commands an axis, and ends without an error."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from tests.share.names import files_of

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "attach_from_another_process.py"


def test_example_reads_and_commands() -> None:
    done = subprocess.run(
        [sys.executable, str(EXAMPLE)], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    first, second = done.stdout.splitlines()
    assert "0 Catenary virtual servo at 0.1" in first, done.stderr
    assert re.match(r"\d+ cycles, \d+ lost, fastest \d", second)
    code = [line for line in EXAMPLE.read_text().splitlines() if line.strip()]
    assert len(code) <= 36
    assert not files_of("example")
