"""`python -m benchmarks table`: each table in a line of the help, an unknown one answered by the
list."""

from __future__ import annotations

import json
from importlib.util import find_spec
from pathlib import Path

import pytest

from benchmarks.cli.main import main
from benchmarks.tables import TABLES


def test_the_help_explains_each(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["table", "--help"])
    text = capsys.readouterr().out
    for name, table in TABLES.items():
        assert find_spec(f"benchmarks.tables.{name}"), name
        assert any(line.split()[:1] == [name] and table.help in line for line in text.splitlines())


def test_an_unknown_one_is_answered_by_the_list(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["table", "rteml2"]) == 2
    assert f"known tables: {', '.join(TABLES)}" in capsys.readouterr().err


def test_all_of_it_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "skew.json"
    assert main(["table", "skew", "--seconds", "0.01", "--json", str(file)]) == 0
    text = capsys.readouterr().out
    assert "other machines: compare ratios" in text
    assert f"wrote {file}" in text
    written = json.loads(file.read_text())
    assert written["table"] == "skew"
    assert {"machine", "date", "command", "versions", "conditions", "ways"} <= set(written)


def test_rates_are_numbers(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["table", "tocabi", "--rates", "4000,x"])
    assert "'x' is not a number" in capsys.readouterr().err
