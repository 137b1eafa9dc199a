"""Comparison of two runs: medians by name, and errors."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tools.rtlab import __main__ as lab


def write(file: Path, median: float, command: str = "python -m benchmarks table x") -> Path:
    entries = [
        {"way": "C", "name": "tau1", "response": {"p50": 5.0, "max": median}},
        {"way": "C", "name": "tau2", "response": {"p50": median}},
    ]
    result = {"tasks": entries, "published": {"p50": 1e9 * median}}
    file.parent.mkdir(exist_ok=True)
    file.write_text(json.dumps({"command": command, "result": result}))
    return file


def test_the_largest_differences_of_medians_are_printed(tmp_path: Path, capsys) -> None:
    one, other = write(tmp_path / "a.json", 100.0), write(tmp_path / "b.json", 99.0)
    assert lab.main(["--compare", str(one), str(other)]) == 0
    said = capsys.readouterr().out.strip()
    assert said == "a: 2 medians, at most 1.00% apart: tasks/C, tau2/response 100, 99"


def test_folders_are_compared_table_by_table(tmp_path: Path, capsys) -> None:
    for name in ("rtlab-law.json", "rtlab-skew.json"):
        write(tmp_path / "a" / name, 0.0)
        write(tmp_path / "b" / name, 0.0)
    write(tmp_path / "a" / "rtlab-tasks.json", 1.0)
    assert lab.main(["--compare", str(tmp_path / "a"), str(tmp_path / "b")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(":")[0] for line in lines] == ["rtlab-law", "rtlab-skew"]
    assert all("0.00% apart" in line for line in lines)


@pytest.mark.parametrize(
    ("text", "said"), [("[]", "is not a result of the lab"), ("{", "is not a result of the lab")]
)
def test_an_invalid_result_is_an_error_of_one_line(
    tmp_path: Path, capsys, text: str, said: str
) -> None:
    one, other = write(tmp_path / "a.json", 1.0), tmp_path / "b.json"
    other.write_text(text)
    assert lab.main(["--compare", str(one), str(other)]) == 1
    captured = capsys.readouterr().err
    assert captured.count("\n") == 1
    assert said in captured


def test_results_of_different_commands_are_not_compared(tmp_path: Path, capsys) -> None:
    one = write(tmp_path / "a.json", 1.0)
    other = write(tmp_path / "b.json", 1.0, "python -m benchmarks table y")
    assert lab.main(["--compare", str(one), str(other)]) == 1
    assert "two commands" in capsys.readouterr().err
