"""SoE with a simulated server: fragments, refusals, violations, lost frames, commands."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import pytest

from catenary.errors import MailboxError, ResponseTimeout, SoeError
from catenary.procedure.mailbox import drain
from catenary.procedure.sercos import (
    ALL,
    read_parameter,
    read_value,
    run_command,
    write_value,
)
from catenary.procedure.soe import OVERHEAD, SIZE_MAX, Target, read, write
from catenary.wire.mailbox import ErrorReply, Mailbox, Type
from catenary.wire.sercos import Attribute, CommandState, Display, encode_list
from catenary.wire.soe import Element, Message, OpCode, decode_soe
from tests.procedure.player import LAYOUT, MailboxDevice, channel, play

ROOM = LAYOUT.send_size - OVERHEAD
SIZES = [0, 1, ROOM - 1, ROOM, ROOM + 1, 2 * ROOM, 20 * ROOM + 7]
POSITION = Attribute(4, display=Display.SIGNED)
Answer = Callable[[Message], list[Message]]


def content(size: int) -> bytes:
    return bytes(k * 13 & 0xFF for k in range(size))


def fragments(request: Message, data: bytes) -> list[Message]:
    """Return the answer to a read, as many fragments as its size requires."""
    parts = [data[at : at + ROOM] for at in range(0, len(data), ROOM)] or [b""]
    last = len(parts) - 1
    return [
        Message(
            OpCode.READ_RESPONSE,
            request.number if k == last else last - k,
            request.elements,
            part,
            request.drive,
            incomplete=k < last,
        )
        for k, part in enumerate(parts)
    ]


def refusal(request: Message, code: int) -> list[Message]:
    response = OpCode(request.op_code + 1)
    data = code.to_bytes(2, "little")
    return [Message(response, request.number, request.elements, data, request.drive, error=True)]


class Drive:
    """Owner of the elements of IDNs, by number and element."""

    def __init__(self, elements: dict[tuple[int, Element], bytes] | None = None) -> None:
        self.elements = elements or {}
        self.requests: list[Message] = []
        self._written = b""

    def __call__(self, message: Mailbox) -> list[Mailbox]:
        request = decode_soe(message.data)
        self.requests.append(request)
        return [Mailbox(Type.SOE, each.encode()) for each in self.answer(request)]

    def answer(self, request: Message) -> list[Message]:
        if request.op_code is OpCode.WRITE_REQUEST:
            self._written += request.data
            if request.incomplete:
                return []
            self.elements[request.number, request.elements] = self._written
            self._written = b""
            return [Message(OpCode.WRITE_RESPONSE, request.number, request.elements)]
        wanted = [each for each in Element if each in request.elements]
        for each in wanted:
            if (request.number, each) not in self.elements:
                return refusal(request, _missing(each))
        return fragments(request, b"".join(self.elements[request.number, e] for e in wanted))


def _missing(element: Element) -> int:
    number = element.value.bit_length()
    return 0x7014 if element is Element.STATE else 0x1001 if number == 7 else number << 12 | 1


def device(answer: Answer) -> MailboxDevice:
    """Return a device that answers with a function."""

    def respond(message: Mailbox) -> list[Mailbox]:
        request = decode_soe(message.data)
        return [Mailbox(Type.SOE, each.encode()) for each in answer(request)]

    return MailboxDevice(respond)


def target(idn: int = 47, drive: int = 0, timeout: float = 0.1) -> Target:
    return Target(channel(), idn, drive, timeout)


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
    box = device(partial(_refuse, code))
    with pytest.raises(
        SoeError, match=rf"S-0-0047 of drive 2: read refused with 0x{code:04X}"
    ) as e:
        play(read(target(drive=2)), box)
    assert (e.value.code, e.value.idn, e.value.drive, e.value.position) == (code, 47, 2, 3)
    with pytest.raises(SoeError, match="write refused"):
        play(write(target(drive=2), b"12"), device(partial(_refuse, code)))


def _refuse(code: int, request: Message) -> list[Message]:
    return refusal(request, code)


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


# -- parameters ------------------------------------------------------------------------------------

COMPLETE = {
    (47, Element.NAME): encode_list(b"Position command"),
    (47, Element.ATTRIBUTE): POSITION.encode(),
    (47, Element.UNIT): encode_list(b"inc"),
    (47, Element.MINIMUM): (-5).to_bytes(4, "little", signed=True),
    (47, Element.MAXIMUM): (5).to_bytes(4, "little"),
    (47, Element.VALUE): (3).to_bytes(4, "little"),
}


def test_a_parameter_without_some_elements() -> None:
    """Each refusal names one missing element; the others arrive together."""
    drive = Drive(dict(COMPLETE))
    found = play(read_parameter(target(), ALL), MailboxDevice(drive))
    assert (found.idn, found.name, found.unit) == ("S-0-0047", "Position command", "inc")
    assert (found.minimum, found.maximum, found.value) == (-5, 5, 3)
    assert (found.default, found.state) == (None, None)
    assert len(drive.requests) == 3  # the state and the default value are missing


def test_a_drive_that_answers_only_one_element_at_a_time() -> None:
    drive = Drive(dict(COMPLETE))

    def answer(request: Message) -> list[Message]:
        if request.elements.value.bit_count() > 1:
            return refusal(request, 0x800B)
        return drive.answer(request)

    found = play(read_parameter(target(), ALL), device(answer))
    assert (found.name, found.minimum, found.value) == ("Position command", -5, 3)
    assert play(read_value(target()), device(answer)) == 3


def test_an_idn_that_does_not_exist() -> None:
    with pytest.raises(SoeError, match="no such IDN"):
        play(read_parameter(target(), ALL), device(partial(_refuse, 0x1001)))
    with pytest.raises(SoeError, match="no such IDN"):
        play(write_value(target(), 1), device(partial(_refuse, 0x1001)))


@pytest.mark.parametrize("value", [b"", b"123", b"12345", bytes.fromhex("ff00ff00")[:4] * 3])
def test_a_value_that_contradicts_its_attribute(value: bytes) -> None:
    lying = {**COMPLETE, (47, Element.VALUE): value}
    with pytest.raises(MailboxError, match="invalid answer"):
        play(read_value(target()), MailboxDevice(Drive(lying)))


def test_a_list_that_lies_about_its_length() -> None:
    attribute = Attribute(2, is_list=True, display=Display.IDN)
    lying = {
        (47, Element.ATTRIBUTE): attribute.encode(),
        (47, Element.VALUE): bytes.fromhex("ff00ff002f00"),
    }
    with pytest.raises(MailboxError, match="its header states 255 bytes, 2 received"):
        play(read_value(target()), MailboxDevice(Drive(lying)))


def test_a_value_is_written_as_its_attribute_requires() -> None:
    drive = Drive(dict(COMPLETE))
    play(write_value(target(), -2), MailboxDevice(drive))
    assert drive.elements[47, Element.VALUE] == (-2).to_bytes(4, "little", signed=True)
    with pytest.raises(TypeError, match="S-0-0047: a number is needed"):
        play(write_value(target(), "2"), MailboxDevice(drive))


# -- procedure commands ----------------------------------------------------------------------------


class Command(Drive):
    """Owner of one procedure command. `states` are the answers to the readings of its state."""

    def __init__(self, *states: int) -> None:
        super().__init__()
        self.states = list(states)
        self.written: list[bytes] = []

    def answer(self, request: Message) -> list[Message]:
        if request.op_code is OpCode.WRITE_REQUEST:
            self.written.append(request.data)
            return [Message(OpCode.WRITE_RESPONSE, request.number, request.elements)]
        state = self.states.pop(0) if len(self.states) > 1 else self.states[0]
        return fragments(request, state.to_bytes(2, "little"))


def test_a_command_is_started_awaited_and_cleared() -> None:
    command = Command(0x7, 0x7, 0x3)
    play(run_command(target(99)), MailboxDevice(command))
    assert command.written == [b"\x03\x00", b"\x00\x00"]


def test_a_command_that_fails_is_cleared() -> None:
    command = Command(0x7, 0xF)
    with pytest.raises(SoeError, match="procedure command failed") as error:
        play(run_command(target(99)), MailboxDevice(command))
    assert command.written == [b"\x03\x00", b"\x00\x00"]
    assert CommandState(error.value.code) & CommandState.FAILED


def test_a_command_without_end_is_cancelled() -> None:
    command = Command(0x7)
    with pytest.raises(ResponseTimeout, match=r"not ended after 0.5 s \(state 0x0007\)"):
        play(run_command(target(99), 0.5), MailboxDevice(command))
    assert command.written == [b"\x03\x00", b"\x00\x00"]


def test_a_command_that_cannot_be_cancelled() -> None:
    class Stubborn(Command):
        def answer(self, request: Message) -> list[Message]:
            if request.data == bytes(2):
                return refusal(request, 0x7011)
            return super().answer(request)

    with pytest.raises(ResponseTimeout, match="could not be cancelled, and may still run"):
        play(run_command(target(99), 0.5), MailboxDevice(Stubborn(0x7)))


def test_a_command_whose_start_is_not_answered_is_cancelled() -> None:
    command = Command(0x7)

    def answer(request: Message) -> list[Message]:
        answers = command.answer(request)
        return [] if request.data == b"\x03\x00" else answers

    with pytest.raises(ResponseTimeout, match="no answer"):
        play(run_command(target(99)), device(answer))
    assert command.written == [b"\x03\x00", b"\x00\x00"]


def test_a_refused_start_is_not_cancelled() -> None:
    """The command may run for another program."""
    seen: list[Message] = []

    def answer(request: Message) -> list[Message]:
        seen.append(request)
        return refusal(request, 0x7010)

    with pytest.raises(SoeError, match="already active"):
        play(run_command(target(99)), device(answer))
    assert len(seen) == 1


def test_a_state_of_the_wrong_size() -> None:
    written: list[bytes] = []

    def answer(request: Message) -> list[Message]:
        if request.op_code is OpCode.WRITE_REQUEST:
            written.append(request.data)
        return [Message(OpCode(request.op_code + 1), request.number, request.elements, b"1")]

    with pytest.raises(MailboxError, match="data state: needs 2 bytes, received 1"):
        play(run_command(target(99)), device(answer))
    assert written == [b"\x03\x00", b"\x00\x00"]  # started, cancelled
