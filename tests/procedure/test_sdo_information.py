"""SDO information with simulated answers."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from catenary.errors import ResponseTimeout, SdoAbort
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
from tests.procedure.player import MailboxDevice, channel, coe, play

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
def test_fragments_of_a_list_arrive_without_requests(size: int) -> None:
    indices = tuple(range(0x1000, 0x1040))
    data = ObjectList(ListType.ALL, indices).encode()
    device = answering(lambda _: in_parts(Opcode.LIST_RESPONSE, data, size))
    assert play(read_object_list(channel()), device) == (indices, "")
    assert len(device.received) == 2  # the list, and the number of objects


def dictionary(request: SdoInformation) -> list[SdoInformation]:
    """A variable 0x1000 and an array 0x2000 with a gap."""
    index = int.from_bytes(request.data[:2], "little")
    if request.opcode is Opcode.LIST_REQUEST and index == ListType.LENGTHS:
        lengths = ObjectList(ListType.LENGTHS, (3, 0, 0, 0, 0)).encode()
        return [SdoInformation(Opcode.LIST_RESPONSE, lengths)]
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


def test_listed_objects_that_do_not_exist_are_omitted() -> None:
    found, notes = play(list_objects(channel()), answering(dictionary))
    assert [(each.index, each.name) for each in found] == [
        (0x1000, "object 1000"),
        (0x2000, "object 2000"),
    ]
    assert len(notes) == 1
    assert notes[0].startswith("0x3000 cannot be described: refused with 0x06020000")


def test_an_array_with_a_gap_is_described_without_it() -> None:
    found = play(describe_object(channel(), 0x2000), answering(dictionary))
    assert [(each.subindex, each.name) for each in found.entries] == [
        (0, "entry 0"),
        (1, "entry 1"),
        (3, "entry 3"),
    ]


def test_a_missing_object_is_reported() -> None:
    with pytest.raises(SdoAbort, match=r"device 3 .*SDO information of 0x3000:00.*not exist"):
        play(describe_object(channel(), 0x3000), answering(dictionary))


def test_a_late_answer_about_another_entry_is_dropped() -> None:
    mailbox = channel()
    device = answering(dictionary)
    late = EntryDescription(0x1000, 0, ValueInfo.NONE, 5, 8, Access.READ_PRE_OP, b"late")

    def late_first(message: Mailbox) -> list[Mailbox]:
        request = decode_coe(message.data)
        assert isinstance(request, SdoInformation)
        first = SdoInformation(Opcode.ENTRY_RESPONSE, late.encode())
        return [coe(part) for part in (first, *dictionary(request))]

    device.respond = late_first
    assert play(read_entry_description(mailbox, 0x2000, 1), device).name == "entry 1"
    assert mailbox.dropped == 1


def test_endless_fragments_are_truncated_with_a_note() -> None:
    endless = [SdoInformation(Opcode.LIST_RESPONSE, b"\x01\x00" * 50, 7, True)] * 2000
    indices, note = play(read_object_list(channel()), answering(lambda _: endless))
    assert len(indices) > 10_000
    assert note == "the list of objects is truncated: its fragments do not end"


def test_fragments_before_an_interruption_are_kept() -> None:
    first = in_parts(Opcode.LIST_RESPONSE, ObjectList(ListType.ALL, (0x1000,) * 50).encode(), 10)
    indices, note = play(read_object_list(channel()), answering(lambda _: first[:3]))
    assert indices == (0x1000,) * 14
    assert note.startswith("the list of objects is truncated: no answer to a COE message")


def test_a_list_may_announce_fragments_only_by_number() -> None:
    """IgH (fsm_coe.c) continues if either field announces fragments."""
    parts = in_parts(Opcode.LIST_RESPONSE, ObjectList(ListType.ALL, (0x1000,) * 9).encode(), 10)
    plain = [SdoInformation(part.opcode, part.data, part.fragments_left) for part in parts]
    assert play(read_object_list(channel()), answering(lambda _: plain)).indices == (0x1000,) * 9


def test_a_list_shorter_than_the_reported_number_has_a_note() -> None:
    def short(request: SdoInformation) -> list[SdoInformation]:
        listed = request.data[0] == ListType.ALL
        found = ObjectList(ListType(request.data[0]), (0x1000,) if listed else (57, 0, 0, 0, 0))
        return [SdoInformation(Opcode.LIST_RESPONSE, found.encode())]

    indices, note = play(read_object_list(channel()), answering(short))
    assert indices == (0x1000,)
    assert note == "the list of objects is truncated: it contains 1 of 57"


@pytest.mark.parametrize("data", [b"", b"\x01", b"\x00\x10\x01"])
def test_an_incomplete_index_at_the_end_has_a_note(data: bytes) -> None:
    device = answering(lambda _: [SdoInformation(Opcode.LIST_RESPONSE, b"\x01\x00" + data)])
    indices, note = play(read_object_list(channel()), device)
    assert indices == ((0x1000,) if len(data) > 1 else ())
    assert bool(note) is (len(data) % 2 == 1)
    assert not note or "are not a whole number of indices" in note


def test_a_list_without_its_kind_is_not_an_answer() -> None:
    device = answering(lambda _: [SdoInformation(Opcode.LIST_RESPONSE, b"\x01")])
    with pytest.raises(ResponseTimeout, match="device 3"):
        play(read_object_list(channel()), device)


@pytest.mark.parametrize("size", [0, 3])
def test_an_abort_without_a_code_is_a_refusal(size: int) -> None:
    device = answering(lambda _: [SdoInformation(Opcode.ERROR, bytes(size))])
    with pytest.raises(SdoAbort, match=r"device 3 .*0x3000:00 refused without an abort code"):
        play(describe_object(channel(), 0x3000), device)


def undescribed(*broken: int) -> Callable[[SdoInformation], list[SdoInformation]]:
    """Objects 0x1000 to 0x1009, some of them with descriptions that are too short."""
    indices = tuple(range(0x1000, 0x100A))

    def answer(request: SdoInformation) -> list[SdoInformation]:
        index = int.from_bytes(request.data[:2], "little")
        if request.opcode is Opcode.LIST_REQUEST:
            found = ObjectList(ListType(index), indices if index else (10, 0, 0, 0, 0))
            return [SdoInformation(Opcode.LIST_RESPONSE, found.encode())]
        whole = ObjectDescription(index, 7, 0, ObjectCode.VAR, "name").encode()
        return [SdoInformation(Opcode.OBJECT_RESPONSE, whole[:2] if index in broken else whole)]

    return answer


def test_an_undescribed_object_keeps_its_index() -> None:
    found, notes = play(list_objects(channel()), answering(undescribed(0x1003, 0x1005)))
    assert [each.index for each in found] == list(range(0x1000, 0x100A))
    assert [each.index for each in found if not each.object_code] == [0x1003, 0x1005]
    assert len(notes) == 1
    assert notes[0].startswith("0x1003, 0x1005 cannot be described: invalid SDO information")


def test_requests_end_after_three_failures_in_a_row() -> None:
    device = answering(undescribed(*range(0x1002, 0x100A)))
    found, notes = play(list_objects(channel()), device)
    assert len(found) == 10
    assert len(device.received) == 2 + 5
    assert notes[-1] == "requests ended after 3 failures in a row"
