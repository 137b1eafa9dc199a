"""Words of the EEPROM that a master has read through registers 0x0502 to 0x0508."""

from __future__ import annotations

from catenary.capture.contents import IdentityRead, NameRead
from catenary.capture.register_contents import EepromWrite
from catenary.capture.transaction import Transaction
from catenary.errors import DecodeError
from catenary.wire.register import SII_ADDRESS, SII_CONTROL_STATUS, SII_DATA, SII_DATA_LOW
from catenary.wire.sii import (
    CATEGORIES_WORD,
    CATEGORY_HEADER_SIZE,
    END_OF_CATEGORIES,
    IDENTITY_WORD,
    CategoryType,
    decode_category_header,
)
from catenary.wire.sii_categories import decode_general, decode_strings
from catenary.wire.sii_interface import ControlStatus, SiiCommand

MAXIMUM_CATEGORIES = 64
_BUSY = ControlStatus(busy=True).word
_EIGHT_BYTES = ControlStatus(eight_bytes=True).word
_WRITE_DATA_SIZE = 2  # a write command writes one word


class EepromReads:
    """Owner of the words that were read, and of the address in the last command."""

    def __init__(self) -> None:
        self.words: dict[int, bytes] = {}
        self._address: int | None = None
        self._data = bytes(_WRITE_DATA_SIZE)
        self._reading = False
        self._busy = self._eight_bytes = False

    def follow(self, each: Transaction) -> EepromWrite | bool | None:
        """Follow a datagram of the device.

        Returns:
            The written word; True if words were read for the first time; None otherwise.
        """
        if each.written is not None:
            return self._follow_write(each) if each.accepted else None
        return self._follow_read(each) or None

    def _follow_write(self, each: Transaction) -> EepromWrite | None:
        if (address := each.was_written(SII_ADDRESS)) is not None:
            self._address = int.from_bytes(address, "little")
        start = SII_DATA.address - each.ado
        if each.written and 0 <= start <= len(each.written) - _WRITE_DATA_SIZE:
            self._data = each.written[start : start + _WRITE_DATA_SIZE]
        control = each.was_written(SII_CONTROL_STATUS)
        if control is None:
            return None
        try:
            command = ControlStatus.from_word(int.from_bytes(control, "little")).command
        except DecodeError:
            return None
        self._reading, self._busy = command is SiiCommand.READ, False
        if command is SiiCommand.WRITE and self._address is not None:
            return EepromWrite(self._address, self._data)
        return None

    def _follow_read(self, each: Transaction) -> bool:
        if (control := each.was_read(SII_CONTROL_STATUS)) is not None:
            word = int.from_bytes(control, "little")
            self._busy, self._eight_bytes = bool(word & _BUSY), bool(word & _EIGHT_BYTES)
        # Without the flag, the upper four bytes are not part of the answer.
        data = each.was_read(SII_DATA) if self._eight_bytes else None
        data = data or each.was_read(SII_DATA_LOW)
        if data is None or self._busy or not self._reading or self._address is None:
            return False
        new = False
        for i in range(0, len(data), 2):
            word = self._address + i // 2
            if word <= 0xFFFF and self.words.get(word) != data[i : i + 2]:
                self.words[word] = data[i : i + 2]
                new = True
        return new

    def identity(self) -> IdentityRead | None:
        """Return the identity; None while a part of it is unknown."""
        numbers = [self._number(IDENTITY_WORD + 2 * i) for i in range(4)]
        vendor, product, revision, serial = numbers
        if vendor is None or product is None or revision is None:
            return None
        return IdentityRead(vendor, product, revision, serial)

    def name(self) -> NameRead | None:
        """Return name and order code; None while the strings or their numbers are unknown."""
        try:
            return self._name()
        except DecodeError:
            return None

    def _name(self) -> NameRead | None:
        categories = self._categories()
        if CategoryType.STRINGS not in categories or CategoryType.GENERAL not in categories:
            return None
        strings = ("", *decode_strings(categories[CategoryType.STRINGS]))
        general = decode_general(categories[CategoryType.GENERAL])
        name, order = (
            strings[number] if number < len(strings) else ""
            for number in (general.name, general.order)
        )
        return NameRead(name, order) if name or order else None

    def _categories(self) -> dict[int, bytes]:
        """Return the categories that are known completely."""
        found: dict[int, bytes] = {}
        word = CATEGORIES_WORD
        for _ in range(MAXIMUM_CATEGORIES):
            header = self._bytes(word, CATEGORY_HEADER_SIZE)
            if header is None:
                break
            kind, size = decode_category_header(header)
            if kind == END_OF_CATEGORIES:
                break
            word += CATEGORY_HEADER_SIZE // 2
            data = self._bytes(word, size)
            if data is not None:
                found.setdefault(kind, data)
            word += size // 2
        return found

    def _number(self, word: int) -> int | None:
        data = self._bytes(word, 4)
        return None if data is None else int.from_bytes(data, "little")

    def _bytes(self, word: int, size: int) -> bytes | None:
        parts = [self.words.get(word + i) for i in range(size // 2)]
        known = [part for part in parts if part is not None]
        return b"".join(known) if len(known) == len(parts) else None
