"""`state`, `reg` and `alias` on a virtual segment: text, JSON and errors."""

from __future__ import annotations

import json
import shlex

import pytest

import catenary as cat
from catenary.cli.main import VIRTUAL_TIME, main


def call(line: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    status = main(shlex.split(line))
    printed = capsys.readouterr()
    return status, printed.out, printed.err


def test_state_shows_every_device(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call("state virtual", capsys)
    heading, *lines = out.splitlines()
    assert status == 0
    assert heading.split() == ["pos", "name", "state"]
    assert [line.split()[-1] for line in lines] == ["INIT"] * 6


@pytest.mark.parametrize("word", ["PREOP", "pre-op", "PRE_OP"])
def test_state_requests_a_state(word: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call(f"state virtual {word} --position 2", capsys)
    assert (status, out.splitlines()[1].split()[-1]) == (0, "PRE-OP")


def test_state_names_the_devices_that_refuse(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = call("state virtual OP", capsys)
    assert status == 1
    assert "SAFE-OP + ERROR  0x0019: No valid outputs" in out
    assert "device 3 (Catenary virtual servo 2) refused OP" in err
    assert "check that the loop runs" in err


def test_state_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call("state virtual OP --json", capsys)
    devices = json.loads(out)
    assert status == 1
    assert [each["state"] for each in devices] == ["OP", "OP", *["SAFE-OP"] * 3, "OP"]
    assert devices[2]["code"] == 0x0019
    assert "refused OP" in devices[2]["refused"]
    assert devices[0]["refused"] is None


def test_reg_read_explains_a_register(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("reg read virtual 2 AL_STATUS", capsys)[1] == (
        "AL status (0x0130): 01 00  (0x0001, 1)\n  INIT\n"
    )
    assert call("reg read virtual 2 0x0130", capsys)[1].endswith("INIT\n")


def test_reg_read_of_many_bytes_is_a_dump(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = call("reg read virtual 2 0x0301 20", capsys)
    assert out.splitlines() == ["  0000 " + " 00" * 16, "  0010 " + " 00" * 4]


def test_reg_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = call("reg read virtual 2 watchdog-divider --json", capsys)
    assert json.loads(out) == {
        "position": 2,
        "address": 0x0400,
        "size": 2,
        "name": "watchdog divider",
        "data": "c209",
        "value": 2498,
        "meaning": None,
    }


@pytest.mark.parametrize(
    "value", ["watchdog-divider 1000", "0x0400 0x3E8", "0x0400 'e8 03'", "0x0400 1000 --size 2"]
)
def test_reg_write_takes_numbers_and_bytes(value: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call(f"reg write virtual 2 {value} --json", capsys)
    assert (status, json.loads(out)["data"]) == (0, "e803")


def test_the_current_alias_and_the_next_one(capsys: pytest.CaptureFixture[str]) -> None:
    name = "device 2 (Catenary virtual servo 1)"
    assert call("alias virtual 2", capsys) == (0, f"{name}: no alias\n", f"note: {VIRTUAL_TIME}\n")
    assert call("alias virtual 2 17", capsys)[1] == (
        f"{name}: no alias; alias 17 after the next power-up\n"
    )
    _, out, _ = call("alias virtual 2 17 --json", capsys)
    assert json.loads(out)["eeprom"] == 17


def test_an_alias_of_another_device_is_refused(
    tmp_path: object, capsys: pytest.CaptureFixture[str]
) -> None:
    path = f"{tmp_path}/two.toml"
    with open(path, "w") as file:
        file.write('[[device]]\nkind = "servo"\nalias = 7\n[[device]]\nkind = "servo"\n')
    status, _, err = call(f"alias virtual:{path} 1 7", capsys)
    assert status == 1
    assert "already has the alias 7" in err
    assert call(f"alias virtual:{path} 1 7 --force", capsys)[0] == 0


def test_a_future_alias_of_another_device_is_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    segment = cat.Segment([cat.virtual.Servo(), cat.virtual.Servo()])
    monkeypatch.setattr("catenary.target.main_device.parse", lambda _: segment)
    assert call("alias eth9 0 7", capsys)[0] == 0
    status, _, err = call("alias eth9 1 7", capsys)
    assert status == 1
    assert "already has the alias 7" in err


@pytest.mark.parametrize(
    ("line", "status", "message"),
    [
        ("state virtual OP -p 6", 2, "the segment has 6"),
        ("reg read virtual 6 AL_STATUS", 2, "the segment has 6"),
        ("reg read virtual 2 alstatis", 2, "similar names: AL status"),
        ("reg read virtual 2 alstatis", 2, "or give its address"),
        (
            "reg read virtual 2 UNKNOWN",
            2,
            "FMMU 0 to 15; SyncManager 0 to 15; SyncManager 0 to 15 status;",
        ),
        ("reg read virtual 2 0x0131", 2, "give the number of bytes"),
        ("reg read virtual 2 013A", 2, "write 0x013A"),
        ("reg read virtual 2 AL_STATUS 4", 2, "has 2 bytes, not 4"),
        ("reg read virtual 2 0xFFFF 2", 2, "outside 0x0000 to 0xFFFF"),
        ("reg read virtual 2 0xF000 8", 1, "0xF000 to 0xF007 cannot be read"),
        ("reg write virtual 2 AL_STATUS 4", 1, "0x0130 to 0x0131 cannot be written"),
        ("reg write virtual 2 watchdog-divider 100000", 2, "does not fit into 2 bytes"),
        ("reg write virtual 2 0x0131 4", 2, "add --size"),
        ("reg write virtual 2 0x0131 '4 xy'", 2, "not a list of pairs of hexadecimal digits"),
        ("alias virtual 6 1", 2, "the segment has 6"),
    ],
)
def test_errors_name_the_cause(
    line: str, status: int, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    found, out, err = call(line, capsys)
    assert (found, out) == (status, "")
    assert message in err
    assert err.startswith("catenary: ")
    assert len(err.splitlines()) <= 2
    assert "internal error" not in err


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("state virtual RUN", "invalid state 'RUN': INIT, PRE-OP, BOOT, SAFE-OP, OP"),
        ("reg read virtual 2", "the following arguments are required: ADDRESS"),
        ("reg read virtual two AL_STATUS", "'two' is not a number"),
        ("alias virtual 2 100000", "alias 100000 is outside 0 to 65535"),
        ("alias virtual 2 abc", "'abc' is not a number"),
    ],
)
def test_a_usage_error_names_the_help(
    line: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stop:
        main(shlex.split(line))
    assert stop.value.code == 2
    printed = capsys.readouterr().err
    assert message in printed
    assert "--help" in printed
