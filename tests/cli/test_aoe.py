"""`aoe` on a virtual segment: text, JSON, exit status and errors."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import pytest

from catenary.cli.main import main

CELL = """
[[device]]
kind = "coupler"

[[device]]
kind = "analog_inputs"
ads = { areas = { "0x4020" = 64, "0x4021" = "text" }, port = 0x1001, name = "probe" }
vendor_echo = {}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "cell.toml").write_text(CELL)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def call(line: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    status = main(shlex.split(line))
    printed = capsys.readouterr()
    return status, printed.out, printed.err


@pytest.mark.usefixtures("folder")
def test_read(capsys: pytest.CaptureFixture[str]) -> None:
    line = "aoe read virtual:cell.toml 1 0x4021 1 3 --port 0x1001"
    assert call(line, capsys)[:2] == (0, "65 78 74\n")
    status, out, _ = call(f"{line} --json", capsys)
    assert (status, json.loads(out)) == (0, {"position": 1, "data": "657874"})


@pytest.mark.usefixtures("folder")
def test_info(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call("aoe info virtual:cell.toml 1 --port 0x1001", capsys)
    assert status == 0
    assert "probe, version 1.2.3\nstate RUN, device state 0, NetId 127.0.0.1.16.2\n" in out
    _, out, _ = call("aoe info virtual:cell.toml 1 --port 0x1001 --json", capsys)
    assert json.loads(out)["version"] == "1.2.3"


@pytest.mark.usefixtures("folder")
def test_write(capsys: pytest.CaptureFixture[str]) -> None:
    line = "aoe write virtual:cell.toml 1 0x4020 0 '01 02' --port 0x1001"
    status, out, _ = call(line, capsys)
    assert status == 0
    assert out.endswith("2 bytes written\n")
    _, out, _ = call(f"{line} --json", capsys)
    assert json.loads(out) == {"position": 1, "size": 2}


@pytest.mark.usefixtures("folder")
def test_errors(capsys: pytest.CaptureFixture[str]) -> None:
    status, _, err = call("aoe read virtual:cell.toml 1 0x4020 0 4", capsys)
    assert status == 1
    assert "0x0006: target port not found" in err
    status, _, err = call("aoe write virtual:cell.toml 1 0x4020 0 xyz", capsys)
    assert status == 2
    assert "'xyz' is not bytes" in err
    status, _, err = call("aoe info share:none 1", capsys)
    assert status == 2
    assert "a share offers no ADS data" in err
