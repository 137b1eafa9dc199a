"""Transfers of several messages: which client message may follow, and whether one must follow.

SDO segments (ETG.1000.6 §5.6.2.3, §5.6.2.6) and the packets of a file (§5.8) name neither the
object nor the file. Only the transfer that they continue shows what they read or write.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

from catenary.errors import DecodeError
from catenary.gateway.request import Access, Request
from catenary.model.device import MailboxLayout
from catenary.wire import coe, foe
from catenary.wire.mailbox import HEADER_SIZE, Mailbox, Type

PACKET_OVERHEAD = HEADER_SIZE + foe.HEADER_SIZE
ABORT_TIMEOUT = 0x0504_0000  # SDO protocol timeout


class Kind(Enum):
    """Kind of a transfer, and the message that continues it."""

    UPLOAD = coe.UploadSegmentRequest
    DOWNLOAD = coe.DownloadSegment
    FILE_READ = foe.Acknowledge
    FILE_WRITE = foe.Data


@dataclass(frozen=True, slots=True)
class Transfer:
    """Transfer that needs further messages of the client."""

    kind: Kind
    first: Request
    ends: bool = False  # the next message of the client is the last, and has no answer

    @property
    def writes(self) -> bool:
        """True if the transfer writes to the device."""
        return self.kind in (Kind.DOWNLOAD, Kind.FILE_WRITE)

    @property
    def end_message(self) -> Mailbox:
        """Message that ends the transfer in the device."""
        first = self.first
        if first.message.type is Type.FOE:
            error = foe.Error(foe.ErrorCode.NOT_DEFINED, "gateway: transfer ended")
            return Mailbox(Type.FOE, error.encode())
        abort = coe.Abort(first.index or 0, first.subindex or 0, ABORT_TIMEOUT)
        return Mailbox(Type.COE, abort.encode())


def continues(transfer: Transfer | None, request: Request) -> bool:
    """Return True if a message continues or ends a transfer.

    After BUSY, a client repeats the request of a file, or a packet.
    """
    if transfer is None:
        return False
    first = transfer.first.message
    if request.access is Access.END:
        return request.message.type is first.type
    if isinstance(request.parsed, transfer.kind.value):
        return True
    repeated = request.message.type is first.type and request.message.data == first.data
    return repeated and first.type is Type.FOE and not transfer.ends


def has_answer(transfer: Transfer | None, request: Request) -> bool:
    """Return True if the device answers a message.

    Args:
        transfer: Transfer that the message continues; None if it begins one.
        request: The message.
    """
    if request.access is Access.END:
        return False
    return transfer is None or not transfer.ends


def next_transfer(
    transfer: Transfer | None, request: Request, answers: Sequence[Mailbox], layout: MailboxLayout
) -> Transfer | None:
    """Return the transfer that the client must continue after the answers; None if there is none.

    Args:
        transfer: Transfer before the message.
        request: Message of the client.
        answers: Answers of the device.
        layout: Mailbox of the device, which determines the size of a full packet.
    """
    if request.access is Access.END or not answers:
        return None
    try:
        if request.message.type is Type.COE:
            return _after_sdo(transfer, request, coe.decode_coe(answers[-1].data))
        if request.message.type is Type.FOE:
            return _after_packet(transfer, request, foe.decode_foe(answers[-1].data), layout)
    except DecodeError:
        return None  # the client receives the invalid answer, too
    return None


def _after_sdo(transfer: Transfer | None, request: Request, answer: coe.Message) -> Transfer | None:
    sent = request.parsed
    match answer:
        case coe.UploadResponse(expedited=False, data=data, size=size) if len(data) < size:
            return Transfer(Kind.UPLOAD, request)
        case coe.UploadSegment(last=False):
            return transfer
        case coe.DownloadResponse() if isinstance(sent, coe.DownloadRequest):
            return Transfer(Kind.DOWNLOAD, request) if len(sent.data) < sent.size else None
        case coe.DownloadSegmentResponse() if isinstance(sent, coe.DownloadSegment):
            return None if sent.last else transfer
    return None


def _after_packet(
    transfer: Transfer | None, request: Request, answer: foe.Message, layout: MailboxLayout
) -> Transfer | None:
    sent = request.parsed
    if isinstance(sent, foe.ReadRequest):
        transfer = Transfer(Kind.FILE_READ, request)
    elif isinstance(sent, foe.WriteRequest):
        transfer = Transfer(Kind.FILE_WRITE, request)
    if transfer is None or isinstance(answer, foe.Error):
        return None
    if isinstance(answer, foe.Data):
        full = layout.send_size - PACKET_OVERHEAD
        return replace(transfer, ends=len(answer.data) < full)
    if isinstance(answer, foe.Acknowledge) and isinstance(sent, foe.Data):
        full = layout.receive_size - PACKET_OVERHEAD
        return None if len(sent.data) < full else transfer
    return transfer
