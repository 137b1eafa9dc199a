"""SDO services, ETG.1000.6 §5.6.2: upload and download, each expedited, normal and segmented."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from catenary.errors import DecodeError, MailboxError, SdoAbort
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel, converse, exclusively, send_only
from catenary.procedure.station import Deadline
from catenary.wire.abort import abort_code
from catenary.wire.coe import (
    EXPEDITED_MAXIMUM,
    SDO_SIZE,
    Abort,
    DownloadRequest,
    DownloadResponse,
    DownloadSegment,
    DownloadSegmentResponse,
    Message,
    UploadRequest,
    UploadResponse,
    UploadSegment,
    UploadSegmentRequest,
    decode_coe,
)
from catenary.wire.mailbox import HEADER_SIZE, Mailbox, Type

T = TypeVar("T")

SEGMENT_OVERHEAD = HEADER_SIZE + 3  # mailbox header, CoE header, command
INITIATE_OVERHEAD = HEADER_SIZE + SDO_SIZE
ABORT_PROTOCOL = 0x0504_0001  # command specifier not valid or unknown
ABORT_TOGGLE = 0x0503_0000
ABORT_TIMEOUT = 0x0504_0000
ABORT_LENGTH = 0x0607_0012  # data type does not match, length too high
ABORT_MEMORY = 0x0504_0005  # out of memory
UPLOAD_LIMIT = 1 << 20  # bytes: larger than all known objects
UPLOAD_TIMEOUT = 60.0  # [s] for all segments: 1 MiB in mailboxes of 128 bytes, 7 ms each
SMALL_LIMIT = 4096  # bytes: most of these objects have at most 4, but some are strings
SMALL_TIMEOUT = 5.0  # [s] per object
OBJECT_MISSING = frozenset((0x0602_0000, 0x0609_0011))  # no such object, no such subindex


def upload(
    channel: MailboxChannel,
    index: int,
    subindex: int,
    *,
    complete_access: bool = False,
    limit: int = UPLOAD_LIMIT,
    timeout: float = UPLOAD_TIMEOUT,
) -> Procedure[bytes]:
    """Read one object.

    Args:
        channel: The mailbox of the device.
        index: The index of the object.
        subindex: The subindex of the entry.
        complete_access: True to read all subindices from `subindex` on.
        limit: Maximum size [bytes].
        timeout: Longest time of the whole transfer [s]. Each message also has its own deadline.

    Raises:
        SdoAbort: The device refuses the transfer.
        MailboxError: The device announces more than `limit` bytes, takes longer than `timeout`, or
            violates the protocol.
    """
    return exclusively(channel, _upload(channel, index, subindex, complete_access, limit, timeout))


def upload_small(channel: MailboxChannel, index: int, subindex: int) -> Procedure[bytes]:
    """Read one object for a scan or a plan, with the limit and the deadline of small objects.

    Args:
        channel: The mailbox of the device.
        index: The index of the object.
        subindex: The subindex of the entry.

    Raises:
        SdoAbort: The device refuses the transfer.
        MailboxError: The object has more than `SMALL_LIMIT` bytes, or takes longer than
            `SMALL_TIMEOUT`.
    """
    return upload(channel, index, subindex, limit=SMALL_LIMIT, timeout=SMALL_TIMEOUT)


def _upload(
    channel: MailboxChannel,
    index: int,
    subindex: int,
    complete_access: bool,
    limit: int,
    timeout: float,
) -> Procedure[bytes]:
    first = yield from _ask(
        channel,
        UploadRequest(index, subindex, complete_access),
        UploadResponse,
        (index, subindex),
        lambda message: (message.index, message.subindex) == (index, subindex),
    )
    if first.expedited or len(first.data) >= first.size:
        return first.data
    if first.size > limit:
        yield from send_only(channel, Type.COE, Abort(index, subindex, ABORT_MEMORY).encode())
        raise MailboxError(
            f"{channel.station}: SDO 0x{index:04X}:{subindex:02X} announces {first.size} bytes, "
            f"the limit is {limit}",
            hint="if the object is that large, increase the limit; else its firmware is at fault",
        )
    return (yield from _upload_segments(channel, first, timeout))


def _upload_segments(
    channel: MailboxChannel, first: UploadResponse, timeout: float
) -> Procedure[bytes]:
    """Read the segments of an object after its first response, ETG.1000.6 §5.6.2.6."""
    index, subindex = first.index, first.subindex
    data = bytearray(first.data)
    toggle, last = False, False
    deadline = Deadline(timeout)
    while not last:
        if deadline.passed_at(channel.received_ns):
            yield from send_only(channel, Type.COE, Abort(index, subindex, ABORT_TIMEOUT).encode())
            raise _too_slow(channel, (index, subindex), len(data), first.size, timeout)
        segment = yield from _ask(
            channel, UploadSegmentRequest(toggle), UploadSegment, (index, subindex)
        )
        if segment.toggle != toggle:
            raise (yield from _break_off(channel, index, subindex, ABORT_TOGGLE))
        # More data than announced is refused, less is not, as in IgH (fsm_coe.c). SOEM allows both.
        if not (segment.data or segment.last) or len(data) + len(segment.data) > first.size:
            raise (yield from _break_off(channel, index, subindex, ABORT_LENGTH))
        data += segment.data
        toggle, last = not toggle, segment.last
    return bytes(data)


def _too_slow(
    channel: MailboxChannel, place: tuple[int, int], received: int, size: int, timeout: float
) -> MailboxError:
    index, subindex = place
    return MailboxError(
        f"{channel.station}: SDO 0x{index:04X}:{subindex:02X}: received {received} of {size} bytes "
        f"within {timeout:g} s",
        hint="if the device is slow, read with a longer timeout",
    )


def download(
    channel: MailboxChannel,
    index: int,
    subindex: int,
    data: bytes,
    *,
    complete_access: bool = False,
) -> Procedure[None]:
    """Write one object.

    Args:
        channel: The mailbox of the device.
        index: The index of the object.
        subindex: The subindex of the entry.
        data: The bytes to write.
        complete_access: True to write all subindices from `subindex` on.

    Raises:
        SdoAbort: The device refuses the transfer.
        MailboxError: The device violates the protocol.
    """
    return exclusively(channel, _download(channel, index, subindex, data, complete_access))


def _download(
    channel: MailboxChannel, index: int, subindex: int, data: bytes, complete_access: bool
) -> Procedure[None]:
    room = channel.layout.receive_size - INITIATE_OVERHEAD
    expedited = 0 < len(data) <= EXPEDITED_MAXIMUM and not complete_access
    sent = len(data) if expedited else min(len(data), room)
    yield from _ask(
        channel,
        DownloadRequest(index, subindex, data[:sent], len(data), expedited, complete_access),
        DownloadResponse,
        (index, subindex),
        lambda message: (message.index, message.subindex) == (index, subindex),
    )
    toggle = False
    room = channel.layout.receive_size - SEGMENT_OVERHEAD
    while sent < len(data):
        part = data[sent : sent + room]
        sent += len(part)
        answer = yield from _ask(
            channel,
            DownloadSegment(toggle, sent == len(data), part),
            DownloadSegmentResponse,
            (index, subindex),
        )
        if answer.toggle != toggle:
            raise (yield from _break_off(channel, index, subindex, ABORT_TOGGLE))
        toggle = not toggle


def _ask(
    channel: MailboxChannel,
    request: UploadRequest | UploadSegmentRequest | DownloadRequest | DownloadSegment,
    expected: type[T],
    place: tuple[int, int],
    matches: Callable[[T], bool] = lambda _: True,
) -> Procedure[T]:
    """Send one SDO request and return its answer. Raise SdoAbort if the device refuses it."""

    def accept(mailbox: Mailbox) -> T | Abort | None:
        message = decoded(channel, mailbox)
        if isinstance(message, Abort):
            # Do not compare the object: some devices return no index, or a different one. Only one
            # service runs at a time. SOEM (ecx_SDOread) and IgH (fsm_coe.c) also do not compare it.
            return message
        return message if isinstance(message, expected) and matches(message) else None

    talk: Procedure[T | Abort] = converse(channel, Type.COE, request.encode(), accept)
    answer = yield from talk
    if isinstance(answer, Abort):
        raise refused(channel, *place, answer.code)
    return answer


def decoded(channel: MailboxChannel, mailbox: Mailbox) -> Message | None:
    """Decode a CoE message; return None if the mailbox message has another protocol.

    Args:
        channel: The mailbox of the device, for errors.
        mailbox: The mailbox message.

    Raises:
        MailboxError: The message is invalid.
    """
    if mailbox.type is not Type.COE:
        return None
    try:
        return decode_coe(mailbox.data)
    except DecodeError as error:
        raise MailboxError(
            f"{channel.station}: invalid CoE message: {error}",
            hint="its firmware is at fault; record a capture of the start-up to see the bytes",
        ) from error


def _break_off(
    channel: MailboxChannel, index: int, subindex: int, code: int
) -> Procedure[MailboxError]:
    """Abort a transfer, and return the error for the caller to raise.

    An abort is not answered. The device receives it unless the frame is lost.
    """
    yield from send_only(channel, Type.COE, Abort(index, subindex, code).encode())
    return MailboxError(
        f"{channel.station}: SDO 0x{index:04X}:{subindex:02X}: a segment violates the protocol "
        f"({abort_code(code).text})",
        hint="its firmware is at fault, or a second master accesses it",
    )


def refused(
    channel: MailboxChannel, index: int, subindex: int, code: int | None, *, what: str = ""
) -> SdoAbort:
    """Return the error for an abort code.

    Args:
        channel: The mailbox of the device.
        index: The index of the object.
        subindex: The subindex of the entry.
        code: The abort code; None if it is missing or incomplete. The error then has code 0.
        what: Name of the refused access; empty for an SDO to the object.
    """
    known = abort_code(code or 0)
    why = "without an abort code" if code is None else f"with 0x{code:08X}: {known.text}"
    return SdoAbort(
        f"{channel.station}: {what or f'SDO 0x{index:04X}:{subindex:02X}'} refused {why}",
        position=channel.station.position,
        index=index,
        subindex=subindex,
        code=code or 0,
        hint=known.hint or "the manual of the device lists its objects",
    )
