"""`benchmarks/acceptance.py`: its commands are valid, its aims are ratios that `loop` reports."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.acceptance import AIMS, SETTINGS, command, main, result, verdicts
from benchmarks.cli.main import make_parser
from benchmarks.ratios import ratios
from catenary.bench.statistics import combine
from tests.bench.test_statistics import make_round


@pytest.mark.parametrize("setting", SETTINGS)
def test_the_commands_are_valid(setting: str, tmp_path: Path) -> None:
    asked = make_parser().parse_args(command(setting, 1.0, tmp_path))
    assert asked.json == tmp_path / f"acceptance-{setting}.json"
    assert asked.drives == (33 if setting == "33" else 3)
    assert (asked.busy_wait > 0) == ("c-busy" in asked.peers) == (setting == "busy")


@pytest.mark.parametrize("aim", AIMS)
def test_every_aim_is_a_ratio_that_its_setting_reports(aim: tuple[str, str, float]) -> None:
    setting, ratio, _ = aim
    asked = make_parser().parse_args(command(setting, 1.0, Path()))
    names = ["catenary-inline", "catenary-threaded", "catenary-law", *asked.peers.split(",")]
    assert ratio in ratios([combine(name, [make_round(1, 1, 1)]) for name in names])


def test_each_aim_is_judged(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = {name: {"wake_to_sent: catenary-law / c": 0.9} for name in SETTINGS}
    lines = verdicts(found)
    assert lines[1].endswith("1.00   0.900  reached")
    assert lines[2].endswith("0.85   0.900  NOT REACHED")
    assert lines[3].endswith("-  not measured")
    for name, each in found.items():
        result(tmp_path, name).write_text(json.dumps({"ratios": each}))
    assert main(["--judge", str(tmp_path)]) == 0
    assert capsys.readouterr().out.strip().splitlines() == lines
