"""File transfers, ETG.1000.6 §5.8: write and read a file of a device.

Packets have numbers from 1; acknowledgement 0 is the answer to a write request. All packets but the
last fill the mailbox. If the size of a file is a multiple of that, the last packet is empty, as in
SOEM (ec_foe.c, `dofinalzero`) and the SSC (ecatfoe.h, `pAPPL_FoeRead`).

Where the standard is silent:

- After BUSY, the last message is sent again. SOEM and IgH (fsm_foe.c) do this for data packets,
  but without a pause and without a limit. Here, this also holds for requests and acknowledgements.
- A packet or an acknowledgement with the previous number is a duplicate, and is dropped. Any other
  unexpected number ends the transfer, as in SOEM. IgH does not compare the acknowledgements.
- A transfer that this side ends is ended with an error message, so that the device can accept the
  next one. SOEM and IgH send nothing; SOES (esc_foe.c, `FOE_error`) expects the message.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

from catenary.errors import DecodeError, FoeError, MailboxError, ResponseTimeout
from catenary.procedure.exchange import Procedure, after
from catenary.procedure.mailbox import MailboxChannel, converse, exclusively, send_only
from catenary.procedure.station import Deadline, Pace
from catenary.wire import mailbox
from catenary.wire.foe import (
    FIRST_PACKET,
    HEADER_SIZE,
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
Request = TypeVar("Request", ReadRequest, WriteRequest)

OVERHEAD = mailbox.HEADER_SIZE + HEADER_SIZE
MAX_SIZE = 1 << 28  # [bytes] of a file that is read: larger than the memory of all known devices
ANSWER_TIMEOUT = 10.0  # [s] for each packet: devices erase flash memory before they answer
BUSY_TIMEOUT = 120.0  # [s] that a device may be busy with one packet
BUSY_PAUSE, BUSY_PAUSE_MAX = 1e-3, 50e-3  # [s] before the same message is sent again
LAST_ATTEMPTS = 5  # for the last acknowledgement, which the device does not answer


class Patience(NamedTuple):
    """Longest waits of one packet [s]."""

    answer: float = ANSWER_TIMEOUT
    busy: float = BUSY_TIMEOUT


PATIENCE = Patience()


@dataclass(slots=True)
class Progress:
    """Progress of one transfer. The procedure updates it, and other code may read it."""

    total: int | None = None  # bytes of the file; None while a file is read
    done: int = 0  # bytes that the receiver has acknowledged
    busy: Busy | None = None  # last message of a busy device; None after any other answer


class _Transfer(NamedTuple):
    """The parameters that all steps of one transfer need."""

    channel: MailboxChannel
    name: str
    progress: Progress
    patience: Patience

    def __str__(self) -> str:
        return f"{self.channel.station}: file {self.name!r}"


def write_capacity(channel: MailboxChannel) -> int:
    """Return the size of a full packet to the device [bytes]."""
    return channel.layout.receive_size - OVERHEAD


def read_capacity(channel: MailboxChannel) -> int:
    """Return the size of a full packet from the device [bytes]."""
    return channel.layout.send_size - OVERHEAD


def write(
    channel: MailboxChannel,
    name: str,
    data: bytes,
    *,
    password: int = 0,
    progress: Progress | None = None,
    patience: Patience = PATIENCE,
) -> Procedure[None]:
    """Write a file to a device.

    Args:
        channel: The mailbox of the device.
        name: Name of the file in the device.
        data: Contents of the file.
        password: Password, 32 bits; 0 if the device does not require one.
        progress: Progress, which the procedure updates.
        patience: Longest waits.

    Raises:
        FoeError: The device refuses the file.
        ResponseTimeout: The device does not answer, or is busy for too long.
        MailboxError: The device violates the protocol, or does not support FoE.
        ValueError: The name or the password does not fit.
    """
    request = _checked(channel, WriteRequest(name, password))
    followed = progress or Progress()
    followed.total = len(data)
    transfer = _Transfer(channel, name, followed, patience)
    return exclusively(channel, _write(transfer, request, data))


def read(
    channel: MailboxChannel,
    name: str,
    *,
    password: int = 0,
    max_size: int = MAX_SIZE,
    progress: Progress | None = None,
    patience: Patience = PATIENCE,
) -> Procedure[bytes]:
    """Read a file of a device.

    Args:
        channel: The mailbox of the device.
        name: Name of the file in the device.
        password: Password, 32 bits; 0 if the device does not require one.
        max_size: Largest accepted size [bytes]. FoE does not announce the size of a file.
        progress: Progress, which the procedure updates.
        patience: Longest waits.

    Raises:
        FoeError: The device refuses the request.
        ResponseTimeout: The device does not answer, or is busy for too long.
        MailboxError: The file exceeds `max_size`, or the device violates the protocol or does not
            support FoE.
        ValueError: The name or the password does not fit.
    """
    request = _checked(channel, ReadRequest(name, password))
    transfer = _Transfer(channel, name, progress or Progress(), patience)
    return exclusively(channel, _read(transfer, request, max_size))


def _checked(channel: MailboxChannel, request: Request) -> Request:
    """Return the request if it fits into the mailbox of the device."""
    size, capacity = len(request.encode()) - HEADER_SIZE, write_capacity(channel)
    if not 1 <= size <= capacity:
        raise ValueError(
            f"file name {request.name!r} has {size} characters: the mailbox of {channel.station} "
            f"accepts 1 to {capacity}"
        )
    return request


def _write(transfer: _Transfer, request: WriteRequest, data: bytes) -> Procedure[None]:
    capacity = write_capacity(transfer.channel)
    yield from _ask(transfer, request, Acknowledge, FIRST_PACKET - 1)
    # One packet more than full ones: a part of the data, or nothing.
    for packet, start in enumerate(range(0, len(data) + 1, capacity), FIRST_PACKET):
        part = data[start : start + capacity]
        yield from _ask(transfer, Data(packet, part), Acknowledge, packet)
        transfer.progress.done += len(part)


def _read(transfer: _Transfer, request: ReadRequest, max_size: int) -> Procedure[bytes]:
    capacity = read_capacity(transfer.channel)
    message: Message = request
    data, packet = bytearray(), FIRST_PACKET
    while True:
        part = (yield from _ask(transfer, message, Data, packet)).data
        if len(data) + len(part) > max_size:
            yield from _send_error(transfer, ErrorCode.DISK_FULL)
            raise MailboxError(
                f"{transfer} is larger than {max_size} bytes",
                hint="if the file is that large, increase max_size; else its firmware is at fault",
            )
        data += part
        transfer.progress.done = len(data)
        message = Acknowledge(packet)
        if len(part) < capacity:
            break
        packet += 1
    yield from send_only(transfer.channel, Type.FOE, message.encode(), attempts=LAST_ATTEMPTS)
    return bytes(data)


def _ask(transfer: _Transfer, message: Message, expected: type[T], packet: int) -> Procedure[T]:
    """Send a message until the device is not busy, and return its answer.

    Args:
        transfer: The transfer.
        message: The message to send.
        expected: Type of the answer.
        packet: Packet number of the answer.
    """
    channel, patience = transfer.channel, transfer.patience
    deadline, pace = Deadline(patience.busy), Pace(BUSY_PAUSE, BUSY_PAUSE_MAX)
    accept = _acceptor(channel, expected, packet - 1)
    while True:
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
            yield from _send_error(transfer, ErrorCode.NOT_DEFINED)
            raise _too_busy(transfer, answer, patience.busy)
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


def _matching(transfer: _Transfer, answer: Message, expected: type[T], packet: int) -> Procedure[T]:
    """Return the answer if it is the expected one. Otherwise end the transfer."""
    if isinstance(answer, expected):
        if answer.packet == packet:
            return answer
        yield from _send_error(transfer, ErrorCode.PACKET_NUMBER)
        what = f"packet number {answer.packet} instead of {packet}"
    else:
        yield from _send_error(transfer, ErrorCode.ILLEGAL)
        what = f"{type(answer).__name__} instead of {expected.__name__} {packet}"
    raise MailboxError(
        f"{transfer}: the device sent {what}, after {transfer.progress.done} bytes",
        hint="repeat the transfer. If it fails again, its firmware is at fault, or a second master "
        "accesses it",
    )


def _send_error(transfer: _Transfer, code: ErrorCode) -> Procedure[None]:
    yield from send_only(transfer.channel, Type.FOE, Error(code).encode())


def _refused(transfer: _Transfer, answer: Error) -> FoeError:
    meaning = error_meaning(answer.code)
    words = f" ({answer.text})" if answer.text else ""
    place = f" after {transfer.progress.done} bytes" if transfer.progress.done else ""
    return FoeError(
        f"{transfer} refused{place} with 0x{answer.code:04X}: {meaning.text}{words}",
        position=transfer.channel.station.position,
        name=transfer.name,
        code=answer.code,
        text=answer.text,
        hint=meaning.hint,
    )


def _too_busy(transfer: _Transfer, answer: Busy, seconds: float) -> ResponseTimeout:
    state = f", last progress {answer.done} of {answer.entire}" if answer.entire else ""
    words = f" ({answer.text})" if answer.text else ""
    return ResponseTimeout(
        f"{transfer}: the device has been busy for {seconds:g} s after {transfer.progress.done} "
        f"bytes{state}{words}",
        hint="allow more time if the device needs it, else power-cycle it and repeat the transfer",
    )
