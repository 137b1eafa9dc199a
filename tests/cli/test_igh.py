"""The command line on a kernel master: supported commands, and errors of the others."""

from __future__ import annotations

from pathlib import Path

import pytest

from catenary.cli.main import main
from tests.igh.double import Double, build


@pytest.fixture(autouse=True)
def library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = build(tmp_path, "1.6.1")
    Double(path)
    monkeypatch.setenv("CATENARY_LIBETHERCAT", str(path))


def test_scan_and_sdo(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scan", "igh:0"]) == 0
    assert capsys.readouterr().out.count("Doubled Drive") == 2
    assert main(["sdo", "read", "igh:0", "1", "0x6076"]) == 0
    assert "1000" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("command", "instead"),
    [
        ("state igh:0", "ethercat slaves -v"),
        ("sii read igh:0 0", "sii_read"),
        ("reg read igh:0 0 0x0130", "reg_read"),
        ("sdo list igh:0 0", "ethercat sdos -p 0"),
    ],
)
def test_unsupported_commands(
    capsys: pytest.CaptureFixture[str], command: str, instead: str
) -> None:
    assert main(command.split()) == 1
    assert instead in capsys.readouterr().err


def test_messages_and_pdos(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["messages", "igh:0"]) == 0
    assert capsys.readouterr().out.count("no diagnosis history") == 2
    assert main(["pdos", "igh:0", "1"]) == 0
    assert "0x607A:00" in capsys.readouterr().out
