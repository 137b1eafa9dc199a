"""Procedures of the gateway: forward one message to a device, and read the states of its axes.

The mailbox counter and the address are those of the MainDevice (`procedure.mailbox`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from catenary.errors import CatenaryError, DecodeError, MailboxError
from catenary.gateway.request import Request
from catenary.gateway.transfer import Transfer, has_answer
from catenary.procedure.exchange import Procedure
from catenary.procedure.foe_exchange import ANSWER_TIMEOUT
from catenary.procedure.mailbox import (
    READ_TIMEOUT,
    MailboxChannel,
    converse,
    further,
    send_only,
)
from catenary.wire import coe
from catenary.wire.cia402 import AxisState, state_of
from catenary.wire.mailbox import Mailbox, Type

FRAGMENTS_MAX = 1100  # of an object list: 64 Ki indices in mailboxes of 128 bytes
FRAGMENTS_TIMEOUT_NS = 20_000_000_000
INCOMPLETE = 0x80  # bit of the opcode of an SDO information message
ABORT_SPECIFIER = 4
INITIATE = (2, 3)  # command specifiers of responses with an index
STATUSWORD, SLOT = 0x6041, 0x800


def forward(
    channel: MailboxChannel, request: Request, transfer: Transfer | None
) -> Procedure[list[Mailbox]]:
    """Send a message of a client to a device, and return the answers.

    Args:
        channel: The mailbox of the device.
        request: The message.
        transfer: Transfer that the message continues; None if it begins one.

    Returns:
        Answers of the device: one, or the fragments of an SDO information answer, or a mailbox
        error. Empty if the device does not answer such a message.

    Raises:
        ResponseTimeout: The device does not answer, or too many frames were lost.
        MailboxError: The device violates the protocol, or does not read its mailbox.
    """
    message = request.message
    if not has_answer(transfer, request):
        yield from send_only(channel, message.type, message.data)
        return []
    before = channel.received
    try:
        return (yield from _ask(channel, message))
    except MailboxError:
        received = channel.received
        if received is None or received is before or received.type is not Type.ERROR:
            raise
        return [received]


def _ask(channel: MailboxChannel, message: Mailbox) -> Procedure[list[Mailbox]]:
    accept = _acceptance(message)
    timeout = ANSWER_TIMEOUT if message.type is Type.FOE else READ_TIMEOUT
    answers = [(yield from converse(channel, message.type, message.data, accept, timeout=timeout))]
    started_ns = channel.received_ns
    while _is_incomplete(answers[-1]):
        late = channel.received_ns - started_ns > FRAGMENTS_TIMEOUT_NS
        if late or len(answers) >= FRAGMENTS_MAX:
            raise MailboxError(
                f"{channel.station}: an SDO information answer has more than {len(answers)} "
                "fragments, or takes longer than 20 s",
                hint="its firmware is at fault",
            )
        answers.append((yield from further(channel, accept)))
    return answers


def _acceptance(message: Mailbox) -> Callable[[Mailbox], Mailbox | None]:
    """Return the function that recognises the answers to a message."""

    def accept(answer: Mailbox) -> Mailbox | None:
        if answer.type is not message.type:
            return None
        if message.type is Type.COE and not _answers_coe(message.data, answer.data):
            return None
        return answer

    return accept


def _answers_coe(asked: bytes, answer: bytes) -> bool:
    """Return True if a CoE message answers another one. Late answers name another object."""
    service, found = (int.from_bytes(data[:2], "little") >> 12 for data in (asked, answer))
    if service == coe.Service.SDO_INFORMATION:
        return found == service
    if service != coe.Service.SDO_REQUEST:
        return found != coe.Service.EMERGENCY
    if len(answer) < coe.SEGMENT_HEADER_SIZE:
        return False
    specifier = answer[2] >> 5
    if specifier == ABORT_SPECIFIER:
        return found in (coe.Service.SDO_REQUEST, coe.Service.SDO_RESPONSE)
    if found != coe.Service.SDO_RESPONSE:
        return False
    return specifier not in INITIATE or answer[3:6] == asked[3:6]


def _is_incomplete(answer: Mailbox) -> bool:
    """Return True if further fragments of an SDO information answer follow."""
    data = answer.data
    if answer.type is not Type.COE or len(data) < 3:
        return False
    service = int.from_bytes(data[:2], "little") >> 12
    return service == coe.Service.SDO_INFORMATION and bool(data[2] & INCOMPLETE)


def read_axis_states(
    channel: MailboxChannel, slots: Iterable[int]
) -> Procedure[list[AxisState | None]]:
    """Read the CiA 402 state of each axis from its statusword (0x6041).

    The caller must have the turn in the queue of the mailbox.

    Args:
        channel: The mailbox of the device.
        slots: Slots of the axes.

    Returns:
        State of each axis; None if the statusword cannot be read, or has no valid state.
    """
    states: list[AxisState | None] = []
    for slot in slots:
        request = coe.UploadRequest(STATUSWORD + SLOT * slot, 0).encode()
        try:
            answer = yield from converse(
                channel, Type.COE, request, _acceptance(Mailbox(Type.COE, request))
            )
            states.append(_state(coe.decode_coe(answer.data)))
        except (CatenaryError, DecodeError):  # unknown, which the caller treats as enabled
            states.append(None)
    return states


def _state(answer: coe.Message) -> AxisState | None:
    if not isinstance(answer, coe.UploadResponse) or len(answer.data) < 2:
        return None
    return state_of(int.from_bytes(answer.data[:2], "little"))
