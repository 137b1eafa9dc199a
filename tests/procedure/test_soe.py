"""SoE with a simulated server: fragments, refusals, violations, lost frames."""

from __future__ import annotations

from functools import partial

import pytest

from catenary.errors import MailboxError, ResponseTimeout, SoeError
from catenary.procedure.mailbox import drain
from catenary.procedure.soe import SIZE_MAX, Target, read, write
from catenary.wire.mailbox import ErrorReply, Mailbox, Type
from catenary.wire.soe import Element, Message, OpCode, decode_soe
from tests.procedure.drives import (
    ROOM,
    Drive,
    device,
    fragments,
    refusal,
    refuse_with,
    target,
)
from tests.procedure.player import MailboxDevice, channel, play

SIZES = [0, 1, ROOM - 1, ROOM, ROOM + 1, 2 * ROOM, 20 * ROOM + 7]


def content(size: int) -> bytes:
    return bytes(k * 13 & 0xFF for k in range(size))


@pytest.mark.parametrize("size", SIZES)
def test_a_read_of_any_size(size: int) -> None:
    drive = Drive({(47, Element.VALUE): content(size)})
    assert play(read(target()), MailboxDevice(drive)) == content(size)


@pytest.mark.parametrize("size", SIZES)
def test_a_write_of_any_size(size: int) -> None:
    drive = Drive()
    assert play(write(target(), content(size)), MailboxDevice(drive)) is None
    assert drive.elements == {(47, Element.VALUE): content(size)}
    count = max(1, -(-size // ROOM))
    numbers = [*range(count - 1, 0, -1), 47]
    assert [each.number for each in drive.requests] == numbers
    assert [each.incomplete for each in drive.requests] == [True] * (count - 1) + [False]


def test_a_fragment_whose_frame_is_lost_is_sent_again() -> None:
    drive = Drive()
    box = MailboxDevice(drive)
    box.lose_out, box.lose_back = {1}, {4}
    assert play(write(target(), content(5 * ROOM)), box) is None
    assert drive.elements == {(47, Element.VALUE): content(5 * ROOM)}


@pytest.mark.parametrize("lost", [{1}, {0, 3}, {4}, {5}])
def test_a_device_that_does_not_recognise_repetitions(lost: set[int]) -> None:
    """It stores a fragment twice, so all fragments are written again."""
    drive = Drive()
    box = MailboxDevice(drive)
    box.deduplicates = False
    box.lose_back = lost
    assert play(write(target(), content(5 * ROOM)), box) is None
    assert drive.elements == {(47, Element.VALUE): content(5 * ROOM)}


def test_a_refusal_because_of_a_repeated_fragment_is_not_reported() -> None:
    drive = Drive()

    def answer(message: Mailbox) -> list[Mailbox]:
        answers = drive(message)
        stored = drive.elements.get((47, Element.VALUE), b"")
        if answers and len(stored) != 5 * ROOM:
            return [
                Mailbox(Type.SOE, each.encode()) for each in refusal(drive.requests[-1], 0x7003)
            ]
        return answers

    box = MailboxDevice(answer)
    box.deduplicates = False
    box.lose_back = {1}
    assert play(write(target(), content(5 * ROOM)), box) is None
    assert drive.elements == {(47, Element.VALUE): content(5 * ROOM)}


def test_a_line_that_loses_each_written_fragment_is_reported() -> None:
    box = MailboxDevice(Drive())
    box.lose_out = set(range(200))
    with pytest.raises(ResponseTimeout, match="lost in 5 attempts"):
        play(write(target(), content(5 * ROOM)), box)
    assert box.received == []


def test_after_a_lost_fragment_the_request_is_repeated() -> None:
    box = MailboxDevice(Drive({(47, Element.VALUE): content(5 * ROOM)}))
    box.lose_back = {3, 9}
    assert play(read(target()), box) == content(5 * ROOM)


def test_a_line_that_loses_each_answer_is_reported() -> None:
    box = MailboxDevice(Drive({(47, Element.VALUE): content(5 * ROOM)}))
    box.lose_back = set(range(2, 200, 4))
    with pytest.raises(ResponseTimeout, match="lost in 5 attempts"):
        play(read(target()), box)


@pytest.mark.parametrize("code", [0x1001, 0x7005, 0xBEEF])
def test_a_refusal_names_idn_drive_and_cause(code: int) -> None:
    box = device(partial(refuse_with, code))
    with pytest.raises(
        SoeError, match=rf"S-0-0047 of drive 2: read refused with 0x{code:04X}"
    ) as e:
        play(read(target(drive=2)), box)
    assert (e.value.code, e.value.idn, e.value.drive, e.value.position) == (code, 47, 2, 3)
    with pytest.raises(SoeError, match="write refused"):
        play(write(target(drive=2), b"12"), device(partial(refuse_with, code)))


@pytest.mark.parametrize("with_idn", [True, False])
def test_an_early_refusal_ends_a_write(with_idn: bool) -> None:
    """A drive may refuse the first fragment, because the list is too long.

    The refusal has the IDN, or the number of the fragment.
    """
    seen: list[Message] = []

    def answer(request: Message) -> list[Message]:
        seen.append(request)
        number = 47 if with_idn else request.number
        return [Message(OpCode.WRITE_RESPONSE, number, request.elements, b"\x03\x70", error=True)]

    with pytest.raises(SoeError, match="0x7003: the value is too long"):
        play(write(target(), content(10 * ROOM)), device(answer))
    assert len(seen) == 1


def test_messages_of_other_drives_and_idns_are_not_the_answer() -> None:
    def answer(request: Message) -> list[Message]:
        late = Message(OpCode.READ_RESPONSE, 48, request.elements, b"\x01\x02")
        other = Message(OpCode.READ_RESPONSE, 47, request.elements, b"\x01\x02", drive=1)
        return [late, other, *fragments(request, b"right")]

    assert play(read(target()), device(answer)) == b"right"


@pytest.mark.parametrize(
    "numbers",
    [(3, 1, 0), (2, 3, 0), (5, 5, 4, 2)],
)
def test_fragments_out_of_order_are_refused(numbers: tuple[int, ...]) -> None:
    def answer(request: Message) -> list[Message]:
        kind, elements = OpCode.READ_RESPONSE, request.elements
        parts = [Message(kind, n, elements, b"part", incomplete=True) for n in numbers[:-1]]
        return [*parts, Message(kind, 47, elements, b"end")]

    if numbers == (3, 1, 0) or numbers[:2] == (2, 3):
        with pytest.raises(MailboxError, match="more fragments, then"):
            play(read(target()), device(answer))
    else:
        assert play(read(target()), device(answer)) == b"partpartpartend"


def test_a_constant_number_of_fragments_is_accepted() -> None:
    def answer(request: Message) -> list[Message]:
        kind, elements = OpCode.READ_RESPONSE, request.elements
        parts = [Message(kind, 47, elements, b"part", incomplete=True) for _ in range(3)]
        return [*parts, Message(kind, 47, elements, b"end")]

    assert play(read(target()), device(answer)) == b"partpartpartend"


@pytest.mark.parametrize("data", [b"", bytes(ROOM)])
def test_fragments_without_end_are_refused(data: bytes) -> None:
    box: list[MailboxDevice] = []

    def answer(request: Message) -> list[Message]:
        kind, elements = OpCode.READ_RESPONSE, request.elements
        return [Message(kind, 7, elements, data, incomplete=True)] * (SIZE_MAX // ROOM + 5)

    box.append(device(answer))
    with pytest.raises(MailboxError, match="fragments without end"):
        play(read(target()), box[0], steps=1_000_000)


def test_a_missing_fragment_is_a_timeout() -> None:
    def answer(request: Message) -> list[Message]:
        return [Message(OpCode.READ_RESPONSE, 1, request.elements, b"part", incomplete=True)]

    with pytest.raises(ResponseTimeout, match="no answer to a SOE message"):
        play(read(target()), device(answer))


def test_a_device_without_soe_answers_with_a_mailbox_error() -> None:
    box = MailboxDevice(lambda _: [Mailbox(Type.ERROR, ErrorReply(2).encode())])
    with pytest.raises(MailboxError, match="the protocol is not supported"):
        play(read(target()), box)


@pytest.mark.parametrize("data", [b"", b"\x00\x40\x2f\x00"])
def test_an_invalid_message_is_reported(data: bytes) -> None:
    with pytest.raises(MailboxError, match="invalid SoE message"):
        play(read(target()), MailboxDevice(lambda _: [Mailbox(Type.SOE, data)]))


def test_other_elements_than_requested_are_not_the_answer() -> None:
    """They may be a late answer to an earlier request for the same IDN."""
    late = Message(OpCode.READ_RESPONSE, 47, Element.ATTRIBUTE, b"late")

    def answer(request: Message) -> list[Message]:
        return [late, *fragments(request, b"right")]

    assert play(read(target()), device(answer)) == b"right"
    with pytest.raises(ResponseTimeout, match="1 other messages arrived"):
        play(read(target()), device(lambda _: [late]))


def test_wrong_arguments_are_refused_before_anything_is_sent() -> None:
    for procedure in (
        lambda: read(target(drive=8)),
        lambda: write(target(drive=8), b""),
        lambda: write(target(), bytes(1 << 17)),
    ):
        with pytest.raises(ValueError, match=r"drive|longest list"):
            procedure()


def test_a_notification_reaches_its_subscriber_and_not_the_reader() -> None:
    box_channel, seen = channel(), []

    def subscribe(message: Mailbox, time_ns: int) -> bool:
        seen.append(decode_soe(message.data).op_code)
        return True

    box_channel.subscribers[Type.SOE] = subscribe

    def answer(request: Message) -> list[Message]:
        event = Message(OpCode.NOTIFICATION, 99, Element.STATE, b"\x03\x00")
        return [event, *fragments(request, b"1234"), event]

    box = device(answer)
    assert play(read(Target(box_channel, 47)), box) == b"1234"
    play(drain(box_channel, lambda _: None), box)
    assert seen == [OpCode.NOTIFICATION] * 2
    assert box_channel.dropped == 0
