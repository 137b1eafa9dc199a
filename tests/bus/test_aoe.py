"""ADS requests: `sub.aoe` without and with a loop, fragments, errors and faulty devices."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.bus import MainDevice, SubDevice
from catenary.bus.ads_notifications import NotificationQueues
from catenary.errors import AdsError, ConfigurationError, MailboxError, ResponseTimeout
from catenary.procedure.exchange import Procedure
from catenary.virtual import Ads, AnalogInputs, Coupler, Segment, Servo
from catenary.virtual.aoe.server import AdsServer
from catenary.wire.ads import WriteControl
from catenary.wire.ads_response import DeviceInfo, Sample, States, encode_notification
from catenary.wire.aoe import Address, Command, Message
from catenary.wire.mailbox import Mailbox, Type

GROUP, LONG = 0x4020, 0x4021
CONTENT = bytes(k * 7 & 0xFF for k in range(1000))


def device(**options: object) -> AnalogInputs:
    areas = {GROUP: b"abcdefgh", "0x4021": CONTENT, 0x4022: "text"}
    chosen = {"areas": areas, "read_only": (0x4022,)} | options
    return AnalogInputs(protocols=[Ads(**chosen)])  # type: ignore[arg-type]


@pytest.fixture
def sub() -> Iterator[SubDevice]:
    with MainDevice(Segment([Coupler(), device()])) as main:
        yield main.scan()[1]


def test_data_are_read_and_written(sub: SubDevice) -> None:
    assert sub.aoe.read(GROUP, 2, 3) == b"cde"
    sub.aoe.write(GROUP, 1, b"XY")
    assert sub.aoe.read(GROUP, 0, 8) == b"aXYdefgh"
    assert sub.aoe.read_write(GROUP, 6, 2, b"z") == b"zh"
    assert sub.aoe.read(0x4022, 0, 4) == b"text"
    assert sub.aoe.read(GROUP, 0, 0) == b""


def test_objects_of_coe(sub: SubDevice) -> None:
    vendor = sub.sdo.read(0x1018, 1)
    assert sub.aoe.read(0xF302, 0x1018_0001, 4) == vendor
    assert sub.aoe.read(0xF302, 0x1018_0100, 32) == sub.sdo.read(0x1018, complete=True)
    sub.aoe.write(0xF302, 0x2102_0000, b"\x34\x12")
    assert sub.sdo.read(0x2102) == b"\x34\x12"


def test_long_data_are_sent_in_fragments(sub: SubDevice) -> None:
    assert sub.aoe.read(LONG, 0, 1000) == CONTENT
    sub.aoe.write(LONG, 0, CONTENT[::-1])
    assert sub.aoe.read(LONG, 0, 1000) == CONTENT[::-1]
    assert sub.aoe.read_write(LONG, 0, 1000, CONTENT) == CONTENT


@pytest.mark.parametrize("size", range(70, 91))
def test_sizes_around_the_mailbox(sub: SubDevice, size: int) -> None:
    """A mailbox of 128 bytes holds 82 bytes of a response, and 78 of a write."""
    assert sub.aoe.read(LONG, 0, size) == CONTENT[:size]
    sub.aoe.write(LONG, 100, CONTENT[:size])
    assert sub.aoe.read(LONG, 100, size) == CONTENT[:size]


@pytest.mark.parametrize("way", ["acknowledged", "repeated"])
def test_other_ways_of_fragments(way: str) -> None:
    with MainDevice(Segment([Coupler(), device(fragments=way)])) as main:
        aoe = main.scan()[1].aoe
        assert aoe.read(LONG, 0, 1000) == CONTENT
        assert aoe.read(LONG, 0, 1000) == CONTENT


@pytest.mark.parametrize(
    ("way", "match"),
    [("missing", "sent fragment 2 instead of 1"), ("empty", "sent fragment 1 without data")],
)
def test_faulty_fragments(way: str, match: str) -> None:
    with MainDevice(Segment([Coupler(), device(fragments=way)])) as main:
        aoe = main.scan()[1].aoe
        with pytest.raises(MailboxError, match=match):
            aoe.read(LONG, 0, 1000)
        assert aoe.read(GROUP, 0, 2) == b"ab"


def test_information_and_state(sub: SubDevice) -> None:
    assert sub.aoe.device_info() == DeviceInfo("Catenary virtual", 1, 2, 3)
    assert sub.aoe.state() == States(5, 0)
    sub.aoe.write_control(6, 9)
    assert sub.aoe.state() == States(6, 9)


@pytest.mark.parametrize(
    ("group", "offset", "size", "code", "match"),
    [
        (0x1234, 0, 1, 0x702, "READ of 1 bytes, group 0x1234.* refused with 0x0702: invalid index"),
        (GROUP, 9, 1, 0x703, "invalid index offset"),
        (GROUP, 4, 5, 0x705, "wrong size"),
        (0xF302, 0x9999_0000, 1, 0x703, "invalid index offset"),
    ],
)
def test_refused_reads(
    sub: SubDevice, group: int, offset: int, size: int, code: int, match: str
) -> None:
    with pytest.raises(AdsError, match=match) as caught:
        sub.aoe.read(group, offset, size)
    assert (caught.value.code, caught.value.position) == (code, 1)
    assert caught.value.hint


def test_refused_writes_and_ports(sub: SubDevice) -> None:
    with pytest.raises(AdsError, match="not permitted"):
        sub.aoe.write(0x4022, 0, b"x")
    with pytest.raises(AdsError, match="at port 4097 refused with 0x0006: target port not found"):
        sub.aoe.read(GROUP, 0, 1, port=0x1001)
    with pytest.raises(AdsError, match="not permitted"):
        sub.aoe.write(0xF302, 0x1018_0001, bytes(4))


def test_the_net_id_is_that_of_the_first_request_or_the_assigned_one(sub: SubDevice) -> None:
    assert sub.aoe.net_id == "127.0.0.1.16.2"
    assert sub.aoe.read(GROUP, 0, 1) == b"a"
    sub.aoe.assign_net_id("5.6.7.8.9.10")
    assert sub.aoe.net_id == "5.6.7.8.9.10"
    assert sub.aoe.read(GROUP, 0, 1) == b"a"
    with pytest.raises(ValueError, match="is not a NetId"):
        sub.aoe.assign_net_id("5.6.7")
    assert sub.aoe.net_id == "5.6.7.8.9.10"
    sub.aoe.assign_net_id()
    assert sub.aoe.net_id == "127.0.0.1.16.2"
    assert sub.aoe.read(GROUP, 0, 1) == b"a"


def test_a_refused_net_id_is_not_used(sub: SubDevice, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(AdsServer, "_assigned", lambda *_: b"")
    assert sub.aoe.read(GROUP, 0, 1) == b"a"
    with pytest.raises(AdsError, match="assignment of the NetId refused with 0x0007"):
        sub.aoe.assign_net_id("5.6.7.8.9.10")
    assert sub.aoe.net_id == "127.0.0.1.16.2"
    assert sub.aoe.read(GROUP, 0, 1) == b"a"


def test_a_device_with_another_net_id_refuses(sub: SubDevice) -> None:
    sub.aoe.assign_net_id("5.6.7.8.9.10")
    other = cat.bus.Aoe(sub)  # it uses the NetId of the station address
    with pytest.raises(AdsError, match="target NetId not found") as caught:
        other.read(GROUP, 0, 1)
    assert "assign_net_id" in caught.value.hint


def faulty(match: str, kind: type[Exception], **options: object) -> None:
    with MainDevice(Segment([Coupler(), device(**options)])) as main:
        sub = main.scan()[1]
        with pytest.raises(kind, match=match):
            sub.aoe.read(GROUP, 0, 4, timeout=0.5)
        assert len(sub.sdo.read(0x1018, 1)) == 4  # the mailbox still works


def test_a_wrong_invoke_id() -> None:
    faulty("no response to invoke ID 1 within 0.5 s, but to 2", ResponseTimeout, invoke_id="wrong")


def test_lying_lengths() -> None:
    faulty("announces 19 bytes, 12 received", MailboxError, length="long")
    faulty("4 bytes announced, 3 received", MailboxError, length="short")


def test_no_answer() -> None:
    faulty("no answer to a AOE message within 0.5 s", ResponseTimeout, responses="none")


def test_answers_without_end() -> None:
    with MainDevice(Segment([Coupler(), device(responses="endless")])) as main:
        sub = main.scan()[1]
        for _ in range(3):  # each request reads 64 of 200 messages
            with pytest.raises(MailboxError, match="64 unexpected mailbox messages"):
                sub.sdo.read(0x1018, 1) if sub.channel.owed else sub.aoe.read(GROUP, 0, 4)
        assert len(sub.sdo.read(0x1018, 1)) == 4


@pytest.mark.parametrize("size", [-1, (1 << 22) + 1])
def test_sizes_out_of_range(sub: SubDevice, size: int) -> None:
    with pytest.raises(ValueError, match=r"AoE|ADS"):
        sub.aoe.read(GROUP, 0, size)


def test_values_out_of_range(sub: SubDevice) -> None:
    with pytest.raises(ValueError, match="do not fit"):
        sub.aoe.read(1 << 32, 0, 1)
    with pytest.raises(ValueError, match="16 bits"):
        sub.aoe.read(1, 0, 1, port=1 << 16)
    with pytest.raises(ValueError, match="period"):
        sub.aoe.subscribe(GROUP, 0, 4, period=0)


def test_a_device_without_aoe_or_a_mailbox() -> None:
    with MainDevice(Segment([Coupler(), Servo()])) as main:
        coupler, servo = main.scan()
        with pytest.raises(MailboxError, match="protocol is not supported"):
            servo.aoe.read(GROUP, 0, 1)
        with pytest.raises(MailboxError, match="has no mailbox: it does not support AoE"):
            coupler.aoe.read(GROUP, 0, 1)
        with pytest.raises(ConfigurationError, match="not offered"):
            cat.bus.Aoe(servo, unavailable="not offered").read(GROUP, 0, 1)


def test_notifications_on_change(sub: SubDevice) -> None:
    with sub.aoe.subscribe(GROUP, 0, 2, period=0.01) as changes:
        assert [each.data for each in changes.wait()] == [b"ab"]
        assert changes.wait(0.1) == []
        sub.aoe.write(GROUP, 0, b"xy")
        [sample] = changes.wait()
        assert isinstance(sample, Sample)
        assert (sample.data, sample.handle, changes.dropped) == (b"xy", changes.handle, 0)
    sub.aoe.write(GROUP, 0, b"ab")
    assert changes.ended
    with pytest.raises(MailboxError, match="notifications of handle 1 have ended"):
        changes.wait(0.1)
    changes.close()


def test_notifications_of_two_values_and_a_full_queue(sub: SubDevice) -> None:
    first = sub.aoe.subscribe(GROUP, 0, 2, period=0.01, on_change=False, kept=3)
    second = sub.aoe.subscribe(GROUP, 4, 1, period=0.02, on_change=False)
    values = set()
    for _ in range(10):
        values |= {each.data for each in second.wait(0.1)}
        sub.sdo.read(0x1018, 1)  # notifications between the answers of other procedures
    assert first.dropped > 0
    assert [each.data for each in first.take()] == [b"ab"] * 3
    assert values == {b"e"}
    assert first.handle != second.handle
    first.close()
    second.close()


def test_refused_notifications(sub: SubDevice) -> None:
    with pytest.raises(AdsError, match="ADD_NOTIFICATION at port 65535 refused with 0x0702"):
        sub.aoe.subscribe(0x1111, 0, 2)
    with pytest.raises(AdsError, match="out of memory"):
        sub.aoe.subscribe(LONG, 0, 500)
    open_ones = [sub.aoe.subscribe(GROUP, 0, 1) for _ in range(16)]
    with pytest.raises(AdsError, match="no further notifications"):
        sub.aoe.subscribe(GROUP, 0, 1)
    for each in open_ones:
        each.close()


def test_a_restarted_device_has_no_notifications(sub: SubDevice) -> None:
    changes = sub.aoe.subscribe(GROUP, 0, 2, period=0.01, on_change=False)
    sub.request_state("INIT")
    sub.request_state("PREOP")
    changes.take()
    assert changes.ended
    with pytest.raises(MailboxError, match="have ended") as caught:
        changes.wait(0.1)
    assert "subscribe again" in caught.value.hint
    again = sub.aoe.subscribe(GROUP, 4, 1, period=0.01, on_change=False)
    assert again.handle == changes.handle
    changes.close()  # does not end the new notifications
    assert {each.data for each in again.wait()} == {b"e"}
    assert not again.ended
    again.close()


def test_notifications_end_with_a_scan(sub: SubDevice) -> None:
    changes = sub.aoe.subscribe(GROUP, 0, 2, period=0.01)
    assert sub.main.scan()[1] is sub  # type: ignore[attr-defined]
    assert changes.ended
    changes.close()
    with sub.aoe.subscribe(GROUP, 0, 2, period=0.01) as again:
        assert [each.data for each in again.wait()] == [b"ab"]


def test_early_samples_of_a_notification(sub: SubDevice) -> None:
    queues = NotificationQueues()

    def notification(port: int, handle: int) -> Mailbox:
        data = encode_notification((Sample(handle, 1, bytes([handle])),))
        source = Address(bytes(6), port)
        return Mailbox(Type.AOE, Message(source, source, Command.NOTIFICATION, data).encode())

    def handle() -> Procedure[int]:
        yield []
        return 7

    assert not queues.take(notification(1, 7), 0)  # nothing is being requested
    opening = queues.opened(handle(), 1, 2)
    next(opening)
    for port, number in ((1, 7), (2, 7), (1, 8)):
        assert queues.take(notification(port, number), 0)
    with pytest.raises(StopIteration) as ended:
        opening.send([])
    queue = ended.value.value
    assert [each.handle for each in queue.samples] == [7]
    assert not queues.take(notification(1, 8), 0)
    assert queues.take(notification(1, 7), 0)
    queues.remove(queue)
    assert not queues.take(notification(1, 7), 0)
    assert len(queue.samples) == 2


def test_a_notification_is_closed_again_after_a_failure() -> None:
    servo = Servo(protocols=[Ads(areas={GROUP: b"abcdefgh"})])
    with MainDevice(Segment([Coupler(), servo])) as main:
        sub = main.scan()[1]
        arm = cat.Drives([sub], counts_per_turn=2**20, velocity_limit=10.0)
        changes = sub.aoe.subscribe(GROUP, 0, 1)
        with cat.Loop(arm, period=1e-3), pytest.raises(RuntimeError):
            changes.close()
        assert not changes.ended
        changes.close()
        assert changes.ended


@pytest.mark.parametrize("timeout", [-1.0, float("nan"), float("inf")])
def test_invalid_timeouts(sub: SubDevice, timeout: float) -> None:
    with pytest.raises(ValueError, match="timeout must be"):
        sub.aoe.read(GROUP, 0, 1, timeout=timeout)
    with sub.aoe.subscribe(GROUP, 0, 1) as changes, pytest.raises(ValueError, match="timeout"):
        changes.wait(timeout)


def test_requests_while_a_loop_runs() -> None:
    servo = Servo(protocols=[Ads(areas={GROUP: b"abcdefgh", LONG: CONTENT})])
    with MainDevice(Segment([Coupler(), servo])) as main:
        sub = main.scan()[1]
        arm = cat.Drives([sub], counts_per_turn=2**20, velocity_limit=10.0)
        with cat.Loop(arm, period=1e-3) as loop:
            read = sub.aoe.request(LONG, 0, 1000)
            written = sub.aoe.request_write(GROUP, 0, b"XY")
            both = sub.aoe.request_read_write(GROUP, 0, 4, b"Z")
            for _ in loop:
                if read.done and written.done and both.done:
                    break
            assert read.result() == CONTENT
            assert both.result() == b"ZYcd"
            with pytest.raises(RuntimeError):
                sub.aoe.read(GROUP, 0, 1)


def test_notifications_while_a_loop_runs() -> None:
    servo = Servo(protocols=[Ads(areas={GROUP: b"abcdefgh"})])
    with MainDevice(Segment([Coupler(), servo])) as main:
        sub = main.scan()[1]
        arm = cat.Drives([sub], counts_per_turn=2**20, velocity_limit=10.0)
        changes = sub.aoe.subscribe(GROUP, 0, 1, period=0.01, on_change=False)
        found: list[Sample] = []
        with cat.Loop(arm, period=1e-3) as loop:
            for _ in loop:
                found += changes.take()
                if len(found) >= 5:
                    break
        assert {each.data for each in found} == {b"a"}
        changes.close()


def test_a_subscriber_does_not_use_invalid_messages(sub: SubDevice) -> None:
    changes = sub.aoe.subscribe(GROUP, 0, 1, period=0.05)
    channel = sub.channel
    assert channel is not None
    take = channel.subscribers[Type.AOE]
    assert not take(Mailbox(Type.AOE, b"short"), 0)
    assert not take(
        Mailbox(Type.AOE, sub.aoe._known_peer().message(WriteControl(1), 1).encode()), 0
    )
    changes.close()
