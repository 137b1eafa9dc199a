"""`catenary capture show`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from catenary.cli.main import main
from catenary.wire.al import AlState
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.pcapng import Packet, encode_header
from tests.capture.made import Conversation, address, capture_of


@pytest.fixture
def made() -> Conversation:
    """Return a bring-up of two devices. The second refuses SAFE-OP."""
    conversation = Conversation()
    for position in range(2):
        assign = Datagram(EcatCommand.APWR, address(-position, 0x10), bytes((1 + position, 0x10)))
        conversation.exchange(assign, answers=[(None, 1)])
    conversation.broadcast(EcatCommand.BWR, 0x0120, bytes((AlState.PRE_OP, 0)), 2)
    conversation.broadcast(EcatCommand.BRD, 0x0130, bytes((AlState.PRE_OP, 0)), 2)
    for number in range(3):
        conversation.write(0x0600 + 16 * number, bytes(16))
    conversation.write(0x0120, bytes((AlState.SAFE_OP, 0)), station=0x1002)
    conversation.read(0x0130, bytes.fromhex("120000001e00"), station=0x1002)
    return conversation


@pytest.fixture
def path(made: Conversation, tmp_path: Path) -> Path:
    file = tmp_path / "made.pcapng"
    file.write_bytes(capture_of(made.packets))
    return file


def test_a_timeline(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["capture", "show", str(path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1] == "master 0: ethercrab (source 10:10:10:10:10:10)"
    first = "0.000020 2 0 (0x1001) - station address 0x1001 for position 0"
    assert " ".join(lines[2].split()) == first
    assert any(line.endswith("PRE→SAFE   FMMU0 to FMMU2 off") for line in lines)
    assert any("SAFE-OP refused in PRE-OP: 0x001E Invalid input config" in line for line in lines)
    assert "18 packets in 8.02 ms, 18 of them EtherCAT" in lines


def test_one_device_in_a_time(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["capture", "show", str(path), "--device", "1", "--from", "0.001"]) == 0
    rows = [line[24:38].strip() for line in capsys.readouterr().out.splitlines()[2:]]
    assert rows[: rows.index("")] == ["1 (0x1002)", "all", "all", "1 (0x1002)", "1 (0x1002)"]
    assert main(["capture", "show", str(path), "--device", "0x1002", "--to", "0.0015"]) == 0
    assert "4 packets in" in capsys.readouterr().out


def test_json_is_one_object_per_line(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["capture", "show", str(path), "--json"]) == 0
    *events, last = map(json.loads, capsys.readouterr().out.splitlines())
    assert events[-1] == {
        "time": 0.00802,
        "packet": 18,
        "master": 0,
        "device": 1,
        "position": 1,
        "station": 0x1002,
        "step": "PRE→SAFE",
        "kind": "state-error",
        "text": "SAFE-OP refused in PRE-OP: 0x001E Invalid input configuration "
        "(the length of SyncManager 3 (inputs) differs from the mapping)",
        "state": "PRE-OP",
        "requested": "SAFE-OP",
        "code": 0x1E,
        "before": "PRE-OP",
    }
    assert last["summary"]["packets"] == 18
    assert [each["station"] for each in last["summary"]["masters"][0]["devices"]] == [
        0x1001,
        0x1002,
    ]


def test_a_device_that_is_not_there(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["capture", "show", str(path), "--device", "7"]) == 1
    assert "no device 7; devices: 0 (0x1001), 1 (0x1002)" in capsys.readouterr().err


def test_a_capture_without_ethercat(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "lan.pcapng"
    file.write_bytes(capture_of([Packet(0, bytes(12) + b"\x08\x06" + bytes(46))]))
    assert main(["capture", "show", str(file)]) == 1
    output = capsys.readouterr()
    assert "no EtherCAT frame" in output.err
    assert "note: 1 packets of other protocols were skipped" in output.out


@pytest.mark.parametrize("content", [b"text", encode_header()[:20], None])
def test_an_unreadable_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: bytes | None
) -> None:
    file = tmp_path / "file.pcapng"
    if content is not None:
        file.write_bytes(content)
    assert main(["capture", "show", str(file)]) == 2
    assert capsys.readouterr().err.startswith(f"catenary: {file}: ")


def test_an_end_before_the_start(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["capture", "show", str(path), "--from", "5", "--to", "1"]) == 2
    assert "--to must not be before --from" in capsys.readouterr().err


def test_a_damaged_file(made: Conversation, tmp_path: Path) -> None:
    file = tmp_path / "damaged.pcapng"
    file.write_bytes(capture_of(made.packets) + bytes((6, 0, 0, 0, 13)) + bytes(20))
    assert main(["capture", "show", str(file)]) == 1


def test_text_of_a_device_cannot_control_the_terminal(
    made: Conversation, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from catenary.wire.coe import UploadRequest, UploadResponse

    made.mailboxes()
    made.request(UploadRequest(0x1008, 0))
    made.response(UploadResponse(0x1008, 0, b"bad\x1b[2Jname", 11))
    file = tmp_path / "name.pcapng"
    file.write_bytes(capture_of(made.packets))
    assert main(["capture", "show", str(file)]) == 0
    assert "\x1b" not in capsys.readouterr().out


def test_every_capture_of_the_shared_data(
    shared_data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for file in sorted((shared_data / "pcap").iterdir()):
        assert main(["capture", "show", str(file)]) == 0
        output = capsys.readouterr()
        assert output.err == ""
        assert "malformed" not in output.out
