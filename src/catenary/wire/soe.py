"""Servo drive profile over EtherCAT (SoE), ETG.1000.6 §5.9: messages and their fragments.

All messages start with the same header:

    op-code, incomplete, error, drive number | elements | IDN, or number of fragments left | data

A message with `incomplete` is a fragment: it has the number of the fragments that follow in place
of the IDN, as in SOEM (ec_soe.c) and IgH (fsm_soe.c). A message with `error` ends with a code of
16 bits. `wire/sercos.py` contains IDNs, attributes, values and error codes.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum, IntFlag

from catenary.errors import DecodeError

HEADER_SIZE = 4
DRIVES = range(8)
_HEADER = struct.Struct("<BBH")
_CODE = struct.Struct("<H")


class OpCode(IntEnum):
    """Service of a message, ETG.1000.6 §5.9.2."""

    READ_REQUEST = 1
    READ_RESPONSE = 2
    WRITE_REQUEST = 3
    WRITE_RESPONSE = 4
    NOTIFICATION = 5
    EMERGENCY = 6


class Element(IntFlag):
    """Elements of an IDN, in the order in which a message contains them."""

    STATE = 0x01
    NAME = 0x02
    ATTRIBUTE = 0x04
    UNIT = 0x08
    MINIMUM = 0x10
    MAXIMUM = 0x20
    VALUE = 0x40
    DEFAULT = 0x80


NO_ELEMENTS = Element(0)


@dataclass(frozen=True, slots=True)
class Message:
    """One SoE message or fragment.

    `number` is the IDN, or the number of fragments left if `incomplete`. A message with `error` has
    the code in the last two bytes of `data`; `code` decodes it.
    """

    op_code: OpCode
    number: int
    elements: Element = NO_ELEMENTS
    data: bytes = b""
    drive: int = 0
    incomplete: bool = False
    error: bool = False

    @property
    def code(self) -> int:
        """Error code of a message with `error`; 0 if it has none."""
        if not self.error or len(self.data) < _CODE.size:
            return 0
        return int(_CODE.unpack(self.data[-_CODE.size :])[0])

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        if self.drive not in DRIVES:
            raise ValueError(f"SoE: drive must be 0 to 7, not {self.drive}")
        flags = self.incomplete << 3 | self.error << 4 | self.drive << 5
        try:
            header = _HEADER.pack(self.op_code | flags, self.elements, self.number)
        except struct.error as error:
            raise ValueError(f"SoE {self.op_code.name}: {error}") from None
        return header + self.data


def decode_soe(data: bytes) -> Message:
    """Decode the data of a mailbox message of type SOE."""
    if len(data) < HEADER_SIZE:
        raise DecodeError(f"SoE: needs {HEADER_SIZE} bytes, received {len(data)}")
    flags, elements, number = _HEADER.unpack_from(data)
    try:
        op_code = OpCode(flags & 0x07)
    except ValueError:
        raise DecodeError(f"SoE: unknown op-code {flags & 0x07}") from None
    return Message(
        op_code,
        number,
        Element(elements),
        bytes(data[HEADER_SIZE:]),
        drive=flags >> 5,
        incomplete=bool(flags & 0x08),
        error=bool(flags & 0x10),
    )
