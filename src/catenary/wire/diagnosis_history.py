"""Diagnosis history of a device, ETG.1020 §13: object 0x10F3, its messages, and 0x10F8.

A message has a header of 16 bytes and parameters. Devices with messages of a fixed size append
zeros. No dissector decodes these objects. The layout agrees with Beckhoff's slave stack code
(diag.h, TDIAGMESSAGE), and with the manuals of WAGO 765-1205 (table 66) and Beckhoff ELM3xxx.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum, IntFlag

from catenary.errors import DecodeError

HISTORY = 0x10F3
HIGHEST_SUBINDEX, MAXIMUM, NEWEST, ACKNOWLEDGED, AVAILABLE, FLAGS = range(6)  # subindices
FIRST_MESSAGE = 6  # subindex
MESSAGES_MAX = 250  # subindices 6 to 255
TIMESTAMP = 0x10F8  # present time of the device [ns]
CLEAR = 0  # value of ACKNOWLEDGED that deletes messages

EMERGENCY_CODE = 0xE800  # low word of a code; the high word is then an emergency error code

_HEADER = struct.Struct("<IHHQ")
_TYPE_MASK = 0x000F
_LOCAL_TIME = 0x0010
_COUNT_SHIFT = 8
_KIND_SHIFT = 12
_SIZE_MASK = 0x0FFF
_PARAMETER = struct.Struct("<H")
_TEXT_ID_SIZE = 2

# Data types of parameters, ETG.1020: number → struct format
_FORMATS = {
    0x0001: "<?",  # BOOLEAN
    0x0002: "<b",
    0x0003: "<h",
    0x0004: "<i",
    0x0005: "<B",
    0x0006: "<H",
    0x0007: "<I",
    0x0008: "<f",  # REAL32
    0x0011: "<d",  # REAL64
    0x0015: "<q",
    0x001B: "<Q",
    0x001E: "<B",  # BYTE
    0x001F: "<H",  # WORD
    0x0020: "<I",  # DWORD
}


class DiagnosisType(IntEnum):
    """Severity of a message. Other numbers are reserved."""

    INFO = 0
    WARNING = 1
    ERROR = 2


class HistoryFlags(IntFlag):
    """Flags of the history, 0x10F3:05."""

    EMERGENCY = 0x01  # new messages are also sent as emergencies
    NO_INFO = 0x02  # infos are not stored
    NO_WARNINGS = 0x04
    NO_ERRORS = 0x08
    ACKNOWLEDGE_MODE = 0x10  # only acknowledged messages are overwritten
    OVERFLOW = 0x20  # messages were overwritten, or discarded in the acknowledge mode


class ParameterKind(IntEnum):
    """Kind of a parameter: bits 12 to 15 of its flags."""

    NUMBER = 0  # of the data type in bits 0 to 11
    BYTES = 1  # with the length in bits 0 to 11
    ASCII = 2
    UNICODE = 3
    TEXT_ID = 4  # number of another text


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of a message. `data_type` is 0 unless the kind is NUMBER."""

    kind: ParameterKind
    data: bytes
    data_type: int = 0

    @property
    def value(self) -> int | float | str | bytes:
        """Value of the parameter; the bytes if no other form is known."""
        if self.kind is ParameterKind.ASCII:
            return self.data.rstrip(b"\0").decode("latin-1")
        if self.kind is ParameterKind.UNICODE:
            return self.data.decode("utf-16-le", "replace").rstrip("\0")
        if self.kind is ParameterKind.TEXT_ID:
            return int.from_bytes(self.data, "little")
        if self.kind is ParameterKind.NUMBER:
            number: int | float = struct.unpack(_FORMATS[self.data_type], self.data)[0]
            return int(number) if isinstance(number, bool) else number
        return self.data

    def encode(self) -> bytes:
        """Return the flags and the data. Raises ValueError if a field does not fit."""
        if self.kind is ParameterKind.NUMBER:
            size = _size_of(self.data_type)
            if size != len(self.data):
                raise ValueError(
                    f"diagnosis parameter of type 0x{self.data_type:04X}: needs {size} bytes, "
                    f"got {len(self.data)}"
                )
            detail = self.data_type
        else:
            detail = len(self.data)
        if detail > _SIZE_MASK:
            raise ValueError(f"diagnosis parameter: {detail} does not fit into 12 bits")
        return _PARAMETER.pack(self.kind << _KIND_SHIFT | detail) + self.data


@dataclass(frozen=True, slots=True)
class DiagnosisMessage:
    """One message of the history. `rest` holds bytes after the parameters that were decoded."""

    code: int  # 32 bits
    type: int  # a DiagnosisType, or a reserved number
    text_id: int  # text in the ESI of the device; 0: none
    time_ns: int  # 0: no time
    local_time: bool = False  # False: time of the distributed clocks
    parameters: tuple[Parameter, ...] = ()
    count: int = 0  # number of parameters that the message announces; 0: those in `parameters`
    rest: bytes = b""

    @property
    def error_code(self) -> int | None:
        """Emergency error code in the diagnosis code; None if it has none."""
        return self.code >> 16 if self.code & 0xFFFF == EMERGENCY_CODE else None

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        count = self.count or len(self.parameters)
        flags = self.type | (_LOCAL_TIME if self.local_time else 0) | count << _COUNT_SHIFT
        try:
            head = _HEADER.pack(self.code, flags, self.text_id, self.time_ns)
        except struct.error as error:
            raise ValueError(f"diagnosis message: {error}") from None
        return head + b"".join(each.encode() for each in self.parameters) + self.rest


def decode_diagnosis_message(data: bytes) -> DiagnosisMessage:
    """Decode one message of the history.

    If a parameter is unknown or truncated, it and the following bytes are the `rest`. Zeros after
    the last parameter are dropped.

    Raises:
        DecodeError: The message is shorter than its header.
    """
    if len(data) < _HEADER.size:
        raise DecodeError(f"diagnosis message: needs {_HEADER.size} bytes, received {len(data)}")
    code, flags, text_id, time_ns = _HEADER.unpack_from(data)
    count = flags >> _COUNT_SHIFT
    parameters = tuple(_parameters(data, count))
    size = _HEADER.size + sum(_PARAMETER.size + len(each.data) for each in parameters)
    return DiagnosisMessage(
        code=code,
        type=flags & _TYPE_MASK,
        text_id=text_id,
        time_ns=time_ns,
        local_time=bool(flags & _LOCAL_TIME),
        parameters=parameters,
        count=0 if count == len(parameters) else count,
        rest=bytes(data[size:]).rstrip(b"\0"),
    )


def is_empty(data: bytes) -> bool:
    """Return True if a subindex holds no message: no bytes, or only zeros."""
    return not any(data)


def _parameters(data: bytes, count: int) -> Iterator[Parameter]:
    """Yield at most `count` parameters. Stop at one that is unknown or truncated."""
    at = _HEADER.size
    for _ in range(count):
        if at + _PARAMETER.size > len(data):
            return
        [flags] = _PARAMETER.unpack_from(data, at)
        found = _parameter(flags, bytes(data[at + _PARAMETER.size :]))
        if found is None:
            return
        yield found
        at += _PARAMETER.size + len(found.data)


def _parameter(flags: int, data: bytes) -> Parameter | None:
    detail = flags & _SIZE_MASK
    try:
        kind = ParameterKind(flags >> _KIND_SHIFT)
    except ValueError:
        return None
    if kind is ParameterKind.NUMBER:
        if detail not in _FORMATS:
            return None
        size = _size_of(detail)
    else:
        size = detail or (_TEXT_ID_SIZE if kind is ParameterKind.TEXT_ID else 0)
    if size > len(data):
        return None
    return Parameter(kind, data[:size], detail if kind is ParameterKind.NUMBER else 0)


def _size_of(data_type: int) -> int:
    if data_type not in _FORMATS:
        raise ValueError(f"diagnosis parameter: unknown data type 0x{data_type:04X}")
    return struct.calcsize(_FORMATS[data_type])
