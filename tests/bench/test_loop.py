from __future__ import annotations

import json
from importlib.util import find_spec

import pytest

from catenary.bench.loop import MODULES, check_busy_wait, own_names, show
from catenary.bench.report import COLUMNS, as_text
from catenary.bench.setting import Setting
from catenary.bench.statistics import combine
from tests.bench.test_statistics import make_round


def test_a_law_runs_if_numba_is_installed() -> None:
    assert own_names() == list(MODULES)[: 3 if find_spec("numba") else 2]


def test_a_busy_wait_is_less_than_the_period() -> None:
    check_busy_wait(50e-6, 1000)
    for seconds in (1e-3, -1e-6):
        with pytest.raises(ValueError, match="less than the period"):
            check_busy_wait(seconds, 1000)


def test_the_file_has_the_setting_and_all_runs(tmp_path, capsys) -> None:
    runs = [combine(name, [make_round(500, 4000, 5500)]) for name in MODULES]
    show(Setting(drives=2, busy_wait=50e-6), runs, {}, tmp_path / "loop.json")
    printed = capsys.readouterr().out
    assert "2 drives at 1000 Hz, body sine, busy-wait 50 us" in printed
    assert "ratios" not in printed
    figures = json.loads((tmp_path / "loop.json").read_text())
    assert (figures["drives"], figures["rate"], figures["ratios"]) == (2, 1000, {})
    assert [run["name"] for run in figures["runs"]] == list(MODULES)


def test_the_names_of_the_phases_are_apart() -> None:
    text = as_text([combine("c", [make_round(500, 4000, 5500)])], {})
    [head] = [line for line in text.splitlines() if line.startswith("phases, median")]
    assert head.split()[3:] == list(COLUMNS)


def test_a_missing_ratio_is_a_dash() -> None:
    runs = [combine("c", [make_round(500, 4000, 5500)])]
    text = as_text(runs, {"post_processing: a / b": 1.5, "process: c / d": 2.0})
    assert text.splitlines()[-2].split() == ["a", "/", "b", "1.50", "-"]
    assert text.splitlines()[-1].split() == ["c", "/", "d", "-", "2.00"]
