"""Parameters and procedure commands of a simulated SERCOS drive."""

from __future__ import annotations

from functools import partial

import pytest

from catenary.errors import MailboxError, ResponseTimeout, SoeError
from catenary.procedure.sercos import (
    ALL,
    read_parameter,
    read_value,
    run_command,
    write_value,
)
from catenary.wire.sercos import Attribute, CommandState, Display, encode_list
from catenary.wire.soe import Element, Message, OpCode
from tests.procedure.drives import (
    Drive,
    device,
    fragments,
    refusal,
    refuse_with,
    target,
)
from tests.procedure.player import MailboxDevice, play

POSITION = Attribute(4, display=Display.SIGNED)


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
        play(read_parameter(target(), ALL), device(partial(refuse_with, 0x1001)))
    with pytest.raises(SoeError, match="no such IDN"):
        play(write_value(target(), 1), device(partial(refuse_with, 0x1001)))


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
