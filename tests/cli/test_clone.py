"""`catenary clone` on a virtual segment that several commands share."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import pytest

import catenary as cat
from catenary.cli.main import main
from catenary.line import read_line
from catenary.virtual import MailboxQuirks


@pytest.fixture
def segment(monkeypatch: pytest.MonkeyPatch) -> cat.Segment:
    segment = cat.Segment([cat.virtual.Coupler(), cat.virtual.Servo(serial=7)])
    monkeypatch.setattr("catenary.target.main_device.parse", lambda _: segment)
    return segment


def call(line: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    status = main(shlex.split(line))
    printed = capsys.readouterr()
    return status, printed.out, printed.err


def test_a_complete_clone_has_status_0(
    segment: cat.Segment, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, out, err = call(f"clone eth9 -o {tmp_path}/line --pre-op", capsys)
    assert (status, err) == (0, "")
    servo = read_line(tmp_path / "line").devices[1]
    values = sum(entry.value is not None for each in servo.objects for entry in each.entries)
    assert out.splitlines()[2].split()[-3:] == [str(len(servo.objects)), str(values), "0"]


def test_a_missing_part_has_status_1_and_a_reason(
    segment: cat.Segment, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, out, err = call(f"clone eth9 -o {tmp_path}/line", capsys)
    assert status == 1
    assert "missing" in out
    assert "device 1 (Catenary virtual servo): objects: not read: the device is in INIT" in err
    assert not read_line(tmp_path / "line").complete


def test_json_has_the_reasons(
    segment: cat.Segment, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, out, _ = call(f"clone eth9 -o {tmp_path}/line --json", capsys)
    found = json.loads(out)
    assert (status, found["complete"]) == (1, False)
    assert found["devices"][0]["missing"] == {}
    assert set(found["devices"][1]["missing"]) == {"objects"}


def test_serial_numbers_are_left_out(
    segment: cat.Segment, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, _, _ = call(f"clone eth9 -o {tmp_path}/line --pre-op --without-serials", capsys)
    line = read_line(tmp_path / "line")
    assert (status, line.serials, line.devices[1].identity.serial) == (0, False, 0)


def test_seconds_bound_the_reading(
    segment: cat.Segment, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, out, err = call(f"clone eth9 -o {tmp_path}/line --pre-op --seconds 0.05", capsys)
    assert status == 1
    assert "reading ended after 0.05 s" in err
    assert "..." in out


def test_the_folder_of_something_else_is_refused(
    segment: cat.Segment, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "thesis.tex").touch()
    status, _, err = call(f"clone eth9 -o {tmp_path}", capsys)
    assert status == 1
    assert "other files than a clone" in err


def test_names_of_devices_cannot_write_to_the_terminal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    quirks = MailboxQuirks(text_prefix="\x1b[2J\t\n")
    servo = cat.virtual.Servo(name="\x1b[2Jaxis", mailbox_quirks=quirks)
    segment = cat.Segment([servo])
    monkeypatch.setattr("catenary.target.main_device.parse", lambda _: segment)
    status, out, err = call(f"clone eth9 -o {tmp_path}/line --pre-op", capsys)
    assert status == 0
    assert "\x1b" not in out + err
    for path in (tmp_path / "line").rglob("*.t*"):
        assert b"\x1b" not in path.read_bytes()
    name = read_line(tmp_path / "line").devices[0].object(0x1000).name
    assert name.startswith("\x1b[2J\t\n")
