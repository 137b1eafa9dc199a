"""Vendor-specific messages: `sub.voe` without and with a loop."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.bus import MainDevice, SubDevice
from catenary.errors import MailboxError, ResponseTimeout
from catenary.virtual import AnalogInputs, Coupler, Segment, Servo, VendorEcho, VendorMessages
from catenary.wire.mailbox import Type
from catenary.wire.voe import VoeMessage

VENDOR = 0xE0000001


def reverse(vendor: int, type: int, data: bytes) -> tuple[int, bytes] | None:
    return None if type == 99 else (type + 1, data[::-1])


@pytest.fixture
def messages() -> VendorMessages:
    return VendorMessages(reverse)


@pytest.fixture
def sub(messages: VendorMessages) -> Iterator[SubDevice]:
    with MainDevice(Segment([Coupler(), AnalogInputs(protocols=[messages])])) as main:
        yield main.scan()[1]


def test_an_exchange(sub: SubDevice) -> None:
    assert sub.voe.exchange(7, b"abc") == VoeMessage(sub.identity.vendor, 8, b"cba")
    assert sub.voe.exchange(7, vendor=VENDOR) == VoeMessage(VENDOR, 8, b"")
    room = 128 - 12
    assert len(sub.voe.exchange(7, bytes(room)).data) == room
    with pytest.raises(ValueError, match=f"{room + 1} bytes; the mailbox .* accepts {room}"):
        sub.voe.exchange(7, bytes(room + 1))
    with pytest.raises(ValueError, match="does not fit"):
        sub.voe.exchange(1 << 16)
    with pytest.raises(ValueError, match="timeout"):
        sub.voe.exchange(1, timeout=float("nan"))


def test_a_message_without_an_answer(sub: SubDevice) -> None:
    sub.voe.send(99, b"abc")
    assert sub.voe.receive(0.05) is None
    sub.voe.send(1, b"abc")
    assert sub.voe.receive() == VoeMessage(sub.identity.vendor, 2, b"cba")
    assert sub.voe.take() is None


def test_messages_that_were_not_requested(sub: SubDevice, messages: VendorMessages) -> None:
    assert sub.voe.receive(0) is None
    assert messages.send(VENDOR, 5, b"event")
    assert sub.voe.receive(0) == VoeMessage(VENDOR, 5, b"event")
    messages.send(VENDOR, 6)
    sub.sdo.read(0x1018, 1)  # another procedure finds the message first
    assert sub.voe.take() == VoeMessage(VENDOR, 6)
    with pytest.raises(ValueError, match="timeout must be 0 or more"):
        sub.voe.receive(-1)


def test_the_oldest_of_many_messages_are_dropped(sub: SubDevice, messages: VendorMessages) -> None:
    sub.voe.take()
    for number in range(80):
        messages.send(VENDOR, number)
        sub.sdo.read(0x1018, 1)
    assert sub.voe.dropped == 16
    assert sub.voe.take() == VoeMessage(VENDOR, 16)


def test_no_answer() -> None:
    echo = VendorEcho(answers="none")
    with MainDevice(Segment([Coupler(), AnalogInputs(protocols=[echo])])) as main:
        sub = main.scan()[1]
        with pytest.raises(ResponseTimeout, match=r"no answer to a VOE message within 0\.3 s"):
            sub.voe.exchange(1, timeout=0.3)
        assert len(sub.sdo.read(0x1018, 1)) == 4


def test_a_flood_of_answers() -> None:
    echo = VendorEcho(answers="flood")
    with MainDevice(Segment([Coupler(), AnalogInputs(protocols=[echo])])) as main:
        sub = main.scan()[1]
        assert sub.voe.exchange(1, b"x") == VoeMessage(sub.identity.vendor, 1, b"x")
        assert len(sub.sdo.read(0x1018, 1)) == 4
        assert sub.voe.take() == VoeMessage(sub.identity.vendor, 1, b"x")


def test_invalid_messages(sub: SubDevice, monkeypatch: pytest.MonkeyPatch) -> None:
    from catenary.virtual.vendor_protocol import VendorServer

    monkeypatch.setattr(VendorServer, "serve", lambda *_: [b"short"])
    with pytest.raises(MailboxError, match="invalid VoE message: VoE: needs 6 bytes, received 5"):
        sub.voe.exchange(1)
    channel = sub.channel
    assert channel is not None
    before = channel.dropped
    sub.voe.send(1)
    assert sub.voe.receive(0.02) is None
    assert channel.dropped == before + 1
    assert channel.subscribers[Type.VOE] is not None


def test_a_device_without_voe() -> None:
    with MainDevice(Segment([Coupler(), Servo()])) as main:
        coupler, servo = main.scan()
        with pytest.raises(MailboxError, match="protocol is not supported"):
            servo.voe.exchange(1)
        with pytest.raises(MailboxError, match="does not support VoE"):
            coupler.voe.send(1)


def test_requests_while_a_loop_runs() -> None:
    messages = VendorMessages(reverse)
    with MainDevice(Segment([Coupler(), Servo(protocols=[messages])])) as main:
        sub = main.scan()[1]
        arm = cat.Drives([sub], counts_per_turn=2**20, velocity_limit=10.0)
        with cat.Loop(arm, period=1e-3) as loop:
            answer = sub.voe.request(7, b"abc")
            for _ in loop:
                if answer.done:
                    break
            assert answer.result().data == b"cba"
            sent = sub.voe.request_send(99, b"abc")
            messages.send(VENDOR, 5)
            for _ in loop:
                if sent.done and (found := sub.voe.take()) is not None:
                    break
            assert found == VoeMessage(VENDOR, 5)
            assert sent.result() is None
            with pytest.raises(RuntimeError):
                sub.voe.exchange(1)


def test_a_device_outside_of_a_segment_sends_nothing(messages: VendorMessages) -> None:
    with pytest.raises(ValueError, match="not in a segment"):
        messages.send(1, 2)
