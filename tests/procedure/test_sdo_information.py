"""SDO information against answers given by hand."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from catenary.errors import MailboxError, ResponseTimeout, SdoAbort
from catenary.procedure.sdo_information import (
    describe_object,
    list_objects,
    read_entry_description,
    read_object_list,
)
from catenary.wire.coe import decode_coe
from catenary.wire.mailbox import Mailbox
from catenary.wire.sdo_information import (
    Access,
    EntryDescription,
    ListType,
    ObjectCode,
    ObjectDescription,
    ObjectList,
    Opcode,
    SdoInformation,
    ValueInfo,
)
from tests.procedure.by_hand import MailboxDevice, channel, coe, play

NO_OBJECT, NO_SUBINDEX = 0x0602_0000, 0x0609_0011


def answering(respond: Callable[[SdoInformation], list[SdoInformation]]) -> MailboxDevice:
    def answer(message: Mailbox) -> list[Mailbox]:
        request = decode_coe(message.data)
        assert isinstance(request, SdoInformation)
        return [coe(part) for part in respond(request)]

    return MailboxDevice(answer)


def error(code: int) -> SdoInformation:
    return SdoInformation(Opcode.ERROR, code.to_bytes(4, "little"))


def in_parts(opcode: Opcode, data: bytes, size: int) -> list[SdoInformation]:
    parts = [data[k : k + size] for k in range(0, len(data), size)]
    left = range(len(parts) - 1, -1, -1)
    return [SdoInformation(opcode, p, k, k > 0) for p, k in zip(parts, left, strict=True)]


@pytest.mark.parametrize("size", [2, 3, 10, 110])
def test_a_list_comes_in_fragments_that_nobody_asks_for(size: int) -> None:
    indices = tuple(range(0x1000, 0x1040))
    data = ObjectList(ListType.ALL, indices).encode()
    device = answering(lambda _: in_parts(Opcode.LIST_RESPONSE, data, size))
    assert play(read_object_list(channel()), device) == indices
    assert len(device.received) == 1


def dictionary(request: SdoInformation) -> list[SdoInformation]:
    """A variable 0x1000 and an array 0x2000 with a gap."""
    index = int.from_bytes(request.data[:2], "little")
    if request.opcode is Opcode.LIST_REQUEST:
        listed = ObjectList(ListType.ALL, (0x1000, 0x2000, 0x3000)).encode()
        return [SdoInformation(Opcode.LIST_RESPONSE, listed)]
    if request.opcode is Opcode.OBJECT_REQUEST:
        if index == 0x3000:
            return [error(NO_OBJECT)]
        code, last = (ObjectCode.VAR, 0) if index == 0x1000 else (ObjectCode.ARRAY, 3)
        found = ObjectDescription(index, 7, last, code, f"object {index:X}")
        return [SdoInformation(Opcode.OBJECT_RESPONSE, found.encode())]
    subindex = request.data[2]
    if subindex == 2:
        return [error(NO_SUBINDEX)]
    name = f"entry {subindex}".encode()
    entry = EntryDescription(index, subindex, ValueInfo.NONE, 7, 32, Access.READ_PRE_OP, name)
    return [SdoInformation(Opcode.ENTRY_RESPONSE, entry.encode())]


def test_objects_that_are_listed_and_denied_are_left_out() -> None:
    found = play(list_objects(channel()), answering(dictionary))
    assert [(each.index, each.name) for each in found] == [
        (0x1000, "object 1000"),
        (0x2000, "object 2000"),
    ]


def test_an_array_with_a_gap_is_described_without_it() -> None:
    found = play(describe_object(channel(), 0x2000), answering(dictionary))
    assert [(each.subindex, each.name) for each in found.entries] == [
        (0, "entry 0"),
        (1, "entry 1"),
        (3, "entry 3"),
    ]


def test_what_is_not_there_is_named() -> None:
    with pytest.raises(SdoAbort, match=r"device 3 .*SDO information of 0x3000:00.*not exist"):
        play(describe_object(channel(), 0x3000), answering(dictionary))


def test_a_late_answer_about_another_entry_is_not_taken() -> None:
    lane = channel()
    device = answering(dictionary)
    late = EntryDescription(0x1000, 0, ValueInfo.NONE, 5, 8, Access.READ_PRE_OP, b"late")

    def late_first(message: Mailbox) -> list[Mailbox]:
        request = decode_coe(message.data)
        assert isinstance(request, SdoInformation)
        first = SdoInformation(Opcode.ENTRY_RESPONSE, late.encode())
        return [coe(part) for part in (first, *dictionary(request))]

    device.respond = late_first
    assert play(read_entry_description(lane, 0x2000, 1), device).name == "entry 1"
    assert lane.dropped == 1


def test_fragments_without_an_end_are_an_error() -> None:
    endless = [SdoInformation(Opcode.LIST_RESPONSE, b"\x01\x00" * 50, 7, True)] * 2000
    with pytest.raises(MailboxError, match="without an end"):
        play(read_object_list(channel()), answering(lambda _: endless))


def test_fragments_that_stop_are_a_timeout() -> None:
    first = in_parts(Opcode.LIST_RESPONSE, bytes(100), 10)[:3]
    with pytest.raises(ResponseTimeout, match=r"device 3 \(Probe\): no answer"):
        play(read_object_list(channel()), answering(lambda _: first))


@pytest.mark.parametrize("data", [b"", b"\x01", b"\x01\x00\x00"])
def test_an_answer_that_is_none_is_the_devices_fault(data: bytes) -> None:
    device = answering(lambda _: [SdoInformation(Opcode.LIST_RESPONSE, b"\x01\x00" + data)])
    if len(data) % 2 == 0:
        assert play(read_object_list(channel()), device) == ()
        return
    with pytest.raises(MailboxError, match="answer of SDO information that is none"):
        play(read_object_list(channel()), device)
