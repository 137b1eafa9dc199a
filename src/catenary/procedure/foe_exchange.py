"""One message of a file transfer and its answer, ETG.1000.6 §5.8.

Where the standard is silent:

- After BUSY, the last message is sent again, with a pause and a limit. SOEM and IgH (fsm_foe.c) do
  this for data packets, without either. A read request is continued with acknowledgement 0, as the
  SSC expects since version 5.11 (ecatfoe.c).
- A request that is illegal in the present state of the device is sent again. SSC and SOES
  (esc_foe.c) refuse the first request after an interrupted transfer, and then forget the transfer.
- A packet or an acknowledgement with the previous number is a duplicate, and is dropped. Any other
  unexpected number ends the transfer, as in SOEM. IgH does not compare the acknowledgements.
- A transfer that this side ends is ended with an error message, so that the device can accept the
  next one. SOEM and IgH send nothing; SOES (esc_foe.c, `FOE_error`) expects the message.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

from catenary.errors import DecodeError, FoeError, MailboxError, ResponseTimeout
from catenary.procedure.exchange import Procedure, after
from catenary.procedure.mailbox import MailboxChannel, converse, send_only
from catenary.procedure.station import Deadline, Pace
from catenary.wire.foe import (
    Acknowledge,
    Busy,
    Data,
    Error,
    ErrorCode,
    Message,
    ReadRequest,
    WriteRequest,
    decode_foe,
    error_meaning,
)
from catenary.wire.mailbox import Mailbox, Type

T = TypeVar("T", Data, Acknowledge)

ANSWER_TIMEOUT = 10.0  # [s] for each packet: devices erase flash memory before they answer
BUSY_TIMEOUT = 120.0  # [s] that a device may be busy with one packet
BUSY_PAUSE, BUSY_PAUSE_MAX = 1e-3, 50e-3  # [s] before the same message is sent again


class Patience(NamedTuple):
    """Longest waits of one packet [s]."""

    answer: float = ANSWER_TIMEOUT
    busy: float = BUSY_TIMEOUT


PATIENCE = Patience()


@dataclass(slots=True)
class Progress:
    """Progress of one transfer. The procedure updates it, and other code may read or stop it."""

    total: int | None = None  # bytes of the file; None while a file is read
    done: int = 0  # bytes that the receiver has acknowledged
    busy: Busy | None = None  # last message of a busy device; None after any other answer
    stopped: bool = False  # True ends the transfer before the next message


class Transfer(NamedTuple):
    """Parameters that all steps of one transfer need."""

    channel: MailboxChannel
    name: str
    progress: Progress
    patience: Patience

    def __str__(self) -> str:
        return f"{self.channel.station}: file {self.name!r}"


def open_file(
    transfer: Transfer,
    request: ReadRequest | WriteRequest,
    expected: type[T],
    packet: int,
    after_busy: Sequence[Message],
) -> Procedure[T]:
    """Send a request, and return the answer. Send an illegal request again.

    Args:
        transfer: The transfer.
        request: The request to send.
        expected: Type of the answer.
        packet: Packet number of the answer.
        after_busy: For each attempt, the message to send after BUSY.
    """
    for again in after_busy[:-1]:
        try:
            return (yield from ask(transfer, request, expected, packet, again))
        except FoeError as error:
            if error.code != ErrorCode.ILLEGAL:
                raise
    return (yield from ask(transfer, request, expected, packet, after_busy[-1]))


def ask(
    transfer: Transfer,
    message: Message,
    expected: type[T],
    packet: int,
    after_busy: Message | None = None,
) -> Procedure[T]:
    """Send a message until the device is not busy, and return its answer.

    Args:
        transfer: The transfer.
        message: The message to send.
        expected: Type of the answer.
        packet: Packet number of the answer.
        after_busy: The message to send after BUSY; None: the same.
    """
    channel, patience = transfer.channel, transfer.patience
    deadline, pace = Deadline(patience.busy), Pace(BUSY_PAUSE, BUSY_PAUSE_MAX)
    accept = _acceptor(channel, expected, packet - 1)
    while True:
        if transfer.progress.stopped:
            yield from send_error(transfer, ErrorCode.NOT_DEFINED)
            raise MailboxError(f"{transfer}: stopped after {transfer.progress.done} bytes")
        talk: Procedure[Message] = converse(
            channel, Type.FOE, message.encode(), accept, timeout=patience.answer
        )
        answer = yield from talk
        if isinstance(answer, Error):
            raise _refused(transfer, answer)
        if not isinstance(answer, Busy):
            transfer.progress.busy = None
            return (yield from _matching(transfer, answer, expected, packet))
        transfer.progress.busy = answer
        if deadline.passed_at(channel.received_ns):
            yield from send_error(transfer, ErrorCode.NOT_DEFINED)
            raise _too_busy(transfer, answer, patience.busy)
        message = after_busy or message
        yield after(pace.pause())


def _acceptor(
    channel: MailboxChannel, expected: type[T], duplicate: int
) -> Callable[[Mailbox], Message | None]:
    """Return the function that accepts all FoE messages except duplicates."""

    def accept(received: Mailbox) -> Message | None:
        if received.type is not Type.FOE:
            return None
        try:
            message = decode_foe(received.data)
        except DecodeError as error:
            raise MailboxError(
                f"{channel.station}: invalid FoE message: {error}",
                hint="its firmware is at fault; record a capture of the transfer to see the bytes",
            ) from error
        if isinstance(message, expected) and message.packet == duplicate:
            return None
        return message

    return accept


def _matching(transfer: Transfer, answer: Message, expected: type[T], packet: int) -> Procedure[T]:
    """Return the answer if it is the expected one. Otherwise end the transfer."""
    if isinstance(answer, expected):
        if answer.packet == packet:
            return answer
        yield from send_error(transfer, ErrorCode.PACKET_NUMBER)
        what = f"packet number {answer.packet} instead of {packet}"
    else:
        yield from send_error(transfer, ErrorCode.ILLEGAL)
        what = f"{type(answer).__name__} instead of {expected.__name__} {packet}"
    raise MailboxError(
        f"{transfer}: the device sent {what}, after {transfer.progress.done} bytes",
        hint="repeat the transfer. If it fails again, its firmware is at fault, or a second master "
        "accesses it",
    )


def send_error(transfer: Transfer, code: ErrorCode) -> Procedure[None]:
    """End the transfer. A device that has already ended it answers that this is illegal (SSC)."""
    transfer.channel.owed = True
    yield from send_only(transfer.channel, Type.FOE, Error(code).encode())


def _refused(transfer: Transfer, answer: Error) -> FoeError:
    meaning = error_meaning(answer.code)
    words = f" ({answer.text})" if answer.text not in ("", meaning.text) else ""
    place = f" after {transfer.progress.done} bytes" if transfer.progress.done else ""
    return FoeError(
        f"{transfer} refused{place} with 0x{answer.code:04X}: {meaning.text}{words}",
        position=transfer.channel.station.position,
        name=transfer.name,
        code=answer.code,
        text=answer.text,
        hint=meaning.hint,
    )


def _too_busy(transfer: Transfer, answer: Busy, seconds: float) -> ResponseTimeout:
    state = f", last progress {answer.done} of {answer.entire}" if answer.entire else ""
    words = f" ({answer.text})" if answer.text else ""
    return ResponseTimeout(
        f"{transfer}: the device has been busy for {seconds:g} s after {transfer.progress.done} "
        f"bytes{state}{words}",
        hint="allow more time if the device needs it, else power-cycle it and repeat the transfer",
    )
