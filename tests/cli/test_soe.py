"""`soe` on a virtual segment: text, JSON, exit status and errors."""

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
kind = "sercos_drive"
soe_quirks = { stuck_commands = ["S-0-0264"], refused = { "S-0-0140" = 0x7005 } }
"""
DRIVE = "virtual:cell.toml 1"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "cell.toml").write_text(CELL)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def call(line: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    status = main(shlex.split(line))
    printed = capsys.readouterr()
    return status, printed.out, printed.err


@pytest.mark.parametrize(
    ("line", "text", "value"),
    [
        ("S-0-0092", "300.0", 300.0),
        ("s-0-2", "1000", 1000),
        ("S-0-0095", "A0013 ready for operation", "A0013 ready for operation"),
        ("S-0-0187", "S-0-0036, S-0-0037", None),
    ],
)
def test_read(
    folder: Path, capsys: pytest.CaptureFixture[str], line: str, text: str, value: object
) -> None:
    status, out, _ = call(f"soe read {DRIVE} {line}", capsys)
    assert status == 0
    assert out.startswith(text)
    status, out, _ = call(f"soe read {DRIVE} {line} --json", capsys)
    found = json.loads(out)["value"]
    assert found == value if value is not None else found[:2] == ["S-0-0036", "S-0-0037"]


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ("S-0-0092 150.5", "S-0-0092 = 150.5"),
        ("P-0-0010 0x1F", "P-0-0010 = 31"),
        ("S-0-0142 Gripper", "S-0-0142 = Gripper"),
        ("S-0-0024 S-0-0047,S-0-0036", "S-0-0024 = S-0-0047, S-0-0036"),
        ("P-0-0018 1,2,3", "P-0-0018 = 1, 2, 3"),
    ],
)
def test_write(folder: Path, capsys: pytest.CaptureFixture[str], line: str, text: str) -> None:
    status, out, err = call(f"soe write {DRIVE} {line}", capsys)
    assert (status, err.count("error")) == (0, 0)
    assert out.strip().endswith(text)


def test_info(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = call(f"soe info {DRIVE} S-0-0091", capsys)
    for part in ("Bipolar velocity limit value", "3342.2538", "rpm", "unsigned"):
        assert part in out
    _, out, _ = call(f"soe info {DRIVE} S-0-0099 --json", capsys)
    found = json.loads(out)
    assert (found["command"], found["state"], found["unit"]) == (True, 0, "")


def test_info_shows_zeros(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = call(f"soe info {DRIVE} S-0-0092", capsys)
    assert "minimum        0.0" in out
    _, out, _ = call(f"soe info {DRIVE} S-0-0044", capsys)
    assert "value          2" in out
    _, out, _ = call(f"soe info {DRIVE} S-0-0043", capsys)
    assert "value          0" in out
    assert "list " not in out


def test_a_list_with_an_invalid_value(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The other values are shown, too."""
    quirks = 'soe_quirks = { lying_lists = ["S-0-0142"] }'
    (folder / "cell.toml").write_text(f'[[device]]\nkind = "sercos_drive"\n{quirks}\n')
    status, out, _ = call("soe list virtual:cell.toml 0 --values", capsys)
    assert status == 0
    [line] = [each for each in out.splitlines() if each.startswith("S-0-0142")]
    assert "its header states" in line
    assert "S-0-0187  IDN-list of configurable data in the AT" in out


def test_list(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = call(f"soe list {DRIVE}", capsys)
    assert "S-0-0051" in out.splitlines()
    status, out, _ = call(f"soe list {DRIVE} --values", capsys)
    assert status == 0
    assert "S-0-0002  SERCOS cycle time (tScyc): 1000 us" in out
    assert "S-0-0140  " in out  # the drive refuses it
    assert "0x7005" in out


def test_command(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call(f"soe command {DRIVE} S-0-0099", capsys)
    assert (status, out.strip().endswith("S-0-0099 done")) == (0, True)


@pytest.mark.parametrize(
    ("line", "status", "text"),
    [
        (f"read {DRIVE} S-0-0999", 1, "no such IDN"),
        (f"read {DRIVE} S-0-0140", 1, "0x7005"),
        (f"read {DRIVE} 47", 2, "is not an IDN"),
        (f"read {DRIVE} S-0-0047 --drive 3", 1, "invalid drive number"),
        ("read virtual:cell.toml 0 S-0-0047", 1, "has no mailbox"),
        ("read virtual:cell.toml 5 S-0-0047", 2, "there is no device 5"),
        ("read share:arm 1 S-0-0047", 2, "a share offers no IDNs"),
        (f"write {DRIVE} S-0-0092 fast", 2, "is not a number"),
        (f"write {DRIVE} S-0-0092 1e9", 2, "does not fit"),
        (f"write {DRIVE} S-0-0051 5", 1, "read-only"),
        (f"write {DRIVE} S-0-0024 S-0-0051", 1, "0x7008"),
        (f"write {DRIVE} S-0-0099 3", 2, "is a procedure command"),
        (f"command {DRIVE} S-0-0264 --timeout 0.2", 1, "has not ended after 0.2 s"),
    ],
)
def test_errors(
    folder: Path, capsys: pytest.CaptureFixture[str], line: str, status: int, text: str
) -> None:
    found, _, err = call(f"soe {line}", capsys)
    assert found == status
    assert text in err
