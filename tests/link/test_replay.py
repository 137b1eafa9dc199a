"""Replays of recorded segments."""

from __future__ import annotations

import struct
from dataclasses import replace

import pytest

from catenary.errors import DecodeError, LinkError
from catenary.link import Recorder, Replay
from catenary.link.frame_pairs import pair, read_exchanges
from catenary.wire.capture import decode_capture
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import Frame
from catenary.wire.pcapng import Direction, Packet
from tests.link.python_link import PythonLink, frame

QUESTION = frame(bytes(4))
MS = 1_000_000


def answered(link: Replay, sent: bytes) -> bytes | None:
    link.send(sent)
    return link.receive() if link.wait_until(link.now() + 1_000_000_000, True) else None


def test_answers_with_the_index_of_the_question():
    link = Replay([(frame(b"ask", index=7), frame(b"say", index=7))])
    assert answered(link, frame(b"ask", index=200)) == frame(b"say", index=200)
    assert (link.answered, link.unmatched, link.first_unmatched) == (1, 0, None)


def test_answers_of_one_question_come_in_order_and_the_last_again():
    says = [frame(bytes([n]) * 4) for n in range(3)]
    link = Replay([(QUESTION, said) for said in says])
    assert [answered(link, QUESTION) for _ in range(5)] == [*says, says[2], says[2]]


def test_an_unknown_question_is_unanswered_and_reported():
    link = Replay([(QUESTION, QUESTION)])
    assert answered(link, frame(b"else")) is None
    assert answered(link, frame(b"more")) is None
    assert (link.answered, link.unmatched) == (0, 2)
    assert link.first_unmatched == frame(b"else")


@pytest.mark.parametrize("cut", range(16, 28))
def test_frames_cut_short_stay_unanswered(cut):
    link = Replay([(QUESTION, QUESTION)])
    assert answered(link, QUESTION[:cut]) is None


def test_time_passes_in_waiting_alone():
    link = Replay([(QUESTION, QUESTION)])
    assert link.wait_until(5_000, False) is False
    assert link.now() == 5_000
    link.send(QUESTION)
    assert link.wait_until(9_000, True) is True
    assert link.now() == 5_000


def test_more_answers_under_way_than_there_is_room_for_are_refused():
    link = Replay([(QUESTION, QUESTION)])
    for _ in range(63):
        link.send(QUESTION)
    with pytest.raises(LinkError, match="cannot send"):
        link.send(QUESTION)


def test_a_recording_replays_with_its_latencies(tmp_path):
    path = tmp_path / "run.pcapng"
    frames = [frame(bytes([n]) * 20, index=n) for n in range(10)]
    with Recorder(PythonLink(latency_ns=1234), path) as link:
        for sent in frames:
            link.send(sent)
            assert link.wait_until(link.now() + 10_000, True)
            assert link.receive() == sent
    with Replay(path) as replay:
        assert [answered(replay, sent) for sent in frames] == frames
        assert replay.now() == 10 * 1234
        assert replay.name == f"replay of {path}"


def test_pairs_by_direction_even_where_no_controller_touched_the_frame():
    packets = [
        Packet(100, QUESTION, direction=Direction.OUTBOUND),
        Packet(350, QUESTION, direction=Direction.INBOUND),
        Packet(900, QUESTION, direction=Direction.INBOUND),
    ]
    assert pair(packets) == [(QUESTION, QUESTION, 250)]


def test_pairs_by_the_source_address_where_the_file_names_no_direction():
    sent = QUESTION[:6] + b"\x00" + QUESTION[7:]
    assert pair([Packet(1, sent), Packet(2, b"alien"), Packet(3, QUESTION)]) == [
        (sent, QUESTION, 2)
    ]


def counted(sent: bytes, by: int = 1) -> bytes:
    """Return a frame of one datagram as a device counts it, with the same source address."""
    return sent[:-2] + bytes([by, 0])


def local(sent: bytes, bit: bool) -> bytes:
    """Return a frame with or without the bit that controllers set in the source address."""
    return sent[:6] + (b"\x02" if bit else b"\x00") + sent[7:]


@pytest.mark.parametrize("bit", [True, False])
def test_pairs_by_content_where_the_source_address_tells_nothing(bit):
    """02:... is the address of a virtual interface; a simulator may not set the bit at all."""
    first, second = (local(frame(bytes([n]) * 40, index=n), bit) for n in (1, 2))
    packets = [Packet(n, data) for n, data in enumerate((first, second, counted(second)))]
    packets += [Packet(9, counted(first)), Packet(10, first), Packet(2 * MS, first)]
    packets += [Packet(3 * MS, counted(first, 3))]
    assert pair(packets) == [
        (second, counted(second), 1),
        (first, counted(first), 9),
        (first, counted(first, 3), 3 * MS - 10),
    ]


@pytest.mark.parametrize("seconds", [0.05, 0.2])
def test_a_lost_frame_gets_no_answer_of_a_later_one(seconds):
    asked, again = QUESTION[:6] + b"\x00" + QUESTION[7:], round(seconds * 1e9)
    packets = [Packet(0, asked), Packet(again, asked), Packet(again + 5, QUESTION)]
    [exchange] = pair(packets)
    assert exchange.latency_ns == (5 if seconds > 0.1 else again + 5)


def test_pairs_by_content_where_only_the_address_was_counted_up():
    """A broadcast or position read that no device answers comes back uncounted."""
    asked = Frame((Datagram(EcatCommand.APRD, 0x0130_FFFE, bytes(40), 7),), b"\x02" + bytes(5))
    answer = Frame((Datagram(EcatCommand.APRD, 0x0130_0001, bytes(40), 7),), asked.source)
    assert pair([Packet(1, asked.encode()), Packet(4, answer.encode())]) == [
        (asked.encode(), answer.encode(), 3)
    ]


def test_an_unanswered_frame_stays_unpaired_without_direction():
    lost = local(frame(bytes(40)), True)
    assert pair([Packet(2 * MS * n, lost) for n in range(5)]) == []


@pytest.mark.parametrize(("size", "later"), [(40, 10_000), (4, 30 * MS)])
def test_a_frame_that_returns_unchanged_returns_at_once_or_padded(size, later):
    """A read of a station that is not there: nothing in it changes on the way."""
    asked = local(frame(bytes(size)), True)
    packets = [Packet(0, asked), Packet(later, asked.ljust(60, b"\0"))]
    assert pair(packets) == [(asked, packets[1].data, later)]


def test_captures_without_a_telling_source_address_pair_alike(shared_data):
    """The bit is set everywhere, as if the interface's own address had it."""
    for path in sorted((shared_data / "pcap").glob("*.pcapng")):
        packets = decode_capture(path.read_bytes()).packets
        blind = [replace(p, data=local(p.data, True), direction=Direction.UNKNOWN) for p in packets]
        found = [(e.sent[12:], e.answer[12:], e.latency_ns) for e in pair(blind)]
        assert found == [(e.sent[12:], e.answer[12:], e.latency_ns) for e in pair(packets)], path


def test_a_pcap_file_and_a_cut_file_replay(tmp_path):
    question = QUESTION[:6] + b"\x00" + QUESTION[7:]
    data = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
    for n, each in enumerate((question, QUESTION, question)):
        data += struct.pack("<4I", 1, n, len(each), len(each)) + each
    path = tmp_path / "run.pcap"
    path.write_bytes(data[:-1])
    with Replay(path) as replay:
        assert answered(replay, question) == QUESTION
        assert replay.now() == 1000


def test_a_file_that_is_no_capture_is_a_decode_error(tmp_path):
    path = tmp_path / "notes.txt"
    path.write_text("no capture at all")
    with pytest.raises(DecodeError, match="pcapng"):
        Replay(path)


def test_nothing_recorded_is_an_error():
    with pytest.raises(ValueError, match="no frame that came back"):
        Replay([])


def test_captures_of_real_segments_answer_as_they_did(shared_data):
    replayed = 0
    for path in sorted((shared_data / "pcap").glob("*.pcapng")):
        exchanges = read_exchanges(path)
        if not exchanges:
            continue  # a scan of an empty cable
        link = Replay(path)
        assert [answered(link, e.sent) for e in exchanges] == [e.answer for e in exchanges]
        assert link.unmatched == 0
        replayed += 1
    assert replayed


def test_a_recording_keeps_the_direction(tmp_path):
    path = tmp_path / "run.pcapng"
    with Recorder(PythonLink(latency_ns=0), path) as link:
        link.send(QUESTION)
        link.receive()
    directions = [packet.direction for packet in decode_capture(path.read_bytes()).packets]
    assert directions == [Direction.OUTBOUND, Direction.INBOUND]
