"""File access over EtherCAT (FoE), ETG.1000.6 §5.8.

Every message is a frozen value with `encode()`. `decode_foe` decodes the data of a mailbox message.
All messages start with the op-code, a reserved byte and 32 bits:

    op-code | reserved | password, packet number, error code or progress | name, data or text

Names and texts have one byte per character and no terminator.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple, TypeAlias

from catenary.errors import DecodeError

HEADER_SIZE = 6
FIRST_PACKET = 1  # number of the first data packet; packet 0 acknowledges a write request
_HEADER = struct.Struct("<BxI")
_BUSY = struct.Struct("<BxHH")


class OpCode(IntEnum):
    """Service of a message, ETG.1000.6 §5.8.2."""

    READ_REQUEST = 1
    WRITE_REQUEST = 2
    DATA = 3
    ACKNOWLEDGE = 4
    ERROR = 5
    BUSY = 6


class ErrorCode(IntEnum):
    """Code of an error message. Vendors use further codes."""

    NOT_DEFINED = 0x8000
    NOT_FOUND = 0x8001
    ACCESS_DENIED = 0x8002
    DISK_FULL = 0x8003
    ILLEGAL = 0x8004
    PACKET_NUMBER = 0x8005
    ALREADY_EXISTS = 0x8006
    NO_USER = 0x8007
    BOOTSTRAP_ONLY = 0x8008
    NOT_IN_BOOTSTRAP = 0x8009
    NO_RIGHTS = 0x800A
    PROGRAM_ERROR = 0x800B
    CHECKSUM = 0x800C
    WRONG_FIRMWARE = 0x800D
    NO_FILE = 0x800F
    NO_FILE_HEADER = 0x8010
    FLASH = 0x8011


class ErrorMeaning(NamedTuple):
    """Meaning of an error code, and the next step."""

    text: str
    hint: str = ""


# 0x8000 to 0x800B also in SOES (esc.h) and the SSC (ecatfoe.h); 0x800C to 0x8011 as TI's stack
# (ESL_foeDemo.h) lists them.
ERRORS: Mapping[int, ErrorMeaning] = {
    ErrorCode.NOT_DEFINED: ErrorMeaning("error without a defined cause"),
    ErrorCode.NOT_FOUND: ErrorMeaning(
        "file not found",
        "the manual of the device lists its file names; upper and lower case differ",
    ),
    ErrorCode.ACCESS_DENIED: ErrorMeaning(
        "access denied", "the file may be write-protected, or locked by local operation"
    ),
    ErrorCode.DISK_FULL: ErrorMeaning(
        "disk full",
        "the file is larger than the memory of the device: check that it is the right one",
    ),
    ErrorCode.ILLEGAL: ErrorMeaning(
        "illegal operation", "an earlier transfer may be incomplete: bring the device to INIT first"
    ),
    ErrorCode.PACKET_NUMBER: ErrorMeaning(
        "wrong packet number", "a second master may access the device: repeat the transfer"
    ),
    ErrorCode.ALREADY_EXISTS: ErrorMeaning("file already exists", "use another name"),
    ErrorCode.NO_USER: ErrorMeaning("no user"),
    ErrorCode.BOOTSTRAP_ONLY: ErrorMeaning(
        "access only in the state BOOT", "bring the device to BOOT first: --boot, or sub.boot()"
    ),
    ErrorCode.NOT_IN_BOOTSTRAP: ErrorMeaning(
        "file not accessible in the state BOOT",
        "check the name of the file (--name), or transfer it in PRE-OP",
    ),
    ErrorCode.NO_RIGHTS: ErrorMeaning(
        "no access rights, or wrong password", "the vendor provides the password (--password)"
    ),
    ErrorCode.PROGRAM_ERROR: ErrorMeaning("error of the program in the device"),
    ErrorCode.CHECKSUM: ErrorMeaning(
        "wrong checksum", "the file is damaged: obtain it from the vendor again"
    ),
    ErrorCode.WRONG_FIRMWARE: ErrorMeaning(
        "firmware does not fit the hardware", "obtain the firmware for this product and revision"
    ),
    ErrorCode.NO_FILE: ErrorMeaning("no file to read"),
    ErrorCode.NO_FILE_HEADER: ErrorMeaning(
        "file header missing or invalid", "the file is not a firmware file of this device"
    ),
    ErrorCode.FLASH: ErrorMeaning(
        "flash memory not accessible", "power-cycle the device; if it fails again, it is defective"
    ),
}
UNKNOWN_ERROR = ErrorMeaning("code of the vendor", "the manual of the device explains this code")


def error_meaning(code: int) -> ErrorMeaning:
    """Return the meaning of an error code; `UNKNOWN_ERROR` if the standard does not define it.

    Bit 15 may be missing, as in the definitions of Beckhoff's master sample and of Wireshark.
    """
    return ERRORS.get(code | 0x8000, UNKNOWN_ERROR)


def _pack(code: OpCode, number: int, rest: bytes) -> bytes:
    try:
        return _HEADER.pack(code, number) + rest
    except struct.error as error:
        raise ValueError(f"FoE {code.name}: {number} does not fit: {error}") from None


def _text_bytes(text: str) -> bytes:
    try:
        return text.encode("latin-1")
    except UnicodeEncodeError:
        raise ValueError(f"FoE: {text!r} has characters that do not fit into one byte") from None


@dataclass(frozen=True, slots=True)
class ReadRequest:
    """Request to read a file, §5.8.2."""

    name: str
    password: int = 0

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        return _pack(OpCode.READ_REQUEST, self.password, _text_bytes(self.name))


@dataclass(frozen=True, slots=True)
class WriteRequest:
    """Request to write a file, §5.8.3."""

    name: str
    password: int = 0

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        return _pack(OpCode.WRITE_REQUEST, self.password, _text_bytes(self.name))


@dataclass(frozen=True, slots=True)
class Data:
    """One packet of a file, §5.8.4. A packet that does not fill the mailbox is the last one."""

    packet: int
    data: bytes

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        return _pack(OpCode.DATA, self.packet, self.data)


@dataclass(frozen=True, slots=True)
class Acknowledge:
    """Acknowledgement of a packet, §5.8.5; packet 0 is the answer to a write request."""

    packet: int

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        return _pack(OpCode.ACKNOWLEDGE, self.packet, b"")


@dataclass(frozen=True, slots=True)
class Error:
    """End of a transfer, §5.8.6. `code` may be a value that the standard does not define."""

    code: int
    text: str = ""

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        return _pack(OpCode.ERROR, self.code, _text_bytes(self.text))


@dataclass(frozen=True, slots=True)
class Busy:
    """Request to repeat the last message later, §5.8.7.

    `done` of `entire` is the progress of the operation; `entire` is 0 if it is unknown.
    """

    done: int = 0
    entire: int = 0
    text: str = ""

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        try:
            return _BUSY.pack(OpCode.BUSY, self.done, self.entire) + _text_bytes(self.text)
        except struct.error as error:
            raise ValueError(f"FoE BUSY: {error}") from None


Message: TypeAlias = ReadRequest | WriteRequest | Data | Acknowledge | Error | Busy


def decode_foe(data: bytes) -> Message:
    """Decode the data of a mailbox message of type FOE."""
    if len(data) < HEADER_SIZE:
        raise DecodeError(f"FoE: needs {HEADER_SIZE} bytes, received {len(data)}")
    code, number = _HEADER.unpack_from(data)
    rest = bytes(data[HEADER_SIZE:])
    match code:
        case OpCode.READ_REQUEST:
            return ReadRequest(_text(rest), number)
        case OpCode.WRITE_REQUEST:
            return WriteRequest(_text(rest), number)
        case OpCode.DATA:
            return Data(number, rest)
        case OpCode.ACKNOWLEDGE:
            return Acknowledge(number)
        case OpCode.ERROR:
            return Error(number, _text(rest))
        case OpCode.BUSY:
            return Busy(number & 0xFFFF, number >> 16, _text(rest))
    raise DecodeError(f"FoE: unknown op-code {code}")


def _text(data: bytes) -> str:
    """Return the text before the first zero byte: some devices add a terminator or padding."""
    return data.split(b"\x00", 1)[0].decode("latin-1")
