"""Parameters of SERCOS drives, IEC 61800-7-204: IDNs, attributes, lists, and command states."""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from enum import IntEnum, IntFlag

from catenary.errors import DecodeError

LIST_HEADER_SIZE = 4
LIST_BYTES_MAX = 0xFFFF  # of the content of a list
_LIST = struct.Struct("<HH")
_NOTATION = re.compile(r"([SP])-([0-7])-(\d{1,4})", re.IGNORECASE)
_PRODUCT, _SET_SHIFT, _BLOCK = 0x8000, 12, 0x0FFF


def idn_number(idn: str | int) -> int:
    """Return the number of an IDN: bit 15 is set for P, bits 12 to 14 are the parameter set.

    Args:
        idn: Notation, such as "S-0-0047" or "P-0-0010", or the number.

    Raises:
        ValueError: The text is not an IDN, or the number does not fit into 16 bits.
    """
    if isinstance(idn, int):
        if not 0 <= idn <= 0xFFFF:
            raise ValueError(f"IDN must be 0 to 0xFFFF, not {idn:#x}")
        return idn
    found = _NOTATION.fullmatch(idn.strip())
    if found is None or int(found[3]) > _BLOCK:
        raise ValueError(
            f"{idn!r} is not an IDN: write S-SET-NUMBER or P-SET-NUMBER, such as S-0-0047; the set "
            "is 0 to 7, the number 0 to 4095"
        )
    product = _PRODUCT if found[1].upper() == "P" else 0
    return product | int(found[2]) << _SET_SHIFT | int(found[3])


def idn_text(number: int) -> str:
    """Return the notation of an IDN, such as "S-0-0047"."""
    letter = "P" if number & _PRODUCT else "S"
    return f"{letter}-{number >> _SET_SHIFT & 7}-{number & _BLOCK:04d}"


class Display(IntEnum):
    """Display format of a value, bits 20 to 22 of an attribute."""

    BINARY = 0
    UNSIGNED = 1
    SIGNED = 2
    HEXADECIMAL = 3
    TEXT = 4
    IDN = 5
    FLOAT = 6
    TIME = 7


class Protection(IntFlag):
    """States in which a value is write-protected, bits 28 to 30 of an attribute."""

    PRE_OP = 1
    SAFE_OP = 2
    OP = 4


UNPROTECTED = Protection(0)


@dataclass(frozen=True, slots=True)
class Attribute:
    """Attribute of an IDN (element 3).

    A displayed number is the transmitted one times `factor`, divided by 10 to the power `decimals`.
    """

    size: int  # of the value, or of one item of a list [bytes]: 1, 2, 4 or 8
    is_list: bool = False
    is_command: bool = False
    display: Display = Display.BINARY
    decimals: int = 0
    factor: int = 1
    protection: Protection = UNPROTECTED

    @property
    def scale(self) -> float:
        """Factor from the transmitted number to the displayed one; 1 for texts, bits and IDNs."""
        if self.display not in (Display.UNSIGNED, Display.SIGNED):
            return 1.0
        # A factor of 0 has no meaning. Devices that do not use the factor may send it.
        return (self.factor or 1) / float(10**self.decimals)

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        if self.size not in (1, 2, 4, 8):
            raise ValueError(f"attribute: size must be 1, 2, 4 or 8, not {self.size}")
        if not (0 <= self.decimals <= 15 and 0 <= self.factor <= 0xFFFF):
            raise ValueError(f"attribute: decimals or factor out of range in {self}")
        word = self.factor | (self.size.bit_length() - 1) << 16 | self.is_list << 18
        word |= self.is_command << 19 | self.display << 20 | self.decimals << 24
        return (word | self.protection << 28).to_bytes(4, "little")


def decode_attribute(data: bytes) -> Attribute:
    """Decode an attribute of 4 bytes."""
    if len(data) != 4:
        raise DecodeError(f"attribute: needs 4 bytes, received {len(data)}")
    word = int.from_bytes(data, "little")
    return Attribute(
        1 << (word >> 16 & 3),
        is_list=bool(word >> 18 & 1),
        is_command=bool(word >> 19 & 1),
        display=Display(word >> 20 & 7),
        decimals=word >> 24 & 15,
        factor=word & 0xFFFF,
        protection=Protection(word >> 28 & 7),
    )


def encode_list(content: bytes, maximum: int | None = None) -> bytes:
    """Return a list, name or unit: current length, maximum length, content.

    Args:
        content: Items, or text.
        maximum: Maximum length [bytes]; None: that of the content.

    Raises:
        ValueError: The content exceeds the maximum, or 65535 bytes.
    """
    limit = len(content) if maximum is None else maximum
    if len(content) > limit or limit > LIST_BYTES_MAX:
        raise ValueError(f"list of {len(content)} bytes exceeds its maximum, {limit} bytes")
    return _LIST.pack(len(content), limit) + content


def split_list(data: bytes) -> tuple[bytes, int, bytes]:
    """Split a list, name or unit from the bytes that follow it.

    Args:
        data: Bytes that start with the list.

    Returns:
        The content, the maximum length [bytes], and the remaining bytes.

    Raises:
        DecodeError: The list is longer than the data, or than its own maximum.
    """
    if len(data) < LIST_HEADER_SIZE:
        raise DecodeError(f"list: needs {LIST_HEADER_SIZE} bytes, received {len(data)}")
    length, maximum = _LIST.unpack_from(data)
    end = LIST_HEADER_SIZE + length
    if end > len(data):
        raise DecodeError(
            f"list: its header states {length} bytes, {len(data) - LIST_HEADER_SIZE} received"
        )
    if length > maximum:
        raise DecodeError(f"list: length of {length} bytes exceeds its maximum of {maximum} bytes")
    return bytes(data[LIST_HEADER_SIZE:end]), maximum, bytes(data[end:])


class CommandState(IntFlag):
    """State of a procedure command (element 1), and the bits that set it (element 7)."""

    SET = 0x0001
    ENABLED = 0x0002
    PENDING = 0x0004  # not yet executed
    FAILED = 0x0008
    INVALID = 0x0100  # the value of the IDN is not valid


START = CommandState.SET | CommandState.ENABLED
