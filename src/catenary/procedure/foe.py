"""File transfers, ETG.1000.6 §5.8: write and read a file of a device.

Packets have numbers from 1; acknowledgement 0 is the answer to a write request. All packets but the
last fill the mailbox. If the size of a file is a multiple of that, the last packet is empty, as in
SOEM (ec_foe.c, `dofinalzero`) and the SSC (ecatfoe.h, `pAPPL_FoeRead`).
"""

from __future__ import annotations

from typing import TypeVar

from catenary.errors import MailboxError
from catenary.procedure.exchange import Procedure
from catenary.procedure.foe_exchange import (
    PATIENCE,
    Patience,
    Progress,
    Transfer,
    ask,
    open_file,
    send_error,
)
from catenary.procedure.mailbox import MailboxChannel, exclusively, send_only
from catenary.wire import mailbox
from catenary.wire.foe import (
    FIRST_PACKET,
    HEADER_SIZE,
    Acknowledge,
    Data,
    ErrorCode,
    ReadRequest,
    WriteRequest,
)
from catenary.wire.mailbox import Type

Request = TypeVar("Request", ReadRequest, WriteRequest)

OVERHEAD = mailbox.HEADER_SIZE + HEADER_SIZE
MAX_SIZE = 1 << 28  # [bytes] of a file that is read: larger than the memory of all known devices
LAST_ATTEMPTS = 5  # for the last acknowledgement, which the device does not answer


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
    transfer = Transfer(channel, name, followed, patience)
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
    transfer = Transfer(channel, name, progress or Progress(), patience)
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


def _write(transfer: Transfer, request: WriteRequest, data: bytes) -> Procedure[None]:
    capacity = write_capacity(transfer.channel)
    yield from open_file(transfer, request, Acknowledge, FIRST_PACKET - 1, [request] * 2)
    # One packet more than full ones: a part of the data, or nothing.
    for packet, start in enumerate(range(0, len(data) + 1, capacity), FIRST_PACKET):
        part = data[start : start + capacity]
        yield from ask(transfer, Data(packet, part), Acknowledge, packet)
        transfer.progress.done += len(part)


def _read(transfer: Transfer, request: ReadRequest, max_size: int) -> Procedure[bytes]:
    capacity = read_capacity(transfer.channel)
    data, packet = bytearray(), FIRST_PACKET
    start = Acknowledge(FIRST_PACKET - 1)
    # The last attempt is for stacks that expect the request again after BUSY.
    received = yield from open_file(transfer, request, Data, packet, [start, start, request])
    while True:
        part = received.data
        if len(data) + len(part) > max_size:
            yield from send_error(transfer, ErrorCode.DISK_FULL)
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
        received = yield from ask(transfer, message, Data, packet)
    yield from send_only(transfer.channel, Type.FOE, message.encode(), attempts=LAST_ATTEMPTS)
    return bytes(data)
