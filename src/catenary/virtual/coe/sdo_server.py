"""SDO server, ETG.1000.6 §5.6.2: expedited, normal and segmented transfers, complete access, abort.

The code is independent of `catenary.wire.coe`, the client side.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass

from catenary.virtual.coe.dictionary import (
    NO_COMPLETE_ACCESS,
    TOGGLE,
    TOO_LONG,
    TOO_SHORT,
    UNKNOWN_COMMAND,
    WRONG_LENGTH,
    Abort,
    Dictionary,
)
from catenary.virtual.coe.quirks import NO_MAILBOX_QUIRKS, MailboxQuirks

SDO_REQUEST, SDO_RESPONSE = 2, 3
COE_HEADER = 2
SDO_HEADER = 8  # command, index, subindex, size or data
SEGMENT_HEADER = 1
DOWNLOAD_SEGMENT, DOWNLOAD, UPLOAD, UPLOAD_SEGMENT, ABORT = 0, 1, 2, 3, 4
UNSUPPORTED_ACCESS = 0x06010000
OUT_OF_MEMORY = 0x05040005
DOWNLOAD_MAX = 1 << 20


@dataclass(slots=True)
class _Transfer:
    """Progress of a segmented transfer."""

    index: int
    subindex: int
    complete: bool
    download: bool
    size: int
    data: bytes
    toggle: int = 0


def _coe(payload: bytes) -> bytes:
    return struct.pack("<H", SDO_RESPONSE << 12) + payload


def _aborted(index: int, subindex: int, code: int) -> bytes:
    return struct.pack("<HBHBI", SDO_REQUEST << 12, 0x80, index, subindex, code)


class SdoServer:
    """SDO server of a device, with its active transfer.

    `size`: mailbox size without its header [bytes].
    """

    def __init__(
        self,
        dictionary: Dictionary,
        *,
        size: int,
        complete_access: bool = True,
        quirks: MailboxQuirks = NO_MAILBOX_QUIRKS,
    ) -> None:
        self._dictionary = dictionary
        self._complete_access = complete_access
        self._drip = quirks.drip
        self._room = size - COE_HEADER
        self._transfer: _Transfer | None = None

    def serve(self, payload: bytes) -> Iterable[bytes]:
        """Return the answers to one SDO request. `payload`: the request without its CoE header."""
        command, index, subindex = struct.unpack_from("<BHB", payload.ljust(SDO_HEADER, b"\0"))
        kind = command >> 5
        if kind in (DOWNLOAD_SEGMENT, UPLOAD_SEGMENT) and self._transfer is not None:
            index, subindex = self._transfer.index, self._transfer.subindex
        try:
            if kind == DOWNLOAD:
                return [self._download(payload, command, index, subindex)]
            if kind == DOWNLOAD_SEGMENT:
                return [self._download_segment(payload, command)]
            if kind == UPLOAD:
                return [self._upload(command, index, subindex)]
            if kind == UPLOAD_SEGMENT:
                return [self._upload_segment(command)]
            self._transfer = None
            return [] if kind == ABORT else [_aborted(index, subindex, UNKNOWN_COMMAND)]
        except Abort as abort:
            self._transfer = None
            return [_aborted(index, subindex, abort.code)]

    def _check_complete(self, complete: bool, subindex: int) -> None:
        if complete and not self._complete_access:
            raise Abort(UNSUPPORTED_ACCESS)
        if complete and subindex > 1:
            raise Abort(NO_COMPLETE_ACCESS)

    def _store(self, index: int, subindex: int, complete: bool, data: bytes) -> None:
        if complete:
            self._dictionary.write_complete(index, subindex, data)
        else:
            self._dictionary.write(index, subindex, data)

    def _fetch(self, index: int, subindex: int, complete: bool) -> bytes:
        if complete:
            return self._dictionary.read_complete(index, subindex)
        return self._dictionary.read(index, subindex)

    def _download(self, payload: bytes, command: int, index: int, subindex: int) -> bytes:
        self._transfer = None
        complete, expedited, sized = bool(command & 0x10), bool(command & 2), bool(command & 1)
        self._check_complete(complete, subindex)
        if len(payload) < SDO_HEADER:
            raise Abort(WRONG_LENGTH)
        if expedited:
            unused = command >> 2 & 3 if sized else 0
            self._store(index, subindex, complete, payload[4 : 8 - unused])
        else:
            self._begin_download(payload, index, subindex, complete)
        return _coe(struct.pack("<BHB4x", 0x60, index, subindex))

    def _begin_download(self, payload: bytes, index: int, subindex: int, complete: bool) -> None:
        [size] = struct.unpack_from("<I", payload, 4)
        data = payload[SDO_HEADER:]
        if size > DOWNLOAD_MAX:
            raise Abort(OUT_OF_MEMORY)
        if not complete:
            self._dictionary.entry(index, subindex)
        if len(data) >= size:
            self._store(index, subindex, complete, data[:size])
            return
        self._transfer = _Transfer(index, subindex, complete, True, size, data)

    def _segment(self, command: int, *, download: bool) -> _Transfer:
        transfer = self._transfer
        if transfer is None or transfer.download is not download:
            raise Abort(UNKNOWN_COMMAND)
        if command >> 4 & 1 != transfer.toggle:
            raise Abort(TOGGLE)
        transfer.toggle ^= 1
        return transfer

    def _download_segment(self, payload: bytes, command: int) -> bytes:
        transfer = self._segment(command, download=True)
        data = payload[SEGMENT_HEADER:]
        if len(data) <= 7:
            data = data[: 7 - (command >> 1 & 7)]
        transfer.data += data
        if len(transfer.data) > transfer.size:
            raise Abort(TOO_LONG)
        if command & 1:
            if len(transfer.data) < transfer.size:
                raise Abort(TOO_SHORT)
            self._transfer = None
            self._store(transfer.index, transfer.subindex, transfer.complete, transfer.data)
        return _coe(struct.pack("<B7x", 0x20 | (command & 0x10)))

    def _upload(self, command: int, index: int, subindex: int) -> bytes:
        self._transfer = None
        complete = bool(command & 0x10)
        self._check_complete(complete, subindex)
        data = self._fetch(index, subindex, complete)
        kept = command & 0x10
        if 0 < len(data) <= 4:
            flags = 0x43 | kept | (4 - len(data)) << 2
            return _coe(struct.pack("<BHB", flags, index, subindex) + data.ljust(4, b"\0"))
        room = self._room - SDO_HEADER
        if len(data) > room:
            self._transfer = _Transfer(index, subindex, complete, False, len(data), data[room:])
        head = struct.pack("<BHBI", 0x41 | kept, index, subindex, len(data))
        return _coe(head + data[:room])

    def _upload_segment(self, command: int) -> bytes:
        transfer = self._segment(command, download=False)
        room = 1 if self._drip else self._room - SEGMENT_HEADER
        part, transfer.data = transfer.data[:room], transfer.data[room:]
        last = not transfer.data
        if last:
            self._transfer = None
        unused = max(7 - len(part), 0)
        head = (command & 0x10) | unused << 1 | last
        return _coe(bytes([head]) + part.ljust(7, b"\0"))
