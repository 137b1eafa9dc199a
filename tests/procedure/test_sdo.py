"""SDO services with a simulated dictionary."""

from __future__ import annotations

import pytest

from catenary.errors import MailboxError, SdoAbort
from catenary.procedure.sdo import download, upload
from catenary.wire.coe import (
    Abort,
    Emergency,
    UploadRequest,
    UploadSegment,
    UploadSegmentRequest,
    decode_coe,
)
from catenary.wire.mailbox import ErrorReply, Mailbox, Type
from tests.procedure.player import Dictionary, MailboxDevice, channel, coe, play


@pytest.mark.parametrize("size", [1, 2, 3, 4, 5, 112, 113, 300, 5000])
def test_uploads_of_all_sizes(size: int) -> None:
    data = bytes(i & 0xFF for i in range(size))
    device = MailboxDevice(Dictionary({(0x2000, 7): data}))
    assert play(upload(channel(), 0x2000, 7), device) == data


@pytest.mark.parametrize("size", [1, 2, 3, 4, 5, 112, 113, 300, 5000])
def test_downloads_of_all_sizes(size: int) -> None:
    data = bytes(i & 0xFF for i in range(size))
    dictionary = Dictionary({})
    play(download(channel(), 0x2000, 7, data), MailboxDevice(dictionary))
    assert dictionary.written == [(0x2000, 7, data)]


def test_an_abort_names_device_object_and_reason() -> None:
    with pytest.raises(SdoAbort, match=r"Probe.*0x2001:00.*does not exist") as caught:
        play(upload(channel(), 0x2001, 0), MailboxDevice(Dictionary({})))
    assert (caught.value.position, caught.value.index, caught.value.code) == (
        3,
        0x2001,
        0x0602_0000,
    )


def test_a_mailbox_error_has_a_text() -> None:
    device = MailboxDevice(lambda _: [Mailbox(Type.ERROR, ErrorReply(2).encode())])
    with pytest.raises(MailboxError, match="protocol is not supported"):
        play(upload(channel(), 0x1000, 0), device)


@pytest.mark.parametrize("data", [b"", b"\x01\x00", b"\x02\x00\x02\x00"])
def test_a_malformed_mailbox_error_names_its_device(data: bytes) -> None:
    device = MailboxDevice(lambda _: [Mailbox(Type.ERROR, data)])
    with pytest.raises(MailboxError, match=r"device 3 \(Probe\).*mailbox error without a valid"):
        play(upload(channel(), 0x1000, 0), device)


def test_an_emergency_before_the_answer_is_stored() -> None:
    emergency = Emergency(0x7500, 0x11, b"\x01\x02\x03\x04\x05")
    dictionary = Dictionary({(0x1000, 0): b"\x92\x01\x02\x00"})
    device = MailboxDevice(lambda message: [coe(emergency), *dictionary(message)])
    mailbox = channel()
    assert play(upload(mailbox, 0x1000, 0), device) == b"\x92\x01\x02\x00"
    assert [received.emergency for received in mailbox.emergencies] == [emergency]
    assert mailbox.dropped == 0


def test_a_late_answer_to_another_request_is_dropped() -> None:
    dictionary = Dictionary({(0x1000, 0): b"\x01", (0x1001, 0): b"\x02"})
    late = Dictionary({(0x1000, 0): b"\x01"})
    mailbox = channel()
    device = MailboxDevice(dictionary)
    for answer in late(Mailbox(Type.COE, UploadRequest(0x1000, 0).encode())):
        device.send(answer)
    assert play(upload(mailbox, 0x1001, 0), device) == b"\x02"
    assert mailbox.dropped == 1


def test_a_wrong_toggle_is_aborted() -> None:
    dictionary = Dictionary({(0x2000, 0): bytes(500)})

    def respond(message: Mailbox) -> list[Mailbox]:
        if isinstance(decode_coe(message.data), UploadSegmentRequest):
            return [coe(UploadSegment(True, False, bytes(100)))]
        return dictionary(message)

    device = MailboxDevice(respond)
    with pytest.raises(MailboxError, match="Toggle bit not changed"):
        play(upload(channel(), 0x2000, 0), device)
    assert decode_coe(device.received[-1].data) == Abort(0x2000, 0, 0x0503_0000)


def test_segments_beyond_the_announced_size_are_aborted() -> None:
    dictionary = Dictionary({(0x2000, 0): bytes(200)})

    def respond(message: Mailbox) -> list[Mailbox]:
        request = decode_coe(message.data)
        if isinstance(request, UploadSegmentRequest):
            return [coe(UploadSegment(request.toggle, False, bytes(100)))]
        return dictionary(message)

    with pytest.raises(MailboxError, match="violates the protocol"):
        play(upload(channel(), 0x2000, 0), MailboxDevice(respond))


def test_an_object_beyond_the_limit_is_aborted_at_once() -> None:
    dictionary = Dictionary({(0x2000, 0): bytes(5000)})
    device = MailboxDevice(dictionary)
    with pytest.raises(MailboxError, match="announces 5000 bytes, the limit is 4999"):
        play(upload(channel(), 0x2000, 0, limit=4999), device)
    assert decode_coe(device.received[-1].data) == Abort(0x2000, 0, 0x0504_0005)
    assert len(device.received) == 2
    assert play(upload(channel(), 0x2000, 0, limit=5000), device) == bytes(5000)


def dripping(segment: bytes) -> MailboxDevice:
    """Return a device that announces 1000 bytes of 0x2000:00 and repeats one segment endlessly."""
    dictionary = Dictionary({(0x2000, 0): bytes(1000)})

    def answer(message: Mailbox) -> list[Mailbox]:
        request = decode_coe(message.data)
        if isinstance(request, UploadSegmentRequest):
            return [coe(UploadSegment(request.toggle, False, segment))]
        return dictionary(message)

    return MailboxDevice(answer)


def test_an_endless_upload_is_limited_by_the_announced_size() -> None:
    device = dripping(b"x")
    with pytest.raises(MailboxError, match="violates the protocol"):
        play(upload(channel(), 0x2000, 0), device)
    assert len(device.received) <= 1000


def test_an_upload_has_an_overall_deadline() -> None:
    device = dripping(b"x")
    with pytest.raises(MailboxError, match=r"2000:00: received \d+ of 1000 bytes within 0.05 s"):
        play(upload(channel(), 0x2000, 0, timeout=0.05), device)
    assert decode_coe(device.received[-1].data) == Abort(0x2000, 0, 0x0504_0000)
    assert len(device.received) < 500


def test_empty_segments_are_an_error() -> None:
    with pytest.raises(MailboxError, match="violates the protocol"):
        play(upload(channel(), 0x2000, 0), dripping(b""))


def test_complete_access_in_both_directions() -> None:
    seen: list[object] = []
    dictionary = Dictionary({(0x1C12, 0): b"\x02\x00\x00\x16\x01\x16"})

    def watched(message: Mailbox) -> list[Mailbox]:
        seen.append(decode_coe(message.data))
        return dictionary(message)

    device, mailbox = MailboxDevice(watched), channel()
    data = play(upload(mailbox, 0x1C12, 0, complete_access=True), device)
    play(download(mailbox, 0x1C12, 0, data, complete_access=True), device)
    assert dictionary.written == [(0x1C12, 0, data)]
    assert [message.complete_access for message in seen] == [True, True]  # type: ignore[attr-defined]
