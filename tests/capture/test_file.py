"""Large, damaged and foreign files; packets of other protocols."""

from __future__ import annotations

import io
import tracemalloc
from collections.abc import Callable, Iterator

import pytest

from catenary.capture import EventStream
from catenary.capture.file import CaptureFile
from catenary.capture.notes import notes
from catenary.errors import DecodeError
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import encode_frame
from catenary.wire.pcapng import Packet, encode_header, encode_packet, encode_statistics
from tests.capture.made import Conversation, capture_of


class Endless:
    """A file that is made while it is read."""

    def __init__(self, parts: Iterator[bytes]) -> None:
        self._parts = parts
        self._held = b""

    def read(self, size: int) -> bytes:
        while len(self._held) < size and (part := next(self._parts, b"")):
            self._held += part
        data, self._held = self._held[:size], self._held[size:]
        return data


def cyclic(frames: int) -> Iterator[bytes]:
    """Yield a capture of process data in which each answer has another working counter."""
    yield encode_header("eth0")
    for i in range(frames):
        sent = Datagram(EcatCommand.LRW, 0x10000, bytes(1400), i & 0x7F)
        back = Datagram(EcatCommand.LRW, 0x10000, bytes(1400), i & 0x7F, working_counter=3 + i % 2)
        yield encode_packet(Packet(1_000_000 * i, encode_frame([sent])))
        source = b"\x12" + b"\x10" * 5
        yield encode_packet(Packet(1_000_000 * i + 50_000, encode_frame([back], source=source)))


def peak(frames: int) -> int:
    """Return the largest memory [bytes] while a capture is read."""
    stream = EventStream(Endless(cyclic(frames)).read)
    tracemalloc.start()
    try:
        count = sum(1 for _ in stream)
        assert count >= frames - 2
        assert stream.counts.packets == 2 * frames
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_memory_does_not_grow_with_the_file() -> None:
    """The second file has 11 MB more than the first, and as many more events."""
    small, large = peak(1000), peak(5000)
    assert large < 1.2 * small + 100_000


@pytest.fixture
def made() -> Conversation:
    conversation = Conversation()
    for _ in range(5):
        conversation.read(0x0130, b"\x08\x00")
    return conversation


def read_counts(data: bytes) -> CaptureFile:
    file = CaptureFile(io.BytesIO(data).read)
    list(file)
    return file


def test_a_truncated_file_is_read_up_to_its_end(made: Conversation) -> None:
    counts = read_counts(capture_of(made.packets)[:-10]).counts
    assert (counts.ethercat, counts.damaged) == (9, "")
    assert counts.cut > 0
    assert "ends in the middle of a packet" in "".join(notes(counts, ()))


def test_a_damaged_block_ends_the_timeline(made: Conversation) -> None:
    data = capture_of(made.packets[:4]) + b"\x06\0\0\0" + b"\x0d\0\0\0" + bytes(20)
    counts = read_counts(data).counts
    assert counts.ethercat == 4
    assert counts.damaged.startswith("after packet 4: pcapng: block at byte")


def test_other_packets_are_counted(made: Conversation) -> None:
    frame = made.packets[0].data
    made.packets.insert(3, Packet(made.packets[2].time_ns, frame[:12] + b"\x08\x06" + bytes(46)))
    made.packets.insert(5, Packet(made.packets[4].time_ns, frame[:20]))
    made.packets.insert(6, Packet(made.packets[4].time_ns, frame[:20], original_length=60))
    counts = read_counts(capture_of(made.packets)).counts
    assert (counts.packets, counts.ethercat, counts.other) == (13, 10, 1)
    assert (counts.malformed, counts.shortened) == (1, 1)
    assert counts.first_malformed.startswith("packet 6: ")
    assert len(list(notes(counts, ()))) == 3


def test_dropped_packets_are_reported(made: Conversation) -> None:
    statistics = encode_statistics(9, received=20, dropped=10)
    counts = read_counts(capture_of(made.packets) + statistics).counts
    assert counts.dropped == 10
    assert "dropped 10 packets" in "".join(notes(counts, ()))


def test_reading_stops_at_a_time(made: Conversation) -> None:
    stream = EventStream(io.BytesIO(capture_of(made.packets)).read, until_ns=1_500_000)
    list(stream)
    assert stream.counts.packets == 4


@pytest.mark.parametrize(
    ("data", "reason", "hint"),
    [
        (b"", "begins with nothing", "Wireshark"),
        (b"hello world, this is text", "not a pcapng or pcap file", "Wireshark"),
        (b"\x1f\x8b\x08\x00" + bytes(20), "1f8b", "gunzip"),
    ],
)
def test_other_files_are_refused(data: bytes, reason: str, hint: str) -> None:
    with pytest.raises(DecodeError, match=reason) as refused:
        EventStream(io.BytesIO(data).read)
    assert hint in refused.value.hint


@pytest.mark.parametrize("change", [lambda t: -t, lambda t: 0, lambda t: t * 10**9])
def test_wrong_times_do_not_stop_the_timeline(
    made: Conversation, change: Callable[[int], int]
) -> None:
    packets = [
        Packet(10**19 + change(i), packet.data) if i else packet
        for i, packet in enumerate(made.packets)
    ]
    stream = EventStream(io.BytesIO(capture_of(packets)).read)
    list(stream)
    assert stream.counts.ethercat == 10
