"""Recordings, checked by tshark."""

from __future__ import annotations

import concurrent.futures
import contextlib
import json
import os
import resource
import subprocess
from pathlib import Path

import pytest

from catenary.link import Interface, Recorder
from catenary.wire.capture import decode_capture
from tests.link.dissector import dissect
from tests.link.python_link import PythonLink, frame


def test_records_both_directions_with_stamps_in_virtual_time(tshark, tmp_path):
    path = tmp_path / "run.pcapng"
    with Recorder(PythonLink(latency_ns=1234), path) as link:
        for number in range(3):
            link.wait_until(number * 1_000_000_000, False)
            link.send(frame(bytes([number]) * 40, index=number))
            assert link.wait_until(link.now() + 10_000, True)
            assert link.receive() == frame(bytes([number]) * 40, index=number)
        assert link.recorded == 6
    rows = dissect(
        tshark,
        path,
        "frame.time_epoch",
        "frame.packet_flags_direction",
        "ecat.idx",
        "_ws.malformed",
    )
    assert [row[0][:11] for row in rows[1::2]] == [f"{n}.000001234" for n in range(3)]
    assert [int(row[1], 0) for row in rows] == [2, 1] * 3
    assert [int(row[2], 0) for row in rows] == [0, 0, 1, 1, 2, 2]
    assert {row[3] for row in rows} == {""}


def test_keeps_every_byte_of_frames_of_any_length(tshark, tmp_path):
    path = tmp_path / "run.pcapng"
    frames = [frame(bytes(range(size)) * 5) for size in range(8, 30)]
    with Recorder(PythonLink(), path) as link:
        for sent in frames:
            link.send(sent)
    command = [tshark, "-r", str(path), "-T", "json", "-x", "--no-duplicate-keys"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    recorded = [packet["_source"]["layers"]["frame_raw"][0] for packet in json.loads(done.stdout)]
    assert recorded == [sent.hex() for sent in frames]


def test_loses_nothing_in_virtual_time_however_fast(tmp_path):
    path = tmp_path / "run.pcapng"
    longest = frame(bytes(1486))
    with Recorder(PythonLink(latency_ns=0), path) as link:
        for _ in range(4000):
            link.send(longest)
            link.receive()
        assert link.dropped == 0
    assert path.stat().st_size > 8000 * 1500


def test_a_disk_full_from_the_start_is_an_error():
    inner = PythonLink()
    with pytest.raises(OSError, match="No space left"):
        Recorder(inner, "/dev/full")
    assert inner.closed


@contextlib.contextmanager
def files_of_4096_bytes():
    """Not a fixture: it would still hold when pytest writes its report, into a file perhaps."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("flags", [0, 1], ids=["writer thread", "virtual time"])
def test_a_full_disk_is_reported_at_close(tmp_path, flags):
    inner = PythonLink(latency_ns=0, flags=flags)
    with files_of_4096_bytes():
        link = Recorder(inner, tmp_path / "run.pcapng")
        for _ in range(4000):
            link.send(frame(bytes(1486)))
        with pytest.warns(RuntimeWarning, match="is incomplete: File too large"):
            link.close()
    assert link.dropped + link.recorded == 4000
    assert inner.closed


def read_all(descriptor: int) -> bytes:
    with open(descriptor, "rb") as file:
        return file.read()


def test_a_slow_disk_drops_counts_and_never_holds_up_the_sender(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    link = Recorder(PythonLink(latency_ns=0, flags=0), pipe)
    for _ in range(4000):  # 6 MB; the ring takes 4, and nobody reads
        link.send(frame(bytes(1486)))
    os.set_blocking(reader, True)
    with concurrent.futures.ThreadPoolExecutor() as executor:
        content = executor.submit(read_all, reader)
        with pytest.warns(RuntimeWarning, match=r"pipe lacks \d+ frames: the disk was too slow"):
            link.close()
        packets = decode_capture(content.result()).packets
    assert link.dropped > 0
    assert link.recorded + link.dropped == 4000
    assert len(packets) == link.recorded


def test_stamps_a_real_link_with_the_time_of_day(veth, tshark, tmp_path):
    path = tmp_path / "run.pcapng"
    with (
        Interface(veth[1]).open_link() as segment,
        Recorder(Interface(veth[0]), path) as link,
    ):
        start = Path(path).stat().st_mtime
        for number in range(100):
            link.send(frame(bytes(40), index=number))
            assert segment.wait_until(segment.now() + 10**9, True)
            segment.send(segment.receive())
            assert link.wait_until(link.now() + 10**9, True)
            link.receive()
        assert link.name == veth[0]
    rows = dissect(tshark, path, "frame.time_epoch", "ecat.idx")
    assert [int(row[1], 0) for row in rows] == [n for n in range(100) for _ in range(2)]
    stamps = [float(row[0]) for row in rows]
    assert stamps == sorted(stamps)
    assert abs(stamps[0] - start) < 60.0


def test_an_impossible_path_is_an_error_before_anything_is_opened(tmp_path):
    inner = PythonLink()
    with pytest.raises(FileNotFoundError):
        Recorder(inner, tmp_path / "none" / "run.pcapng")
    assert not inner.closed
