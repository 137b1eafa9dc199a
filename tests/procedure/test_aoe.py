"""ADS requests with a simulated device: lost frames, late answers, fragments, faulty devices."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.errors import AdsError, MailboxError, ResponseTimeout
from catenary.procedure.aoe import AdsPeer, Place, own_net_id, read, write
from catenary.wire.ads import Read, Write, decode_request
from catenary.wire.ads_response import Sample, encode_notification, encode_result
from catenary.wire.aoe import (
    Command,
    Fragment,
    Message,
    decode_aoe,
    fragments,
    join,
)
from catenary.wire.mailbox import HEADER_SIZE, ErrorReply, Mailbox, Type
from tests.procedure.player import LAYOUT, STATION, MailboxDevice, channel, play

ROOM = LAYOUT.send_size - HEADER_SIZE
PLACE = Place(0xFFFF, 0x4020, 0)
CONTENT = bytes(k * 7 & 0xFF for k in range(500))


def peer() -> AdsPeer:
    return AdsPeer(own_net_id(STATION.address))


def mail(message: Message | Fragment) -> Mailbox:
    return Mailbox(Type.AOE, message.encode())


class Server:
    """Owner of one area. It answers as the SSC does: only entire requests, all fragments at once.

    Like the SSC, it drops a request whose first fragment has the packet number of an incomplete
    request.
    """

    def __init__(self) -> None:
        self.area = bytearray(CONTENT)
        self.requests: list[Message] = []
        self.packets: list[int] = []
        self._parts: dict[int, list[Fragment]] = {}

    def __call__(self, received: Mailbox) -> list[Mailbox]:
        message = decode_aoe(received.data)
        whole = self._joined(message) if isinstance(message, Fragment) else message
        return [] if whole is None else self.answer(whole)

    def _joined(self, part: Fragment) -> Message | None:
        known = self._parts.setdefault(part.packet, [])
        if part.number != len(known):
            del self._parts[part.packet]
            return None
        known.append(part)
        data = b"".join(each.data for each in known)
        if len(data) < known[0].total:
            return None
        self.packets.append(part.packet)
        return join(self._parts.pop(part.packet)[0], data)

    def answer(self, message: Message) -> list[Mailbox]:
        self.requests.append(message)
        match decode_request(message.command, message.data):
            case Read(_, offset, size):
                data = encode_result(0, bytes(self.area[offset : offset + size]))
            case Write(_, offset, data):
                self.area[offset : offset + len(data)] = data
                data = encode_result(0)
        answer = message.answered(data)
        if len(answer.encode()) <= ROOM:
            return [mail(answer)]
        return [mail(part) for part in fragments(answer, ROOM, 3)]


lost_frames = st.sets(st.integers(0, 40), max_size=6)


@settings(max_examples=200, deadline=None)
@given(out=lost_frames, back=lost_frames, size=st.sampled_from([4, 80, 500]))
def test_requests_despite_lost_frames(out: set[int], back: set[int], size: int) -> None:
    server, mailbox, known = Server(), channel(), peer()
    device = MailboxDevice(server)
    device.lose_out, device.lose_back = out, back - out
    try:
        play(write(mailbox, known, PLACE, CONTENT[:size][::-1]), device)
        assert play(read(mailbox, known, PLACE, size), device) == CONTENT[:size][::-1]
    except (MailboxError, ResponseTimeout):
        # A fragment of the answer was lost, or as many frames in a row as may be lost.
        assert (size > ROOM and back) or len(out | back) >= 5
        device.lose_out, device.lose_back = set(), set()
        play(write(mailbox, known, PLACE, CONTENT[:size][::-1]), device)
        assert play(read(mailbox, known, PLACE, size), device) == CONTENT[:size][::-1]
        return
    assert len(server.requests) == 2  # no request arrived twice


def test_lost_frames_of_one_fragment() -> None:
    server, mailbox, known = Server(), channel(), peer()
    device = MailboxDevice(server)
    device.lose_out = set(range(2, 7))
    with pytest.raises(ResponseTimeout, match="5 frames with fragment 2 of an AoE request were lo"):
        play(write(mailbox, known, PLACE, bytes(400)), device)
    play(write(mailbox, known, PLACE, bytes(400)), device)
    assert server.area[:400] == bytes(400)


def test_each_request_has_another_packet_number() -> None:
    server, mailbox, known = Server(), channel(), peer()
    for _ in range(2):
        play(write(mailbox, known, PLACE, bytes(400)), MailboxDevice(server))
    assert server.packets == [1, 2]


def test_a_late_answer_is_dropped() -> None:
    server, mailbox, known = Server(), channel(), peer()
    late: list[Mailbox] = []

    def slow(received: Mailbox) -> list[Mailbox]:
        answers = server(received)
        if len(server.requests) == 1:
            late.extend(answers)
            return []
        return late + answers

    device = MailboxDevice(slow)
    with pytest.raises(ResponseTimeout, match=r"no answer to a AOE message within 0\.5 s"):
        play(read(mailbox, known, PLACE, 300, timeout=0.5), device)
    assert play(read(mailbox, known, PLACE._replace(offset=7), 300), device) == CONTENT[7:307]
    assert mailbox.dropped == len(late) > 1


def test_a_device_may_answer_before_the_last_fragment() -> None:
    def refusing(received: Mailbox) -> list[Mailbox]:
        part = decode_aoe(received.data)
        assert isinstance(part, Fragment)
        if part.number:
            return []
        request = Message(part.target, part.source, Command.WRITE, b"", part.invoke_id)
        return [mail(request.answered(b"", error=0x0B))]

    device = MailboxDevice(refusing)
    with pytest.raises(AdsError, match="refused with 0x000B: no memory"):
        play(write(channel(), peer(), PLACE, bytes(400)), device)
    assert len(device.received) == 1


def test_a_device_without_aoe_refuses_the_first_fragment() -> None:
    error = Mailbox(Type.ERROR, ErrorReply(2).encode())
    device = MailboxDevice(lambda _: [error] if len(device.received) == 1 else [])
    with pytest.raises(MailboxError, match="mailbox error 0x0002"):
        play(write(channel(), peer(), PLACE, bytes(400)), device)
    assert len(device.received) == 1


def test_notifications_between_the_fragments_of_a_request() -> None:
    server, mailbox, seen = Server(), channel(), []

    def talking(received: Mailbox) -> list[Mailbox]:
        answers = server(received)
        part = decode_aoe(received.data)
        data = encode_notification((Sample(1, 2, b"x"),))
        return [mail(Message(part.target, part.source, Command.NOTIFICATION, data)), *answers]

    def take(received: Mailbox, _time_ns: int) -> bool:
        seen.append(received)
        return True

    mailbox.subscribers[Type.AOE] = take
    play(write(mailbox, peer(), PLACE, bytes(400)), MailboxDevice(talking))
    assert server.area[:400] == bytes(400)
    assert len(seen) >= 5
    assert mailbox.dropped == 0


def test_a_missing_fragment_times_out() -> None:
    def cut(received: Mailbox) -> list[Mailbox]:
        return Server()(received)[:2]

    with pytest.raises(ResponseTimeout, match=r"no answer to a AOE message within 0\.5 s"):
        play(read(channel(), peer(), PLACE, 400, timeout=0.5), MailboxDevice(cut))


def test_a_fragmented_answer_that_is_longer_than_requested() -> None:
    def lying(received: Mailbox) -> list[Mailbox]:
        request = decode_aoe(received.data)
        assert isinstance(request, Message)
        answer = request.answered(encode_result(0, bytes(1000)))
        return [mail(part) for part in fragments(answer, ROOM, 3)]

    with pytest.raises(MailboxError, match="announces an answer of 1024 bytes"):
        play(read(channel(), peer(), PLACE, 400), MailboxDevice(lying))


def test_a_request_with_too_many_fragments_is_not_sent() -> None:
    small = channel()
    small.layout = replace(small.layout, receive_size=64)  # 26 bytes per fragment
    with pytest.raises(ValueError, match="do not fit into 65536 fragments"):
        write(small, peer(), PLACE, bytes(1 << 21))
