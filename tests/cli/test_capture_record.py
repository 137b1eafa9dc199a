"""`catenary capture record`: a passive recorder next to a master, its files and its refusals."""

from __future__ import annotations

import errno
import json
import shlex
import signal
import socket
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest

import catenary as cat
from catenary.capture import read_timeline
from catenary.capture.file_ring import FileRing
from catenary.cli.main import main
from catenary.errors import LinkError
from catenary.link import Interface, passive
from catenary.link.passive import PassiveSocket
from catenary.realtime import private_network
from catenary.realtime.child import Child, start_python
from catenary.wire.capture import decode_capture
from catenary.wire.pcapng import Direction
from tests.attack.line_on_a_wire import goes_on, looping, served
from tests.link.dissector import dissect

START = 20.0  # [s] at most


def call(line: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    status = main(shlex.split(line))
    printed = capsys.readouterr()
    return status, printed.out, printed.err


@contextmanager
def recording(interface: str, path: Path, *options: str) -> Iterator[Child]:
    """Record an interface in a process of its own."""
    command = ["-m", "catenary.cli", "capture", "record", interface, "-o", str(path), *options]
    with start_python(command) as child:
        assert (child.read_line(START) or "").startswith(f"recording {interface}")
        yield child


def ended(child: Child, number: int) -> tuple[int, str]:
    """Send a signal to the recorder. Return its exit status and its last line."""
    child.process.send_signal(number)
    last = child.read_line(START) or ""
    return child.process.wait(START), last


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_loop_starts_while_a_recorder_runs(
    veth: tuple[str, str], tmp_path: Path, number: int
) -> None:
    with served(veth[1], tmp_path), recording(veth[0], tmp_path / "line.pcapng") as recorder:
        with looping(veth[0], tmp_path) as loop:
            assert goes_on(loop)
        status, last = ended(recorder, number)
    path = tmp_path / "line-000001.pcapng"
    packets = decode_capture(path.read_bytes()).packets
    assert (status, last) == (0, f"{path}: {len(packets)} frames recorded, 0 dropped by the kernel")
    assert len(packets) > 100


def test_records_both_directions_of_a_visible_master(
    veth: tuple[str, str], tmp_path: Path, tshark: str
) -> None:
    path = tmp_path / "line-000001.pcapng"
    with served(veth[1], tmp_path), recording(veth[0], tmp_path / "line.pcapng") as recorder:
        with cat.MainDevice(Interface(veth[0], visible=True)) as main_device:
            assert main_device.other_masters == ()
            assert len(main_device.scan()) == 2
        assert ended(recorder, signal.SIGTERM)[0] == 0
    [summary] = read_timeline(path).masters
    master = summary.master
    assert len(summary.devices) == 2
    assert master.sent >= master.returned > 100
    rows = dissect(tshark, path, "frame.packet_flags_direction", "ecat.idx", "_ws.malformed")
    directions = Counter(int(row[0], 0) for row in rows)
    assert directions == {Direction.OUTBOUND: master.sent, Direction.INBOUND: master.returned}
    assert {row[2] for row in rows} == {""}


def test_the_socket_passes_ethercat_only_and_never_blocks(veth: tuple[str, str]) -> None:
    header = b"\xff" * 6 + bytes.fromhex("101010101010")
    udp = bytes.fromhex("4500 0000 0000 0000 4011 0000 7f000001 7f000001 1234")
    passed = [
        header + b"\x88\xa4" + bytes(46),
        header + b"\x88\xa8\x00\x07\x88\xa4" + bytes(46),
        header + b"\x08\x00" + udp + b"\x88\xa4" + bytes(30),
    ]
    others = [
        header + b"\x08\x06" + bytes(46),
        header + b"\x88\xa8\x00\x07\x08\x00" + bytes(46),
        header + b"\x08\x00" + udp + b"\x12\x34" + bytes(30),
        header + b"\x08\x00" + udp.replace(b"\x40\x11", b"\x40\x06") + b"\x88\xa4" + bytes(30),
    ]
    with (
        PassiveSocket(veth[0]) as link,
        socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0) as here,
        socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0) as there,
    ):
        here.bind((veth[0], 0))
        there.bind((veth[1], 0))
        assert (link.receive(), link.wait(0)) == ([], False)
        for each in others + passed:
            here.send(each)
        assert link.wait(START)
        packets = link.receive()
        there.send(passed[0])
        assert link.wait(START)
        [answer] = link.receive()
        there.send(passed[1])
        assert link.wait(START)
        [tagged] = link.receive()
        assert link.dropped == 0
    assert [(packet.data, packet.direction) for packet in packets] == [
        (each, Direction.OUTBOUND) for each in passed
    ]
    assert (answer.data, answer.direction) == (passed[0], Direction.INBOUND)
    assert (tagged.data, tagged.direction) == (passed[1], Direction.INBOUND)
    times = [packet.time_ns for packet in (*packets, answer, tagged)]
    assert times == sorted(times)


def test_a_full_socket_reports_the_dropped_frames(
    veth: tuple[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(passive, "RECEIVE_BUFFER", 4096)
    with (
        PassiveSocket(veth[0]) as link,
        socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0) as there,
    ):
        there.bind((veth[1], 0))
        for _ in range(200):
            there.send(b"\xff" * 12 + b"\x88\xa4" + bytes(46))
        assert link.wait(START)
        received = len(link.receive())
        assert received > 0
        assert received + link.dropped == 200


def test_frames_before_an_error_are_kept(
    veth: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    frames = [(bytes(60), [], 0, (veth[0], 0, 0))]

    def recvmsg(*_: int) -> object:
        if frames:
            return frames.pop()
        raise OSError(errno.ENODEV, "No such device")

    with PassiveSocket(veth[0]) as link, monkeypatch.context() as patch:
        patch.setattr(link, "_socket", SimpleNamespace(recvmsg=recvmsg))
        [packet] = link.receive()
        with pytest.raises(LinkError, match="No such device"):
            link.receive()
    assert packet.data == bytes(60)


def test_a_removed_interface_ends_the_recording_with_complete_files(tmp_path: Path) -> None:
    with private_network.veth_pair() as names, ExitStack() as stack:
        recorder = stack.enter_context(recording(names[0], tmp_path / "line.pcapng"))
        with socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0) as there:
            there.bind((names[1], 0))
            there.send(b"\xff" * 12 + b"\x88\xa4" + bytes(46))
        kept = stack.pop_all()
    with kept:
        last = recorder.read_line(START)
        assert recorder.process.wait(START) == 1
    path = tmp_path / "line-000001.pcapng"
    assert last == f"{path}: 1 frames recorded, 0 dropped by the kernel"
    assert decode_capture(path.read_bytes()).cut == 0


def test_an_idle_interface_gives_status_1_and_json(
    veth: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = f"capture record {veth[0]} -o {tmp_path}/x.pcapng --seconds 0.01 --json"
    status, out, err = call(line, capsys)
    files = [f"{tmp_path}/x-000001.pcapng"]
    assert (status, json.loads(out)) == (1, {"files": files, "frames": 0, "dropped": 0})
    assert "no EtherCAT frame" in err
    status, _, err = call(line, capsys)
    assert (status, "--force" in err) == (2, True)
    assert call(f"{line} --force", capsys)[0] == 1


def test_refuses_an_unknown_interface(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, _, err = call(f"capture record eth99 -o {tmp_path}/x.pcapng", capsys)
    assert (status, "there is no network interface 'eth99'" in err) == (2, True)
    assert list(tmp_path.iterdir()) == []


def test_missing_permission_names_the_capability(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(passive, "check", lambda _: None)
    monkeypatch.setattr("socket.socket", refused)
    status, _, err = call(f"capture record lo -o {tmp_path}/x.pcapng", capsys)
    assert (status, "CAP_NET_RAW" in err, "setcap" in err) == (2, True, True)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--size 2000000", "limited"),
        ("--size 0", "not positive"),
        ("--minutes -1", "minutes"),
        ("-o /none/x.pcapng", "does not exist"),
        ("-o /tmp", "is a folder"),
    ],
)
def test_refuses_impossible_bounds(
    options: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        status = main(shlex.split(f"capture record lo {options}"))
    except SystemExit as ended_by_parser:
        status = int(str(ended_by_parser.code))
    assert (status, message in capsys.readouterr().err) == (2, True)


def test_a_full_disk_names_the_file(
    veth: tuple[str, str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(FileRing, "flush", full)
    status, _, err = call(f"capture record {veth[0]} -o {tmp_path}/x.pcapng --seconds 0.01", capsys)
    assert (status, err) == (2, f"catenary: {tmp_path}/x.pcapng: No space left on device\n")


def test_refuses_a_disk_without_space(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "shutil.disk_usage", lambda _: SimpleNamespace(total=10**9, used=0, free=10**6)
    )
    status, _, err = call(f"capture record lo -o {tmp_path}/x.pcapng", capsys)
    assert (status, "1 MB free" in err) == (2, True)
