"""SDO transfers and SDO information services from the messages of one mailbox."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from catenary.capture.contents import Content
from catenary.capture.mailbox_contents import SdoInformationRead, SdoTransfer
from catenary.wire.coe import (
    Abort,
    DownloadRequest,
    DownloadResponse,
    DownloadSegment,
    DownloadSegmentResponse,
    Message,
    UploadRequest,
    UploadResponse,
    UploadSegment,
)
from catenary.wire.sdo_information import Opcode, SdoInformation, decode_error

MAXIMUM_VALUE = 1 << 24  # bytes kept of a segmented transfer


@dataclass(slots=True)
class _Pending:
    """Owner of a transfer that is not complete."""

    request: DownloadRequest | UploadRequest
    started_ns: int
    size: int  # of the whole value
    data: bytearray = field(default_factory=bytearray)
    segments: int = 0
    last_sent: bool = False

    def add(self, data: bytes) -> None:
        self.data += data[: MAXIMUM_VALUE - len(self.data)]

    def add_segment(self, data: bytes) -> None:
        self.add(data)
        self.segments += 1

    def finished(self, time_ns: int | None, abort: int | None = None) -> SdoTransfer:
        """Return the transfer; without a time, it was not answered."""
        writes = isinstance(self.request, DownloadRequest)
        lacks_segments = writes and abort is None and len(self.data) < self.size
        return SdoTransfer(
            writes,
            self.request.index,
            self.request.subindex,
            bytes(self.data),
            self.request.complete_access,
            abort,
            answered=time_ns is not None and not lacks_segments,
            segments=self.segments,
            duration_ns=None if time_ns is None else time_ns - self.started_ns,
        )


class SdoFollower:
    """Owner of the unfinished SDO services of one device."""

    def __init__(self) -> None:
        self._transfer: _Pending | None = None
        self._query: SdoInformationRead | None = None
        self._size = 0  # of the joined fragments

    def request(self, message: Message, time_ns: int) -> Iterator[Content]:
        """Follow a message to the device."""
        if isinstance(message, DownloadRequest | UploadRequest):
            yield from self.unanswered()
            size = message.size if isinstance(message, DownloadRequest) else 0
            self._transfer = _Pending(message, time_ns, size)
            if isinstance(message, DownloadRequest):
                self._transfer.add(message.data)
        elif isinstance(message, DownloadSegment) and self._transfer:
            self._transfer.add_segment(message.data)
            self._transfer.last_sent = message.last
        elif isinstance(message, Abort):
            yield from self._finish(time_ns, message.code)
        elif isinstance(message, SdoInformation):
            yield from self.unanswered()
            self._query, self._size = _query(message), 0

    def response(self, message: Message, time_ns: int) -> Iterator[Content]:
        """Follow a message from the device."""
        transfer = self._transfer
        if isinstance(message, SdoInformation):
            yield from self._information(message)
        elif transfer is not None and _is_late(message, transfer.request):
            return
        elif isinstance(message, Abort):
            yield from self._abort(message, time_ns)
        elif transfer is None:
            return
        elif isinstance(message, DownloadResponse):
            if len(transfer.data) >= min(transfer.size, MAXIMUM_VALUE):
                yield from self._finish(time_ns)
        elif isinstance(message, DownloadSegmentResponse):
            if transfer.last_sent:
                yield from self._finish(time_ns)
        elif isinstance(message, UploadResponse):
            transfer.size = message.size
            transfer.add(message.data)
            if len(message.data) >= message.size:
                yield from self._finish(time_ns)
        elif isinstance(message, UploadSegment):
            transfer.add_segment(message.data)
            if message.last:
                yield from self._finish(time_ns)

    def unanswered(self) -> Iterator[Content]:
        """Yield the services that were not answered, and forget them."""
        yield from self._finish(None)
        if self._query:
            yield SdoInformationRead(
                self._query.opcode, self._query.index, self._query.subindex, answered=False
            )
            self._query = None

    def _finish(self, time_ns: int | None, abort: int | None = None) -> Iterator[Content]:
        if self._transfer:
            yield self._transfer.finished(time_ns, abort)
            self._transfer = None

    def _abort(self, message: Abort, time_ns: int) -> Iterator[Content]:
        if self._query and not self._transfer:
            yield self._answered(self._query, message.code)
        yield from self._finish(time_ns, message.code)

    def _information(self, message: SdoInformation) -> Iterator[Content]:
        if self._query is None:
            return
        if message.opcode is Opcode.ERROR:
            yield self._answered(self._query, decode_error(message.data))
            return
        self._size += len(message.data)
        if not message.incomplete:
            yield self._answered(self._query, None)

    def _answered(self, query: SdoInformationRead, abort: int | None) -> SdoInformationRead:
        self._query = None
        return SdoInformationRead(query.opcode, query.index, query.subindex, self._size, abort)


def _is_late(message: Message, request: DownloadRequest | UploadRequest) -> bool:
    """Return True for an answer to another request: one that was given up, or was not captured."""
    if not isinstance(message, DownloadResponse | UploadResponse | Abort):
        return False
    if isinstance(message, DownloadResponse) and not isinstance(request, DownloadRequest):
        return True
    if isinstance(message, UploadResponse) and not isinstance(request, UploadRequest):
        return True
    # Some devices abort a segment with index 0.
    is_nameless = isinstance(message, Abort) and not message.index
    place = (message.index, message.subindex)
    return not is_nameless and place != (request.index, request.subindex)


def _query(message: SdoInformation) -> SdoInformationRead:
    index = int.from_bytes(message.data[:2], "little")
    subindex = message.data[2] if message.opcode is Opcode.ENTRY_REQUEST and message.data[2:] else 0
    return SdoInformationRead(message.opcode, index, subindex)
