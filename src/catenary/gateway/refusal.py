"""Answers of the gateway itself: refused requests, and devices that do not answer.

The answer has the form that the client expects: an SDO abort, an FoE error or a mailbox error.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from catenary.gateway.request import Request
from catenary.wire import coe, foe
from catenary.wire.mailbox import ErrorCode, ErrorReply, Mailbox, Type


@dataclass(frozen=True, slots=True)
class Codes:
    """Codes of one reason in the three protocols."""

    sdo: int
    foe: int
    mailbox: ErrorCode


class Reason(Enum):
    """Reason for which the gateway answers itself."""

    # 0x08000021: local control; 0x08000022: present device state
    NOT_ALLOWED = Codes(0x0800_0021, foe.ErrorCode.NO_RIGHTS, ErrorCode.SERVICE_NOT_SUPPORTED)
    AXIS_ENABLED = Codes(0x0800_0022, foe.ErrorCode.ACCESS_DENIED, ErrorCode.SERVICE_NOT_SUPPORTED)
    OUT_OF_TURN = Codes(0x0504_0001, foe.ErrorCode.ILLEGAL, ErrorCode.SERVICE_NOT_SUPPORTED)
    BUSY = Codes(0x0504_0000, foe.ErrorCode.NOT_DEFINED, ErrorCode.SERVICE_IN_WORK)
    NO_ANSWER = Codes(0x0504_0000, foe.ErrorCode.NOT_DEFINED, ErrorCode.NO_MORE_MEMORY)
    FAILED = Codes(0x0800_0000, foe.ErrorCode.NOT_DEFINED, ErrorCode.SERVICE_NOT_SUPPORTED)
    NO_DEVICE = Codes(0x0602_0000, foe.ErrorCode.NOT_FOUND, ErrorCode.INVALID_HEADER)
    NO_MAILBOX = Codes(0x0800_0022, foe.ErrorCode.ILLEGAL, ErrorCode.UNSUPPORTED_PROTOCOL)
    TOO_LONG = Codes(0x0601_0005, foe.ErrorCode.ILLEGAL, ErrorCode.INVALID_SIZE)


@dataclass(frozen=True, slots=True)
class Refusal:
    """Reason with its explanation for the log and the client."""

    reason: Reason
    text: str


def refusal_answer(request: Request, refusal: Refusal) -> Mailbox:
    """Return the answer to a request that the gateway refuses.

    Args:
        request: The request.
        refusal: The reason.
    """
    codes = refusal.reason.value
    if isinstance(request.parsed, foe.Message):
        text = refusal.text.encode("ascii", "replace").decode()[:40]
        return Mailbox(Type.FOE, foe.Error(codes.foe, text).encode())
    if isinstance(request.parsed, coe.Request):
        abort = coe.Abort(request.index or 0, request.subindex or 0, codes.sdo)
        return Mailbox(Type.COE, abort.encode())
    return Mailbox(Type.ERROR, ErrorReply(codes.mailbox).encode())


def to_client(request: Mailbox, answer: Mailbox) -> Mailbox:
    """Return an answer with the address and the counter of the request.

    Args:
        request: Message of the client.
        answer: Message of the device or of the gateway.
    """
    return Mailbox(answer.type, answer.data, request.counter, request.address)
