"""SDO transfers and other mailbox messages of one device."""

from __future__ import annotations

import struct

import pytest

from catenary.capture.contents import Content
from catenary.capture.mailbox_contents import (
    EmergencyReceived,
    MailboxFault,
    MailboxMessage,
    SdoInformationRead,
    SdoTransfer,
)
from catenary.wire import aoe
from catenary.wire.coe import (
    Abort,
    DownloadRequest,
    DownloadResponse,
    DownloadSegment,
    DownloadSegmentResponse,
    Emergency,
    UploadRequest,
    UploadResponse,
    UploadSegment,
    UploadSegmentRequest,
)
from catenary.wire.mailbox import ErrorReply, Type
from catenary.wire.sdo_information import ListType, Opcode, SdoInformation, list_request
from catenary.wire.voe import VoeMessage
from tests.capture.made import IN, MAILBOX_SIZE, Conversation

LONG = bytes(range(30))
HERE = aoe.Address(bytes(6), 0xFFFF)
READ = aoe.Message(HERE, HERE, aoe.Command.READ, bytes(12), 7)
PART = aoe.Fragment(HERE, HERE, 1, 3, b"ab")


@pytest.fixture
def made() -> Conversation:
    conversation = Conversation()
    conversation.mailboxes()
    return conversation


def messages(made: Conversation) -> list[Content]:
    """Return the contents after the configuration of the mailboxes."""
    return made.contents()[2:]


def test_expedited_write(made: Conversation) -> None:
    made.request(DownloadRequest(0x1C12, 1, b"\x01\x16", 2, expedited=True))
    made.read(IN, bytes(MAILBOX_SIZE), counter=0)  # nothing there yet
    made.response(DownloadResponse(0x1C12, 1))
    [found] = messages(made)
    assert found == SdoTransfer(True, 0x1C12, 1, b"\x01\x16", duration_ns=2_000_000)
    assert str(found) == "write 0x1C12:01 = 0x1601"


def test_aborted_write(made: Conversation) -> None:
    made.request(DownloadRequest(0x6060, 0, b"\x08", 1, expedited=True))
    made.response(Abort(0x6060, 0, 0x06090030))
    [found] = messages(made)
    assert isinstance(found, SdoTransfer)
    assert (found.abort, found.data, found.succeeded) == (0x06090030, b"\x08", False)
    assert str(found) == (
        "write 0x6060:00 = 0x08 aborted: 0x06090030 Value range of parameter exceeded"
    )


def test_segmented_write(made: Conversation) -> None:
    made.request(DownloadRequest(0x2000, 0, LONG[:10], 30))
    made.response(DownloadResponse(0x2000, 0))
    made.request(DownloadSegment(False, False, LONG[10:20]))
    made.response(DownloadSegmentResponse(False))
    made.request(DownloadSegment(True, True, LONG[20:]))
    made.response(DownloadSegmentResponse(True))
    [found] = messages(made)
    assert isinstance(found, SdoTransfer)
    assert (found.writes, found.data, found.segments) == (True, LONG, 2)


def test_a_write_with_a_segment_that_was_not_captured(made: Conversation) -> None:
    made.request(DownloadRequest(0x2000, 0, LONG[:10], 30))
    made.response(DownloadResponse(0x2000, 0))
    made.request(DownloadSegment(True, True, LONG[20:]))
    made.response(DownloadSegmentResponse(True))
    [found] = messages(made)
    assert isinstance(found, SdoTransfer)
    assert not found.succeeded  # its value is not known


def test_segmented_read_and_complete_access(made: Conversation) -> None:
    made.request(UploadRequest(0x1600, 0, complete_access=True))
    made.response(UploadResponse(0x1600, 0, LONG[:12], 30, complete_access=True))
    made.request(UploadSegmentRequest(False))
    made.response(UploadSegment(False, False, LONG[12:20]))
    made.request(UploadSegmentRequest(True))
    made.response(UploadSegment(True, True, LONG[20:]))
    [found] = messages(made)
    assert isinstance(found, SdoTransfer)
    assert (found.writes, found.data, found.complete_access) == (False, LONG, True)


def test_a_repeated_answer_counts_once(made: Conversation) -> None:
    made.request(UploadRequest(0x1000, 0))
    made.response(UploadResponse(0x1000, 0, b"\x92\x01\x02\x00", 4, expedited=True))
    made.packets += made.packets[-2:]
    made.request(UploadRequest(0x1001, 0))
    made.response(UploadResponse(0x1001, 0, b"\x00", 1, expedited=True))
    found = messages(made)
    assert [each.index for each in found if isinstance(each, SdoTransfer)] == [0x1000, 0x1001]


def test_missing_answers_are_shown(made: Conversation) -> None:
    made.request(UploadRequest(0x1000, 0))
    made.request(DownloadRequest(0x1C12, 0, b"\x00", 1, expedited=True))
    first, second = messages(made)
    assert str(first) == "read 0x1000:00 not answered"
    assert str(second) == "write 0x1C12:00 = 0x00 not answered"


@pytest.mark.parametrize(
    "late",
    [
        UploadResponse(0x1008, 0, b"EL", 2, expedited=True),
        DownloadResponse(0x6060, 0),
        Abort(0x1008, 0, 0x06090030),
    ],
)
def test_a_late_answer_does_not_belong_to_the_next_request(
    made: Conversation, late: UploadResponse | DownloadResponse | Abort
) -> None:
    made.request(UploadRequest(0x1008, 0))
    made.request(UploadRequest(0x6060, 0))
    made.response(late)
    made.response(UploadResponse(0x6060, 0, b"\x08", 1, expedited=True))
    first, second = messages(made)
    assert str(first) == "read 0x1008:00 not answered"
    assert str(second) == "read 0x6060:00 = 0x08"


def test_a_full_mailbox_takes_no_message(made: Conversation) -> None:
    """The master repeats the request; it is one transfer."""
    made.request(UploadRequest(0x1000, 0))
    last = made.packets.pop()
    made.packets.append(type(last)(last.time_ns, last.data[:-2] + b"\x00\x00"))
    made.request(UploadRequest(0x1000, 0))
    made.response(UploadResponse(0x1000, 0, b"\x01", 1, expedited=True))
    assert len(messages(made)) == 1


def test_sdo_information(made: Conversation) -> None:
    made.request(list_request(ListType.ALL))
    made.response(SdoInformation(Opcode.LIST_RESPONSE, b"\x01\x00\x00\x10", 1, incomplete=True))
    made.response(SdoInformation(Opcode.LIST_RESPONSE, b"\x18\x10"))
    assert messages(made) == [SdoInformationRead(Opcode.LIST_REQUEST, 1, size=6)]


def test_an_emergency_between_request_and_answer(made: Conversation) -> None:
    made.request(UploadRequest(0x1001, 0))
    made.response(Emergency(0x8611, 0x21, b"12345"))
    made.response(UploadResponse(0x1001, 0, b"\x21", 1, expedited=True))
    first, second = messages(made)
    assert first == EmergencyReceived(0x8611, 0x21, b"12345")
    assert isinstance(second, SdoTransfer)
    assert second.succeeded


@pytest.mark.parametrize(
    ("kind", "data", "text"),
    [
        (Type.FOE, b"\x02\x00\x00\x00\x00\x00app.efw\x00", "FoE write request 'app.efw'"),
        (Type.FOE, b"\x05\x00\x02\x80\x00\x00", "FoE error 0x8002: access denied"),
        (Type.FOE, b"\x05\x00\x01\x80\x00\x00app", "FoE error 0x8001: file not found (app)"),
        (Type.FOE, b"\x03\x00\x07\x00\x00\x00abcd", "FoE data 7, 4 bytes"),
        (Type.FOE, b"\x04\x00\x07\x00\x00\x00", "FoE acknowledge 7"),
        (Type.FOE, b"\x06\x00\x05\x00\x64\x00", "FoE busy 5/100"),
        (Type.FOE, b"\x09\x00\x00\x00\x00\x00", "FoE service 9"),
        (Type.SOE, struct.pack("<BBH", 0x23, 0x40, 0x8001), "SoE write request P-0-0001 drive 1"),
        (Type.EOE, b"\x00\x01\x00\x00", "EoE frame fragment"),
        (Type.AOE, b"\x00" * 8, "AoE"),
        (Type.AOE, READ.encode(), "AoE read request 7 at port 65535"),
        (Type.AOE, READ.answered(bytes(8)).encode(), "AoE read response 7, 8 bytes"),
        (Type.AOE, READ.answered(b"", 6).encode(), "AoE read response 7, 0 bytes, error 0x0006"),
        (Type.AOE, aoe.Message(HERE, HERE, 8).encode(), "AoE notification at port 65535, 0 bytes"),
        (Type.AOE, PART.encode(), "AoE fragment 3, 2 bytes"),
        (Type.AOE, PART.acknowledge().encode(), "AoE acknowledge fragment 3, 0 bytes"),
        (Type.VOE, VoeMessage(0x1B9, 5, b"abc").encode(), "VoE vendor 0x1B9 type 5, 3 bytes"),
        (Type.VOE, b"abc", "VoE"),
    ],
)
def test_other_protocols_are_named(made: Conversation, kind: Type, data: bytes, text: str) -> None:
    made.request(data, kind)
    [found] = messages(made)
    assert found == MailboxMessage(kind, True, len(data), found.text)  # type: ignore[union-attr]
    assert str(found) == f"{text} to the device"


def test_a_refused_message(made: Conversation) -> None:
    made.response(ErrorReply(2).encode(), Type.ERROR)
    assert messages(made) == [MailboxFault(2)]


def test_coe_is_found_without_the_sync_managers() -> None:
    """The capture begins after the configuration of the mailboxes."""
    made = Conversation()
    made.request(UploadRequest(0x1018, 1))
    made.response(UploadResponse(0x1018, 1, b"\x02\x00\x00\x00", 4, expedited=True))
    [found] = made.contents()
    assert isinstance(found, SdoTransfer)
    assert found.data == b"\x02\x00\x00\x00"
