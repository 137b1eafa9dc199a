"""Simulated SERCOS drives for the tests of procedures."""

from __future__ import annotations

from collections.abc import Callable

from catenary.procedure.soe import OVERHEAD, Target
from catenary.wire.mailbox import Mailbox, Type
from catenary.wire.soe import Element, Message, OpCode, decode_soe
from tests.procedure.player import LAYOUT, MailboxDevice, channel

ROOM = LAYOUT.send_size - OVERHEAD
Answer = Callable[[Message], list[Message]]


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


def refuse_with(code: int, request: Message) -> list[Message]:
    return refusal(request, code)
