"""Access to the IDNs of a drive, ETG.1000.6 §5.9: read and write elements, in fragments if needed.

Where the standard is silent:

- A message with another drive, other elements or another IDN is not the answer. It may be a late
  answer to an earlier request.
- The number of fragments left decreases by one from fragment to fragment. A constant number is
  accepted, because SOEM (ec_soe.c) and IgH do not read it. Any other number ends the transfer.
- A fragment with the number of the last one is also accepted, so that lost frames are counted
  instead: after one, the request is repeated. SOEM and IgH do not notice a lost fragment.
- After a lost frame of a write in fragments, all fragments are written again. A device that does
  not recognise a repetition would otherwise store a fragment twice.
- After each fragment that this side writes, a refusal may arrive, as in SOEM. It has the IDN, or
  the number of the fragment.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from catenary.errors import DecodeError, MailboxError, ResponseTimeout, SoeError
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import (
    MailboxChannel,
    converse,
    drain,
    exclusively,
    further,
    send_only,
)
from catenary.procedure.station import Deadline
from catenary.wire import mailbox
from catenary.wire.mailbox import Mailbox, Type
from catenary.wire.sercos import LIST_BYTES_MAX, idn_text
from catenary.wire.sercos_errors import error_meaning
from catenary.wire.soe import HEADER_SIZE, Element, Message, OpCode, decode_soe

ANSWER_TIMEOUT = 5.0  # [s] for each message: drives write parameters to flash memory
TRANSFER_TIMEOUT = 60.0  # [s] for all fragments of one answer
SIZE_MAX = 1 << 18  # [bytes] of an answer: eight elements, of which four may be lists of 64 KiB
RECOVERIES = 5  # attempts to transfer fragments while frames are lost
LAST_ATTEMPTS = 5  # to send a fragment if its frame is lost
OVERHEAD = mailbox.HEADER_SIZE + HEADER_SIZE


class Target(NamedTuple):
    """One IDN of one drive."""

    channel: MailboxChannel
    idn: int
    drive: int = 0
    timeout: float = ANSWER_TIMEOUT  # [s] until the device answers a message

    def __str__(self) -> str:
        drive = f" of drive {self.drive}" if self.drive else ""
        return f"{self.channel.station}: {idn_text(self.idn)}{drive}"


def read(target: Target, elements: Element = Element.VALUE) -> Procedure[bytes]:
    """Read elements of an IDN. Several elements arrive one after the other.

    Args:
        target: The IDN.
        elements: Elements to read.

    Raises:
        SoeError: The drive refuses the request.
        ResponseTimeout: The device does not answer.
        MailboxError: The device violates the protocol, or does not support SoE.
        ValueError: The drive number is out of range.
    """
    request = Message(OpCode.READ_REQUEST, target.idn, elements, drive=target.drive)
    request.encode()  # a caller's mistake is reported before anything is sent
    return exclusively(target.channel, _read(target, request))


def write(target: Target, data: bytes, element: Element = Element.VALUE) -> Procedure[None]:
    """Write one element of an IDN.

    Args:
        target: The IDN.
        data: Bytes of the element; a list begins with its lengths.
        element: Element to write.

    Raises:
        SoeError: The drive refuses the value.
        ResponseTimeout: The device does not answer.
        MailboxError: The device violates the protocol, or does not support SoE.
        ValueError: The drive number or the size of the data is out of range.
    """
    if len(data) > LIST_BYTES_MAX + 4:
        raise ValueError(f"{target}: {len(data)} bytes exceed the longest list, 65535 bytes")
    request = Message(OpCode.WRITE_REQUEST, target.idn, element, drive=target.drive)
    request.encode()
    return exclusively(target.channel, _write(target, request, data))


def _read(target: Target, request: Message) -> Procedure[bytes]:
    """Read an answer. Repeat the request if a frame was lost during the fragments.

    The fragment after a lost one cannot then be distinguished from it.
    """
    channel = target.channel
    for _ in range(RECOVERIES):
        lost = channel.lost_reads
        answer = yield from _read_once(target, request)
        if not answer.in_fragments or channel.lost_reads == lost:
            break
    else:
        raise _line_fault(target)
    if answer.fault:
        raise _violation(target, answer.fault)
    return answer.data


class _Answer(NamedTuple):
    """Data of all fragments, and a fault in their numbers."""

    data: bytes
    in_fragments: bool
    fault: str


def _read_once(target: Target, request: Message) -> Procedure[_Answer]:
    """Send the request, and receive all fragments, also after a fault in their numbers."""
    channel, accept = target.channel, _acceptor(target, request, OpCode.READ_RESPONSE)
    talk: Procedure[Message] = converse(
        channel, Type.SOE, request.encode(), accept, timeout=target.timeout
    )
    answer = yield from talk
    in_fragments, fault = answer.incomplete, ""
    data, deadline = bytearray(answer.data), Deadline(TRANSFER_TIMEOUT)
    while answer.incomplete:
        endless = len(data) > SIZE_MAX or deadline.passed_at(channel.received_ns)
        if endless or not answer.data:
            raise _violation(target, f"sends fragments without end, {len(data)} bytes so far")
        left = answer.number
        answer = yield from further(channel, accept, timeout=target.timeout, kind=Type.SOE)
        if answer.incomplete and answer.number not in (left, left - 1):
            fault = f"announced {left} more fragments, then {answer.number} in the next one"
        data += answer.data
    return _Answer(bytes(data), in_fragments, fault)


def _write(target: Target, request: Message, data: bytes) -> Procedure[None]:
    """Write data. Write all fragments again if a frame was lost."""
    channel = target.channel
    capacity = channel.layout.receive_size - OVERHEAD
    parts = [data[at : at + capacity] for at in range(0, len(data), capacity)] or [b""]
    for _ in range(RECOVERIES):
        lost = channel.lost_writes
        try:
            yield from _write_once(target, request, parts)
        except SoeError:
            if len(parts) == 1 or channel.lost_writes == lost:
                raise
            continue  # because of a fragment that the device received twice
        if len(parts) == 1 or channel.lost_writes == lost:
            return
    raise _line_fault(target)


def _write_once(target: Target, request: Message, parts: Sequence[bytes]) -> Procedure[None]:
    channel, last = target.channel, len(parts) - 1
    for k, part in enumerate(parts[:-1]):
        left = last - k
        fragment = replace(request, data=part, number=left, incomplete=True)
        sent = yield from send_only(channel, Type.SOE, fragment.encode(), attempts=LAST_ATTEMPTS)
        if not sent:
            raise _line_fault(target)
        early = yield from drain(channel, _acceptor(target, request, OpCode.WRITE_RESPONSE, left))
        if early:
            raise _violation(target, "answered before it had received all fragments")
    accept = _acceptor(target, request, OpCode.WRITE_RESPONSE)
    final = replace(request, data=parts[-1]).encode()
    talk: Procedure[Message] = converse(channel, Type.SOE, final, accept, timeout=target.timeout)
    yield from talk


def _line_fault(target: Target) -> ResponseTimeout:
    return ResponseTimeout(
        f"{target}: frames with fragments were lost in {RECOVERIES} attempts",
        hint="check the cables: the error counters at 0x0300 show which one is faulty",
    )


def _acceptor(
    target: Target, request: Message, expected: OpCode, fragment: int | None = None
) -> Callable[[Mailbox], Message | None]:
    """Return the function that accepts the answer to a request, and raises its refusal.

    Args:
        target: The IDN.
        request: The request.
        expected: Service of the answer.
        fragment: Number of the last written fragment, which a refusal may have; None: the last one.
    """

    def accept(received: Mailbox) -> Message | None:
        if received.type is not Type.SOE:
            return None
        try:
            message = decode_soe(received.data)
        except DecodeError as error:
            raise _violation(target, f"sent an invalid SoE message: {error.message}") from error
        if message.op_code is not expected or message.drive != target.drive:
            return None
        refuses_fragment = message.error and message.number == fragment
        if not (message.incomplete or refuses_fragment or message.number == target.idn):
            return None
        if message.error:
            raise _refused(target, message, request)
        if message.elements != request.elements and expected is OpCode.READ_RESPONSE:
            return None
        return message

    return accept


def _refused(target: Target, answer: Message, request: Message) -> SoeError:
    meaning = error_meaning(answer.code)
    verb = "read" if request.op_code is OpCode.READ_REQUEST else "write"
    return SoeError(
        f"{target}: {verb} refused with 0x{answer.code:04X}: {meaning.text}",
        position=target.channel.station.position,
        idn=target.idn,
        drive=target.drive,
        code=answer.code,
        hint=meaning.hint,
    )


def _violation(target: Target, what: str) -> MailboxError:
    return MailboxError(
        f"{target}: the device {what}",
        hint="repeat the request. If it fails again, its firmware is at fault, or a second master "
        "accesses it",
    )
