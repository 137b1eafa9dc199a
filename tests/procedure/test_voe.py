"""Vendor-specific messages with a simulated device: lost frames, late answers."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.errors import MailboxError, ResponseTimeout
from catenary.procedure.voe import exchange, send
from catenary.wire.mailbox import Mailbox, Type
from catenary.wire.voe import VoeMessage, decode_voe
from tests.procedure.player import MailboxDevice, channel, play


def reverse(received: Mailbox) -> list[Mailbox]:
    message = decode_voe(received.data)
    answer = VoeMessage(message.vendor, message.type + 1, message.data[::-1])
    return [Mailbox(Type.VOE, answer.encode())]


lost_frames = st.sets(st.integers(0, 20), max_size=6)


@settings(max_examples=200, deadline=None)
@given(out=lost_frames, back=lost_frames)
def test_messages_despite_lost_frames(out: set[int], back: set[int]) -> None:
    device, mailbox = MailboxDevice(reverse), channel()
    device.lose_out, device.lose_back = out, back - out
    try:
        for number in range(3):
            answer = play(exchange(mailbox, VoeMessage(2, number, b"abc")), device)
            assert answer == VoeMessage(2, number + 1, b"cba")
    except ResponseTimeout:
        assert len(out | back) >= 5  # the number of frames in a row that may be lost
        return
    assert len(device.received) == 3  # no message arrived twice


@pytest.mark.parametrize("back", [False, True])
def test_a_message_without_an_answer_is_sent_again(back: bool) -> None:
    device = MailboxDevice(lambda _: [])
    (device.lose_back if back else device.lose_out).update({0, 1})
    play(send(channel(), VoeMessage(2, 1, b"abc")), device)
    assert [decode_voe(each.data) for each in device.received] == [VoeMessage(2, 1, b"abc")]


def test_too_many_lost_frames() -> None:
    device = MailboxDevice(lambda _: [])
    device.lose_out = set(range(5))
    with pytest.raises(ResponseTimeout, match="5 frames with the same VoE message were lost"):
        play(send(channel(), VoeMessage(2, 1)), device)
    play(send(channel(), VoeMessage(2, 1)), device)
    assert len(device.received) == 1


def test_a_late_answer_is_given_to_the_subscriber() -> None:
    kept: list[VoeMessage] = []

    def keep(received: Mailbox, _time_ns: int) -> bool:
        kept.append(decode_voe(received.data))
        return True

    mailbox = channel()
    mailbox.subscribers[Type.VOE] = keep
    device = MailboxDevice(lambda message: reverse(message) if len(device.received) > 1 else [])
    with pytest.raises(ResponseTimeout, match=r"no answer to a VOE message within 0\.5 s"):
        play(exchange(mailbox, VoeMessage(2, 1), 0.5), device)
    device.send(reverse(device.received[0])[0])
    assert play(exchange(mailbox, VoeMessage(2, 5)), device) == VoeMessage(2, 6)
    assert kept == [VoeMessage(2, 2)]


def test_a_short_answer_is_reported_and_the_mailbox_still_works() -> None:
    mailbox = channel()
    device = MailboxDevice(
        lambda message: (
            reverse(message) if len(device.received) > 1 else [Mailbox(Type.VOE, b"short")]
        )
    )
    with pytest.raises(MailboxError, match="invalid VoE message"):
        play(exchange(mailbox, VoeMessage(2, 1)), device)
    assert play(exchange(mailbox, VoeMessage(2, 1)), device) == VoeMessage(2, 2)
