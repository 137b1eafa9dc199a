"""Memory of the last frames: bounds, captures of any time, and the link below it."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import cast

import pytest

from catenary.link import Interface, Link, frame_memory
from catenary.link.frame_memory import FrameMemory
from catenary.wire.capture import decode_capture
from catenary.wire.pcapng import Packet, encode_packet
from tests.link.dissector import dissect
from tests.link.python_link import PythonLink, frame

MEGABYTE = 1 << 20


def memory_of(link: PythonLink) -> FrameMemory:
    return FrameMemory(cast(Link, link), MEGABYTE)


def filled(memory: FrameMemory, link: PythonLink, count: int, *, size: int = 40) -> None:
    """Send and receive one frame per millisecond of virtual time."""
    for number in range(count):
        link.time = number * 1_000_000
        memory.link.send(frame(bytes(size), index=number % 256))
        memory.trim()


@pytest.mark.parametrize("from_ms", [0, 1, 17, 998, 999])
@pytest.mark.parametrize("to_ms", [17, 500, 999, 2000])
def test_a_capture_has_exactly_the_frames_of_its_time(
    tmp_path: Path, from_ms: int, to_ms: int
) -> None:
    path, link = tmp_path / "x.pcapng", PythonLink()
    memory = memory_of(link)
    filled(memory, link, 1000)
    memory.close()
    first, last = memory.write(path, from_ms * 1_000_000 - 7, to_ms * 1_000_000)
    memory.release()
    times = [packet.time_ns // 1_000_000 for packet in decode_capture(path.read_bytes()).packets]
    assert times == list(range(from_ms, min(to_ms, 999) + 1))
    assert last == to_ms * 1_000_000
    assert first == (times[0] if times else to_ms) * 1_000_000


def test_frames_beyond_the_size_are_freed(tmp_path: Path, tshark: str) -> None:
    path, link = tmp_path / "x.pcapng", PythonLink()
    memory = memory_of(link)
    filled(memory, link, 6000, size=1400)
    memory.close()
    memory.trim()
    used = os.fstat(memory._file).st_blocks * 512
    memory.write(path, 0, link.time)
    memory.release()
    indices = [int(row[0], 0) for row in dissect(tshark, path, "ecat.idx")]
    assert used <= MEGABYTE + 8192
    assert MEGABYTE - 8192 < path.stat().st_size < MEGABYTE + 8192
    assert indices == [number % 256 for number in range(6000 - len(indices), 6000)]


def test_a_time_without_frames_gives_an_empty_capture(tmp_path: Path) -> None:
    path, link = tmp_path / "x.pcapng", PythonLink()
    memory = memory_of(link)
    memory.close()
    assert memory.write(path, 5, 9) == (9, 9)
    memory.release()
    capture = decode_capture(path.read_bytes())
    assert (capture.packets, capture.interfaces[0].name) == ((), "python")


def test_frames_that_look_like_blocks_do_not_mislead_the_search(tmp_path: Path) -> None:
    link = PythonLink()
    memory = memory_of(link)
    inner = encode_packet(Packet(1, bytes(60)))
    frames = [frame(bytes(shift) + inner * 9) for shift in range(64)]
    for number, each in enumerate(frames):
        link.time = number
        memory.link.send(each)
    memory.close()
    for number in range(64):
        memory.write(tmp_path / f"{number}.pcapng", number, number)
        packets = decode_capture((tmp_path / f"{number}.pcapng").read_bytes()).packets
        assert [packet.data for packet in packets] == [frames[number]]
    memory.release()


def test_a_capture_during_the_recording_ends_with_a_complete_block(
    veth: tuple[str, str], tmp_path: Path
) -> None:
    with Interface(veth[0]).open_link() as link:
        memory = FrameMemory(link, MEGABYTE)
        start = link.now()
        for number in range(2000):
            memory.link.send(frame(bytes(40), index=number % 256))
            if number % 200 == 0:
                memory.write(tmp_path / f"{number}.pcapng", start, link.now())
        memory.close()
        memory.write(tmp_path / "all.pcapng", start, link.now())
        memory.release()
        link.send(frame(bytes(40)))  # still open
    for path in tmp_path.iterdir():
        capture = decode_capture(path.read_bytes())
        indices = [packet.data[17] for packet in capture.packets]
        assert capture.cut == 0
        assert indices == [number % 256 for number in range(len(indices))]
    assert len(decode_capture((tmp_path / "all.pcapng").read_bytes()).packets) == 2000


def test_an_existing_file_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    path.write_text("kept")
    memory = memory_of(PythonLink())
    memory.close()
    with pytest.raises(FileExistsError):
        memory.write(path, 0, 1)
    memory.release()
    memory.release()
    assert path.read_text() == "kept"


def test_a_full_disk_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(frame_memory, "copy_bytes", full)
    memory = memory_of(PythonLink())
    memory.close()
    with pytest.raises(OSError, match="No space left"):
        memory.write(tmp_path / "x.pcapng", 0, 1)
    memory.release()
    assert list(tmp_path.iterdir()) == []


def test_refuses_more_than_half_of_the_available_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "meminfo").write_text("MemTotal: 9000 kB\nMemAvailable:    2047 kB\n")
    monkeypatch.setattr(frame_memory, "MEMORY", tmp_path / "meminfo")
    with pytest.raises(OSError, match="1 MiB for frames are too much: 1 MiB are available"):
        memory_of(PythonLink())


def test_without_memory_the_error_comes_at_the_start(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object) -> None:
        raise OSError(errno.ENOMEM, "Cannot allocate memory")

    monkeypatch.setattr(frame_memory, "change_pages", refused)
    link = PythonLink()
    before = len(os.listdir("/proc/self/fd"))
    with pytest.raises(OSError, match="Cannot allocate memory"):
        memory_of(link)
    assert len(os.listdir("/proc/self/fd")) == before
    assert not link.closed
