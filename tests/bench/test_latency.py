"""`catenary bench latency`: output, file and errors, without limits on the latency."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from catenary.cli.main import main


def test_the_verdict_is_printed_and_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "latency.json"
    status = main(["bench", "latency", "--seconds", "0.2", "--json", str(file)])
    printed = capsys.readouterr().out
    found = json.loads(file.read_text())
    assert found["latency_us"]["count"] > 0
    assert status == (1 if found["verdict"]["status"] == "FAIL" else 0)
    assert f"  {found['verdict']['status']}  latency" in printed
    assert main(["bench", "report", str(file)]) == 0
    assert printed == capsys.readouterr().out + f"wrote {file}\n"


def test_an_unknown_cpu_is_an_error_of_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "latency", "--seconds", "0.1", "--cpu", "9999"]) == 1
    assert "CPU 9999 does not exist" in capsys.readouterr().err
