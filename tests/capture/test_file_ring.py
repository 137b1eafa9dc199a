"""Ring of pcapng files: bounds of time and size, complete files, and earlier recordings."""

from __future__ import annotations

from pathlib import Path

import pytest

from catenary.capture.file_ring import MINIMUM_SIZE, FileRing
from catenary.errors import RecordingError
from catenary.wire.capture import decode_capture
from catenary.wire.pcapng import Direction, Packet, PcapngPackets

SECOND = 1_000_000_000


def packet(time_ns: int, size: int = 60) -> Packet:
    return Packet(time_ns, bytes(size), direction=Direction.OUTBOUND)


def made_ring(path: Path, *, duration_ns: int = 10 * SECOND, size: int = 10**6) -> FileRing:
    return FileRing(path, interface="eth0", duration_ns=duration_ns, size=size)


def read_statistics(path: Path) -> int:
    packets = PcapngPackets(path.open("rb").read)
    assert len(list(packets)) == 1
    return packets.dropped


def test_keeps_the_packets_of_the_duration_and_no_older_file(tmp_path: Path) -> None:
    with made_ring(tmp_path / "line.pcapng") as ring:
        ring.write(packet(n * SECOND // 10) for n in range(1000))
    captures = [decode_capture(path.read_bytes()) for path in ring.files]
    times = [each.time_ns for capture in captures for each in capture.packets]
    assert times == [n * SECOND // 10 for n in range(1000 - len(times), 1000)]
    assert 100 <= len(times) <= 120
    assert sorted(tmp_path.iterdir()) == sorted(ring.files)
    assert all(capture.interfaces[0].name == "eth0" for capture in captures)
    assert ring.packets == 1000


def test_all_files_together_never_exceed_the_size(tmp_path: Path) -> None:
    largest = 0
    with made_ring(tmp_path / "line.pcapng", size=MINIMUM_SIZE) as ring:
        for n in range(300):
            ring.write([packet(n, 1498)])
            ring.flush(0)
            largest = max(largest, sum(each.stat().st_size for each in tmp_path.iterdir()))
    assert sum(each.stat().st_size for each in tmp_path.iterdir()) <= MINIMUM_SIZE
    assert MINIMUM_SIZE // 2 < largest <= MINIMUM_SIZE


def test_each_file_reports_its_dropped_packets(tmp_path: Path) -> None:
    with made_ring(tmp_path / "line") as ring:
        ring.write([packet(1)])
        ring.flush(3)
        ring.write([packet(2 * SECOND)])
        ring.flush(4)
    assert ring.dropped == 4
    received = [read_statistics(path) for path in ring.files]
    assert received == [3, 1]
    assert [path.name for path in ring.files] == ["line-000001.pcapng", "line-000002.pcapng"]


def test_an_earlier_recording_is_replaced_only_by_force(tmp_path: Path) -> None:
    path = tmp_path / "line.pcapng"
    with made_ring(path) as ring:
        ring.write([packet(1), packet(2 * SECOND)])
    for name in ("notes", "20261123"):
        (tmp_path / f"line-{name}.pcapng").write_text("of the user")
    with pytest.raises(RecordingError, match=r"line-000001.* to .*line-000002") as caught:
        made_ring(path)
    assert "--force" in caught.value.hint
    FileRing(path, interface="eth0", duration_ns=SECOND, size=10**6, force=True).close()
    assert [each.name for each in sorted(tmp_path.iterdir())] == [
        "line-000001.pcapng",
        "line-20261123.pcapng",
        "line-notes.pcapng",
    ]


@pytest.mark.parametrize(("duration_ns", "size"), [(0, 10**6), (SECOND, MINIMUM_SIZE - 1)])
def test_refuses_bounds_that_are_too_small(tmp_path: Path, duration_ns: int, size: int) -> None:
    with pytest.raises(ValueError, match="too small"):
        made_ring(tmp_path / "line.pcapng", duration_ns=duration_ns, size=size)
    assert list(tmp_path.iterdir()) == []
