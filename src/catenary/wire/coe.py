"""CANopen over EtherCAT, ETG.1000.6 §5.6: CoE header, SDO services, emergency.

Every message is a frozen value with `encode()`. `decode_coe` decodes the data of a mailbox
message. SDO information messages are in sdo_information.py.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import TypeAlias

from catenary.errors import DecodeError
from catenary.wire.sdo_information import SdoInformation, decode_sdo_information

HEADER_SIZE = 2
SDO_SIZE = 10  # the shortest SDO message: CoE header, command, index, subindex, 4 bytes of data
SEGMENT_HEADER_SIZE = 3  # CoE header, command
SEGMENT_MINIMUM = 7  # a segment has at least 7 bytes of data, padded with zeros
EXPEDITED_MAXIMUM = 4


class Service(IntEnum):
    """The service in the CoE header (bits 12 to 15)."""

    EMERGENCY = 1
    SDO_REQUEST = 2
    SDO_RESPONSE = 3
    TXPDO = 4
    RXPDO = 5
    TXPDO_REMOTE_REQUEST = 6
    RXPDO_REMOTE_REQUEST = 7
    SDO_INFORMATION = 8


_SDO = struct.Struct("<HBHB4s")
_SEGMENT = struct.Struct("<HB")
_EMERGENCY = struct.Struct("<HHB5s")

_SIZE_GIVEN = 0x01
_EXPEDITED = 0x02
_COMPLETE_ACCESS = 0x10
_TOGGLE = 0x10
_LAST_SEGMENT = 0x01

# Command specifiers of the client and of the server, bits 5 to 7 of the command
_DOWNLOAD_SEGMENT, _DOWNLOAD, _UPLOAD, _UPLOAD_SEGMENT, _ABORT = range(5)
_SERVER_UPLOAD_SEGMENT, _SERVER_DOWNLOAD_SEGMENT, _SERVER_UPLOAD, _SERVER_DOWNLOAD = range(4)


def _header(service: Service) -> int:
    return service << 12


def _pack_sdo(
    service: Service, command: int, index: int, subindex: int, last: bytes = b"", rest: bytes = b""
) -> bytes:
    try:
        return _SDO.pack(_header(service), command, index, subindex, last) + rest
    except struct.error as error:
        raise ValueError(f"SDO 0x{index:X}:{subindex}: {error}") from None


def _pack_initiate(
    service: Service, specifier: int, message: DownloadRequest | UploadResponse
) -> bytes:
    """Return an initiate message: up to 4 bytes of data (expedited), or size and data (normal)."""
    command = specifier << 5 | _SIZE_GIVEN
    command |= _COMPLETE_ACCESS if message.complete_access else 0
    size, data = message.size, message.data
    if message.expedited:
        if not 1 <= len(data) <= EXPEDITED_MAXIMUM or size != len(data):
            raise ValueError(
                f"expedited SDO: needs the whole data, 1 to 4 bytes; got {len(data)} of {size}"
            )
        command |= _EXPEDITED | (EXPEDITED_MAXIMUM - size) << 2
        return _pack_sdo(service, command, message.index, message.subindex, data)
    if not len(data) <= size <= 0xFFFF_FFFF:
        raise ValueError(f"SDO: the complete size is {size} bytes, but the message has {len(data)}")
    size_bytes = size.to_bytes(4, "little")
    return _pack_sdo(service, command, message.index, message.subindex, size_bytes, data)


@dataclass(frozen=True, slots=True)
class DownloadRequest:
    """Initiate download request, §5.6.2.1 and §5.6.2.2. It writes an object.

    `size` is the size of the whole object. If `data` is shorter, segments with the rest follow.
    """

    index: int
    subindex: int
    data: bytes
    size: int
    expedited: bool = False
    complete_access: bool = False

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        return _pack_initiate(Service.SDO_REQUEST, _DOWNLOAD, self)


@dataclass(frozen=True, slots=True)
class DownloadResponse:
    """Initiate download response, §5.6.2.1 and §5.6.2.2."""

    index: int
    subindex: int
    complete_access: bool = False

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        command = _SERVER_DOWNLOAD << 5 | (_COMPLETE_ACCESS if self.complete_access else 0)
        return _pack_sdo(Service.SDO_RESPONSE, command, self.index, self.subindex)


@dataclass(frozen=True, slots=True)
class UploadRequest:
    """Initiate upload request, §5.6.2.4 and §5.6.2.5. It reads an object."""

    index: int
    subindex: int
    complete_access: bool = False

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        command = _UPLOAD << 5 | (_COMPLETE_ACCESS if self.complete_access else 0)
        return _pack_sdo(Service.SDO_REQUEST, command, self.index, self.subindex)


@dataclass(frozen=True, slots=True)
class UploadResponse:
    """Initiate upload response, §5.6.2.4 and §5.6.2.5.

    `size` is the size of the whole object. If `data` is shorter, segments with the rest follow.
    """

    index: int
    subindex: int
    data: bytes
    size: int
    expedited: bool = False
    complete_access: bool = False

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        return _pack_initiate(Service.SDO_RESPONSE, _SERVER_UPLOAD, self)


def _pack_segment(
    service: Service, specifier: int, message: DownloadSegment | UploadSegment
) -> bytes:
    """Return a segment, §5.6.2.3. Short data is padded; the command holds the padding length."""
    command = specifier << 5 | (_TOGGLE if message.toggle else 0)
    command |= _LAST_SEGMENT if message.last else 0
    missing = max(SEGMENT_MINIMUM - len(message.data), 0)
    head = _SEGMENT.pack(_header(service), command | missing << 1)
    return head + message.data.ljust(SEGMENT_MINIMUM, b"\x00")


@dataclass(frozen=True, slots=True)
class DownloadSegment:
    """Download segment request, §5.6.2.3. `toggle` is False in the first segment."""

    toggle: bool
    last: bool
    data: bytes

    def encode(self) -> bytes:
        """Return the encoded bytes."""
        return _pack_segment(Service.SDO_REQUEST, _DOWNLOAD_SEGMENT, self)


@dataclass(frozen=True, slots=True)
class DownloadSegmentResponse:
    """Download segment response, §5.6.2.3."""

    toggle: bool

    def encode(self) -> bytes:
        """Return the encoded bytes."""
        command = _SERVER_DOWNLOAD_SEGMENT << 5 | (_TOGGLE if self.toggle else 0)
        return _pack_sdo(Service.SDO_RESPONSE, command, 0, 0)


@dataclass(frozen=True, slots=True)
class UploadSegmentRequest:
    """Upload segment request, §5.6.2.6. `toggle` is False in the first segment."""

    toggle: bool

    def encode(self) -> bytes:
        """Return the encoded bytes."""
        command = _UPLOAD_SEGMENT << 5 | (_TOGGLE if self.toggle else 0)
        return _pack_sdo(Service.SDO_REQUEST, command, 0, 0)


@dataclass(frozen=True, slots=True)
class UploadSegment:
    """Upload segment response, §5.6.2.6."""

    toggle: bool
    last: bool
    data: bytes

    def encode(self) -> bytes:
        """Return the encoded bytes."""
        return _pack_segment(Service.SDO_RESPONSE, _SERVER_UPLOAD_SEGMENT, self)


@dataclass(frozen=True, slots=True)
class Abort:
    """Abort SDO transfer, §5.6.2.7. It is an SDO request in both directions.

    The meanings of the codes are in abort.py.
    """

    index: int
    subindex: int
    code: int

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        if not 0 <= self.code <= 0xFFFF_FFFF:
            raise ValueError(f"SDO abort: code {self.code} does not fit into 32 bits")
        code = self.code.to_bytes(4, "little")
        return _pack_sdo(Service.SDO_REQUEST, _ABORT << 5, self.index, self.subindex, code)


@dataclass(frozen=True, slots=True)
class Emergency:
    """Emergency message of a device, §5.6.4. Error code 0 means that the fault is cleared."""

    error_code: int
    error_register: int
    data: bytes = bytes(5)

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        if len(self.data) != 5:
            raise ValueError(f"emergency: needs 5 bytes of data, got {len(self.data)}")
        try:
            return _EMERGENCY.pack(
                _header(Service.EMERGENCY), self.error_code, self.error_register, self.data
            )
        except struct.error as error:
            raise ValueError(f"emergency: {error}") from None


Request: TypeAlias = (
    DownloadRequest | UploadRequest | DownloadSegment | UploadSegmentRequest | Abort
)
Response: TypeAlias = (
    DownloadResponse | UploadResponse | DownloadSegmentResponse | UploadSegment | Abort
)
Message: TypeAlias = Request | Response | Emergency | SdoInformation


def decode_coe(data: bytes) -> Message:
    """Decode the CoE message in the data of a mailbox message.

    Raises:
        DecodeError: The message is invalid, or it is a PDO service. PDO services over the mailbox
            are not supported; they are not used in practice.
    """
    if len(data) < HEADER_SIZE:
        raise DecodeError(f"CoE header: needs {HEADER_SIZE} bytes, received {len(data)}")
    service = int.from_bytes(data[:HEADER_SIZE], "little") >> 12
    if service == Service.SDO_REQUEST:
        return _decode_request(data)
    if service == Service.SDO_RESPONSE:
        return _decode_response(data)
    if service == Service.SDO_INFORMATION:
        return decode_sdo_information(data)
    if service == Service.EMERGENCY:
        return _decode_emergency(data)
    raise DecodeError(f"CoE: service {service} is not supported")


def _decode_request(data: bytes) -> Request:
    command, index, subindex, last, rest = _unpack_sdo(data)
    specifier, complete_access = command >> 5, bool(command & _COMPLETE_ACCESS)
    if specifier == _DOWNLOAD_SEGMENT:
        return DownloadSegment(bool(command & _TOGGLE), *_unpack_segment(command, data))
    if specifier == _DOWNLOAD:
        payload, size, expedited = _unpack_initiate(command, last, rest)
        return DownloadRequest(index, subindex, payload, size, expedited, complete_access)
    if specifier == _UPLOAD:
        return UploadRequest(index, subindex, complete_access)
    if specifier == _UPLOAD_SEGMENT:
        return UploadSegmentRequest(bool(command & _TOGGLE))
    if specifier == _ABORT:
        return Abort(index, subindex, int.from_bytes(last, "little"))
    raise DecodeError(f"SDO request: unknown command specifier {specifier}")


def _decode_response(data: bytes) -> Response:
    command, index, subindex, last, rest = _unpack_sdo(data)
    specifier, complete_access = command >> 5, bool(command & _COMPLETE_ACCESS)
    if specifier == _SERVER_UPLOAD_SEGMENT:
        return UploadSegment(bool(command & _TOGGLE), *_unpack_segment(command, data))
    if specifier == _SERVER_DOWNLOAD_SEGMENT:
        return DownloadSegmentResponse(bool(command & _TOGGLE))
    if specifier == _SERVER_UPLOAD:
        payload, size, expedited = _unpack_initiate(command, last, rest)
        return UploadResponse(index, subindex, payload, size, expedited, complete_access)
    if specifier == _SERVER_DOWNLOAD:
        return DownloadResponse(index, subindex, complete_access)
    if specifier == _ABORT:  # some devices send the abort as a response
        return Abort(index, subindex, int.from_bytes(last, "little"))
    raise DecodeError(f"SDO response: unknown command specifier {specifier}")


def _unpack_sdo(data: bytes) -> tuple[int, int, int, bytes, bytes]:
    if len(data) < SDO_SIZE:
        raise DecodeError(f"SDO: needs {SDO_SIZE} bytes, received {len(data)}")
    _, command, index, subindex, last = _SDO.unpack_from(data)
    return command, index, subindex, last, bytes(data[SDO_SIZE:])


def _unpack_initiate(command: int, last: bytes, rest: bytes) -> tuple[bytes, int, bool]:
    if command & _EXPEDITED:
        missing = command >> 2 & 3 if command & _SIZE_GIVEN else 0
        payload = last[: EXPEDITED_MAXIMUM - missing]
        return payload, len(payload), True
    size = int.from_bytes(last, "little")
    # Ignore bytes beyond the size: a message may be longer than its data.
    return rest[:size], size, False


def _unpack_segment(command: int, data: bytes) -> tuple[bool, bytes]:
    payload = bytes(data[_SEGMENT.size :])
    missing = command >> 1 & 7
    if missing:
        payload = payload[: SEGMENT_MINIMUM - missing]
    return bool(command & _LAST_SEGMENT), payload


def _decode_emergency(data: bytes) -> Emergency:
    if len(data) < _EMERGENCY.size:
        raise DecodeError(f"emergency: needs {_EMERGENCY.size} bytes, received {len(data)}")
    _, error_code, error_register, payload = _EMERGENCY.unpack_from(data)
    return Emergency(error_code, error_register, payload)
