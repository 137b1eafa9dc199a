"""Sent and returned frames: directions, losses, two masters."""

from __future__ import annotations

from dataclasses import replace

from catenary.capture.contents import DeviceCount, FramesLost, StateRequest
from catenary.capture.direction import LOST_NS
from catenary.capture.notes import notes
from catenary.wire.al import AlState
from catenary.wire.datagram import Datagram, EcatCommand
from tests.capture.made import Conversation, address

READ = Datagram(EcatCommand.FPRD, address(0x1001, 0x0130), bytes(2))
INIT = Datagram(EcatCommand.BWR, address(0, 0x0120), b"\x01\x00")
COUNT = Datagram(EcatCommand.BRD, address(0, 0), bytes(2))
OTHER = b"\x00\x1b\x21\x01\x02\x03"


def test_lost_frames_in_a_row_are_one_event() -> None:
    made = Conversation()
    made.exchange(READ, answers=[(b"\x01\x00", 1)])
    for _ in range(3):
        made.exchange(READ, answers=[(None, 0)], returned=False)
    made.time_ns += LOST_NS
    made.exchange(READ, answers=[(b"\x01\x00", 1)])
    stream = made.stream()
    lost = [event for event in stream if isinstance(event.content, FramesLost)]
    assert [(event.content, event.packet) for event in lost] == [(FramesLost(3), 3)]
    master = stream.masters[0].master
    assert (master.sent, master.returned, master.lost) == (5, 2, 3)


def test_a_frame_at_the_end_of_the_file_is_not_lost() -> None:
    made = Conversation()
    made.exchange(READ, answers=[(b"\x01\x00", 1)])
    made.exchange(READ, answers=[(None, 0)], returned=False)
    stream = made.stream()
    assert not [event for event in stream if isinstance(event.content, FramesLost)]
    assert (stream.masters[0].master.sent, stream.masters[0].master.lost) == (2, 0)


def test_copies_of_frames_on_both_interfaces_of_a_ring_are_omitted() -> None:
    made = Conversation()
    for _ in range(3):
        made.exchange(READ, answers=[(b"\x01\x00", 1)])
    for sent in made.packets[::2]:
        made.packets.append(replace(sent, time_ns=sent.time_ns + 1_000))  # second interface
        made.packets.append(replace(sent, time_ns=sent.time_ns + 30_000))  # returned unprocessed
    made.packets.sort(key=lambda packet: packet.time_ns)
    stream = made.stream()
    assert not [event for event in stream if isinstance(event.content, FramesLost)]
    master = stream.masters[0].master
    assert (master.sent, master.returned, master.lost, master.collisions) == (3, 3, 0, 0)


def test_only_the_sent_direction_still_shows_requests() -> None:
    made = Conversation()
    made.exchange(INIT, answers=[(None, 0)], returned=False)
    made.exchange(INIT, answers=[(None, 0)], returned=False)
    stream = made.stream()
    assert [event.content for event in stream] == [StateRequest(AlState.INIT)] * 2
    assert stream.masters[0].master.returned == 0


def test_only_the_returned_direction_restores_positions() -> None:
    made = Conversation(OTHER)
    made.exchange(COUNT, answers=[(None, 3)], sent=False)
    assign = Datagram(EcatCommand.APWR, address(2, 0x0010), b"\x05\x10")  # position 1 of 3
    made.exchange(assign, answers=[(None, 1)], sent=False)
    stream = made.stream()
    first, *_ = stream
    assert first.content == DeviceCount(3)
    [device] = stream.masters[0].devices
    assert (device.position, device.station) == (1, 0x1005)


def test_two_masters_are_told_apart() -> None:
    first, second = Conversation(), Conversation(OTHER)
    for _ in range(3):
        first.exchange(COUNT, answers=[(None, 2)])
        second.exchange(COUNT, answers=[(None, 2)])
    first.packets = sorted(first.packets + second.packets, key=lambda packet: packet.time_ns)
    stream = first.stream()
    assert [event.master for event in stream] == [0, 1]
    assert [each.master.source for each in stream.masters] == [first.source, OTHER]
    assert [each.master.sent for each in stream.masters] == [3, 3]


def test_a_virtual_interface_has_the_bit_in_its_own_address() -> None:
    made = Conversation(b"\x02\x00\x00\x00\x00\x01")
    made.exchange(COUNT, answers=[(None, 2)])
    made.exchange(READ, answers=[(b"\x01\x00", 1)])
    stream = made.stream()
    list(stream)
    master = stream.masters[0].master
    assert (master.sent, master.returned, master.lost) == (2, 2, 0)


def test_two_programs_with_one_source_address() -> None:
    """A master uses an index again only after the answer, or after some ms."""
    made = Conversation()
    for _ in range(3):
        made.exchange(COUNT, answers=[(None, 2)])
    single = made.stream()
    list(single)
    assert not list(notes(single.counts, single.masters))
    for sent, back in zip(made.packets[::2], made.packets[1::2], strict=True):
        made.packets += [replace(sent, time_ns=sent.time_ns + 5_000)]
        made.packets += [replace(back, time_ns=back.time_ns + 5_000)]
    made.packets.sort(key=lambda packet: packet.time_ns)
    stream = made.stream()
    list(stream)
    assert stream.masters[0].master.collisions == 3
    assert "two programs" in "".join(notes(stream.counts, stream.masters))
