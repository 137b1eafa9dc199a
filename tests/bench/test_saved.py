"""`catenary bench report`: a saved result is printed like a new one."""

from __future__ import annotations

from pathlib import Path

import pytest

from catenary.bench.loop import MODULES, show
from catenary.bench.setting import Setting
from catenary.bench.statistics import combine
from catenary.cli.main import main
from tests.bench.test_statistics import make_round


def test_a_saved_loop_is_printed_with_the_verdict(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "loop.json"
    runs = [combine(name, [make_round(500, 4000, 5500, lost=2)]) for name in MODULES]
    show(Setting(drives=2, rate=4000, spin=True), runs, {"send: a / b": 1.5}, file)
    printed = capsys.readouterr().out
    assert "catenary-law        WARN  worst output delay 60.0 us, 24.0% of the period" in printed
    assert main(["bench", "report", str(file)]) == 0
    assert printed == capsys.readouterr().out + f"wrote {file}\n"


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"runs": [{}], "machine": "", "ratios": {}}'])
def test_another_file_is_an_error_of_one_line(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "other.json"
    file.write_text(text)
    assert main(["bench", "report", str(file)]) == 1
    [line] = capsys.readouterr().err.splitlines()
    assert "other.json is not a result of `catenary bench loop` or" in line


def test_a_missing_file_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "report", "nowhere.json"]) == 1
    assert "nowhere.json: No such file" in capsys.readouterr().err
