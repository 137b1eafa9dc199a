"""IDNs of a virtual drive, with the checks of IEC 61800-7-204.

The code is independent of the codec `catenary.wire.sercos`, so that each tests the other.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from dataclasses import dataclass, field

BINARY, UNSIGNED, SIGNED, HEX, TEXT, IDN, FLOAT = range(7)  # display formats
IN_PRE_OP, IN_SAFE_OP, IN_OP = 1, 2, 4  # write protection
ALWAYS = IN_PRE_OP | IN_SAFE_OP | IN_OP
WHILE_CYCLIC = IN_SAFE_OP | IN_OP
PROTECTION_IN = {2: IN_PRE_OP, 4: IN_SAFE_OP, 8: IN_OP}  # by AL state
# Error codes
NO_IDN, TOO_SHORT, TOO_LONG, READ_ONLY, PROTECTED = 0x1001, 0x7002, 0x7003, 0x7004, 0x7005
TOO_SMALL, TOO_LARGE, INVALID = 0x7006, 0x7007, 0x7008
LIST_MAX = 0xFFFC


class Refusal(Exception):
    """Error code with which the drive answers."""

    def __init__(self, code: int) -> None:
        super().__init__(f"0x{code:04X}")
        self.code = code


def idn(text: str) -> int:
    """Return the number of "S-0-0047". Raises ValueError if the text is not an IDN."""
    found = re.fullmatch(r"([SP])-([0-7])-(\d{4})", text)
    if found is None or int(found[3]) > 0xFFF:
        raise ValueError(f"{text!r} is not an IDN, such as S-0-0047")
    return 0x8000 * (found[1] == "P") + 0x1000 * int(found[2]) + int(found[3])


@dataclass(slots=True)
class Parameter:
    """One IDN. `content` holds the bytes of a value without a `read` function."""

    number: int
    name: str
    size: int = 2  # of the value, or of one item [bytes]
    display: int = UNSIGNED
    unit: str = ""
    decimals: int = 0
    is_list: bool = False
    is_command: bool = False
    limit: int = 0  # maximum length of a list [bytes]
    minimum: int | None = None
    maximum: int | None = None
    default: int | None = None
    protection: int = ALWAYS
    content: bytes = b""
    read: Callable[[], bytes] | None = None
    written: Callable[[bytes], None] | None = None  # may raise Refusal
    slot: int = -1  # of the model, if the value can be in a telegram
    in_mdt: bool = False
    in_at: bool = False
    state: int = field(default=0)  # of a procedure command

    @property
    def attribute(self) -> bytes:
        """Bytes of the attribute."""
        word = 1 | {1: 0, 2: 1, 4: 2, 8: 3}[self.size] << 16 | self.is_list << 18
        word |= self.is_command << 19 | self.display << 20 | self.decimals << 24
        return struct.pack("<I", word | self.protection << 28)

    def value(self) -> bytes:
        """Return the bytes of the value, with the lengths of a list."""
        content = self.content if self.read is None else self.read()
        if not self.is_list:
            return content
        return struct.pack("<HH", len(content), max(self.limit, len(content))) + content

    def write(self, data: bytes, al_state: int) -> None:
        """Store a value. Raises Refusal if it is not permitted.

        Args:
            data: Bytes of the value, with the lengths of a list.
            al_state: AL state of the device.
        """
        if self.protection == ALWAYS and not self.is_command:
            raise Refusal(READ_ONLY)
        if self.protection & PROTECTION_IN.get(al_state, 0):
            raise Refusal(PROTECTED)
        content = self._list_content(data) if self.is_list else self._checked(data)
        if self.written is not None:
            self.written(content)
        if self.read is None:
            self.content = content

    def _list_content(self, data: bytes) -> bytes:
        if len(data) < 4:
            raise Refusal(TOO_SHORT)
        [length] = struct.unpack_from("<H", data)
        content = data[4:]
        if length > len(content) or length % self.size:
            raise Refusal(TOO_SHORT)
        if length < len(content) or length > self.limit:
            raise Refusal(TOO_LONG)
        return content

    def _checked(self, data: bytes) -> bytes:
        if len(data) != self.size:
            raise Refusal(TOO_SHORT if len(data) < self.size else TOO_LONG)
        number = int.from_bytes(data, "little", signed=self.display == SIGNED)
        if self.minimum is not None and number < self.minimum:
            raise Refusal(TOO_SMALL)
        if self.maximum is not None and number > self.maximum:
            raise Refusal(TOO_LARGE)
        return data

    def encode(self, number: int) -> bytes:
        """Return the bytes of a number in the size of the value."""
        return (number & (1 << 8 * self.size) - 1).to_bytes(self.size, "little")


def text(number: int, name: str, content: str, *, limit: int = 0) -> Parameter:
    """Return a text. It can be written if it has a limit.

    Args:
        number: IDN.
        name: Name of the IDN.
        content: The text.
        limit: Maximum length [bytes]; 0: the text cannot be written.
    """
    protection = 0 if limit else ALWAYS
    data = content.encode("latin-1", "replace")
    return Parameter(
        number, name, 1, TEXT, is_list=True, limit=limit, protection=protection, content=data
    )


def idn_list(
    number: int,
    name: str,
    *,
    read: Callable[[], bytes] | None = None,
    content: bytes = b"",
    limit: int = 0,
    written: Callable[[bytes], None] | None = None,
) -> Parameter:
    """Return a list of IDNs. It can be written in PRE-OP if it has a limit.

    Args:
        number: IDN of the list.
        name: Name of the IDN.
        read: Function that returns the items; None: the stored ones.
        content: Initial items.
        limit: Maximum length [bytes]; 0: the list cannot be written.
        written: Function that checks new items.
    """
    protection = WHILE_CYCLIC if limit else ALWAYS
    return Parameter(
        number,
        name,
        2,
        IDN,
        is_list=True,
        limit=limit,
        protection=protection,
        content=content,
        read=read,
        written=written,
    )


def packed(numbers: list[int]) -> bytes:
    """Return IDNs as the items of a list."""
    return struct.pack(f"<{len(numbers)}H", *numbers)
