"""Vendor-specific protocol (VoE), ETG.1000.6 §5.10.

The standard does not connect answers with requests. The next VoE message of the device is the
answer, as in IgH (voe_handler.c).
"""

from __future__ import annotations

from catenary.errors import DecodeError, MailboxError, ResponseTimeout
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import (
    RECOVERIES,
    MailboxChannel,
    converse,
    exclusively,
    send_only,
)
from catenary.procedure.station import checked_timeout
from catenary.wire.mailbox import HEADER_SIZE, Mailbox, Type
from catenary.wire.voe import HEADER_SIZE as VOE_HEADER_SIZE
from catenary.wire.voe import VoeMessage, decode_voe

ANSWER_TIMEOUT = 2.0  # [s] until a device answers


def exchange(
    channel: MailboxChannel, message: VoeMessage, timeout: float = ANSWER_TIMEOUT
) -> Procedure[VoeMessage]:
    """Return the procedure that sends a message and returns the next one of the device.

    Args:
        channel: The mailbox of the device.
        message: The message to send.
        timeout: Longest time until the device answers [s].

    Raises:
        ResponseTimeout: The device does not answer.
        MailboxError: The device violates the protocol, or does not support VoE.
        ValueError: The message does not fit into the mailbox, or the timeout is invalid.
    """
    data = _checked(channel, message)
    checked_timeout(timeout)

    def accept(received: Mailbox) -> VoeMessage | None:
        return _decoded(channel, received) if received.type is Type.VOE else None

    return exclusively(channel, converse(channel, Type.VOE, data, accept, timeout=timeout))


def send(channel: MailboxChannel, message: VoeMessage) -> Procedure[None]:
    """Return the procedure that sends a message without an answer. Errors: see `exchange`."""
    return exclusively(channel, _send(channel, _checked(channel, message)))


def _send(channel: MailboxChannel, data: bytes) -> Procedure[None]:
    if not (yield from send_only(channel, Type.VOE, data, attempts=RECOVERIES)):
        raise ResponseTimeout(
            f"{channel.station}: {RECOVERIES} frames with the same VoE message were lost",
            hint="check the cables: the error counters at 0x0300 show which one is faulty",
        )


def _decoded(channel: MailboxChannel, received: Mailbox) -> VoeMessage:
    try:
        return decode_voe(received.data)
    except DecodeError as error:
        raise MailboxError(
            f"{channel.station}: invalid VoE message: {error}",
            hint="its firmware is at fault; record a capture to see the bytes",
        ) from error


def _checked(channel: MailboxChannel, message: VoeMessage) -> bytes:
    room = channel.layout.receive_size - HEADER_SIZE - VOE_HEADER_SIZE
    if len(message.data) > room:
        raise ValueError(
            f"VoE: {len(message.data)} bytes; the mailbox of {channel.station} accepts {room}"
        )
    return message.encode()
