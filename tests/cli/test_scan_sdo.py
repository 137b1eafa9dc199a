"""`scan` and `sdo` on a virtual segment: text, JSON and errors."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from catenary.cli.main import VIRTUAL_TIME, main
from catenary.virtual.description import VENDOR_ID
from tests.esi import servo_file

NOTE = f"note: {VIRTUAL_TIME}\n"


def call(line: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    status = main(line.split())
    printed = capsys.readouterr()
    return status, printed.out, printed.err


def test_scan_lists_every_device(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call("scan virtual", capsys)
    assert status == 0
    heading, *lines = out.splitlines()
    assert heading.split()[:2] == ["pos", "name"]
    assert [line.split()[0] for line in lines] == list("012345")
    assert {line.split()[-1] for line in lines} == {"PRE-OP"}


def test_scan_prints_notes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "twins.toml"
    path.write_text('[[device]]\nkind = "servo"\nalias = 7\n' * 2)
    status, _, err = call(f"scan virtual:{path}", capsys)
    assert (status, err) == (0, f"note: devices (0, 1) have the same alias 7\n{NOTE}")


def test_scan_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = call("scan virtual --json", capsys)
    devices = json.loads(out)
    assert [device["position"] for device in devices] == list(range(6))
    assert {device["vendor"] for device in devices} == {VENDOR_ID}
    assert [device["serial"] for device in devices[2:5]] == [1, 2, 3]


def test_sdo_read_without_a_type_prints_bytes_and_a_number(
    capsys: pytest.CaptureFixture[str],
) -> None:
    _, out, _ = call("sdo read virtual 2 0x1018:1", capsys)
    assert out == "59 4e 54 43  (0x43544E59, 1129598553)\n"


def test_sdo_read_with_a_type(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = call("sdo read virtual 3 0x1008 --type STRING", capsys)
    assert out == "Catenary virtual servo 2\n"


def test_sdo_read_takes_type_and_name_from_the_esi_of_the_user(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    servo_file.write(tmp_path, profile=servo_file.PROFILE)
    monkeypatch.setenv("CATENARY_ESI", str(tmp_path))
    _, out, _ = call("sdo read virtual 2 0x6065", capsys)
    assert out == "262144\n"
    named = servo_file.PROFILE.replace("<Enum>8</Enum>", "<Enum>0</Enum>")
    servo_file.write(tmp_path, profile=named)
    _, out, _ = call("sdo read virtual 2 0x6060", capsys)
    assert out == "0  (CSP)\n"


def test_sdo_read_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = call("sdo read virtual 2 0x1018:1 --type UDINT --json", capsys)
    assert json.loads(out) == {
        "position": 2,
        "index": 0x1018,
        "subindex": 1,
        "type": "UDINT",
        "data": "594e5443",
        "value": VENDOR_ID,
    }


def test_sdo_write(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("sdo write virtual 2 0x6065 0x1388 --type UDINT", capsys) == (0, "", NOTE)


def test_sdo_list_prints_every_entry(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = call("sdo list virtual 2", capsys)
    lines = [line.split(maxsplit=3) for line in out.splitlines()]
    assert ["0x1018:01", "UDINT", "r", "Vendor ID"] in lines
    assert ["0x1018", "RECORD", "Identity"] in lines
    assert ["0x6040:00", "UINT", "rw", "R       Controlword"] in lines
    assert ["0x1C12:01", "UINT", "rwP", "Subindex 001"] in lines


def test_sdo_list_with_values_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = call("sdo list virtual 2 --values --json", capsys)
    rows = {(row["index"], row["subindex"]): row for row in json.loads(out)}
    assert rows[0x1018, 1] == {
        "index": 0x1018,
        "subindex": 1,
        "name": "Vendor ID",
        "type": "UDINT",
        "bits": 32,
        "access": "r",
        "value": VENDOR_ID,
        "problem": None,
    }
    assert rows[0x1008, 0]["value"] == "Catenary virtual servo 1"
    assert rows[0x1018, None]["type"] == "RECORD"
    assert rows[0x2100, 0]["value"] == bytes(k * 7 & 0xFF for k in range(2048)).hex()


@pytest.mark.parametrize(
    ("line", "status", "message"),
    [
        ("sdo read virtual 2 0x5FFF", 1, "0x06020000"),
        ("sdo read virtual 0 0x1018:1", 1, "no mailbox"),
        ("sdo list virtual 0", 1, "no mailbox"),
        ("sdo read virtual 6 0x1018:1", 2, "the segment has 6"),
        ("sdo read virtual 2 0x1018:1 --type UNIT", 2, "did you mean UINT?"),
        ("sdo read virtual 2 0x1018:1 --type UINT", 1, "needs 2 bytes, received 4"),
        ("sdo write virtual 2 0x6065 5", 2, "needs --type"),
        ("sdo write virtual 2 0x6065 -5 --type UDINT", 2, "-5 is not in 0 to 4294967295"),
        ("sdo write virtual 2 0x1018:1 5 --type UDINT", 1, "0x06010002"),
        ("scan eth0,eth0", 1, "is not a ring"),
        ("scan nosuchnic", 1, "there is no network interface 'nosuchnic'"),
        ("scan virtual:nosuchfile.toml", 1, "nosuchfile.toml"),
    ],
)
def test_errors_name_the_cause(
    line: str, status: int, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    found, out, err = call(line, capsys)
    assert found == status
    assert out == ""
    assert message in err
    assert err.startswith("catenary: ")
    assert len(err.splitlines()) <= 2
    assert "internal error" not in err


def test_virtual_time_prints_a_note(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert call("scan virtual", capsys)[2] == NOTE
    assert call("scan virtual-realtime", capsys)[2] == ""
