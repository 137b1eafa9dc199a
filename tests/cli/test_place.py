"""Devices by station alias: `@10` and `@10:1` instead of a position."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import pytest

from catenary.cli.arguments import AliasPlace, place
from catenary.cli.main import main
from catenary.virtual import Coupler, DigitalOutputs, Segment, Servo
from tests.remote.programs import program

Capture = pytest.CaptureFixture[str]
LINE = """
[[device]]
kind = "coupler"
[[device]]
kind = "servo"
alias = 10
[[device]]
kind = "digital_outputs"
[[device]]
kind = "servo"
alias = 11
"""


@pytest.fixture
def target(tmp_path: Path) -> str:
    (tmp_path / "line.toml").write_text(LINE)
    return f"virtual:{tmp_path / 'line.toml'}"


@pytest.mark.parametrize(
    ("text", "found"),
    [("2", 2), ("@10", AliasPlace(10)), ("@0x10:2", AliasPlace(16, 2)), ("@10:0", AliasPlace(10))],
)
def test_places(text: str, found: object) -> None:
    assert place(text) == found


@pytest.mark.parametrize("text", ["@", "@0", "@65536", "@x", "@10:x", "@10:-1", "-1", "10:1"])
def test_wrong_places(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError):
        place(text)


@pytest.mark.parametrize(
    ("line", "position"),
    [
        ("sdo read {} @10 0x1018:1", 1),
        ("sdo write {} @11 0x6065 5000 --type UDINT", 3),
        ("reg read {} @10:1 AL_STATUS", 2),
        ("reg write {} @11 0x0310 0 --size 4", 3),
        ("alias {} @11", 3),
    ],
)
def test_one_device(target: str, line: str, position: int, capsys: Capture) -> None:
    assert main([*line.format(target).split(), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["position"] == position


@pytest.mark.parametrize("line", ["state {} --position @11", "pdos {} @11", "messages {} @11"])
def test_lists_of_one_device(target: str, line: str, capsys: Capture) -> None:
    assert main([*line.format(target).split(), "--json"]) == 0
    assert [each["position"] for each in json.loads(capsys.readouterr().out)] == [3]


def test_the_eeprom_of_a_device(target: str, tmp_path: Path, capsys: Capture) -> None:
    assert main(["sii", "read", target, "@11", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["header"]["station_alias"] == 11


def test_an_unknown_alias_lists_the_others(target: str, capsys: Capture) -> None:
    assert main(["sdo", "read", target, "@12", "0x1018:1"]) == 2
    error = capsys.readouterr().err
    assert "no device has the alias 12" in error
    assert "aliases: 10, 11" in error


def test_an_offset_beyond_the_last_device(target: str, capsys: Capture) -> None:
    assert main(["sdo", "read", target, "@11:1", "0x1018:1"]) == 2
    assert "there is no device 4" in capsys.readouterr().err


def test_an_alias_of_two_devices(tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "twice.toml").write_text('[[device]]\nkind = "servo"\nalias = 7\n' * 2)
    assert main(["state", f"virtual:{tmp_path / 'twice.toml'}", "-p", "@7"]) == 2
    assert "2 devices have the alias 7" in capsys.readouterr().err


def test_devices_of_a_running_program(capsys: Capture) -> None:
    segment = Segment([Coupler(), Servo(alias=10), DigitalOutputs()])
    with program(segment=segment) as running:
        target = f"share:{running.name}"
        assert main(["sdo", "read", target, "@10", "0x1018:1", "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["position"] == 1
        assert main(["state", target, "--position", "@10", "--json"]) == 0
        assert [each["position"] for each in json.loads(capsys.readouterr().out)] == [1]
        assert main(["messages", target, "@10"]) == 0
        assert main(["reg", "read", target, "@9", "AL_STATUS"]) == 2
