"""Image of the SII EEPROM of a SubDevice, ETG.1000.6 §5.4 and ETG.2010: header and categories.

`decode_sii` returns the whole image as a frozen value that encodes to the same bytes. To decode an
image in parts, use `decode_header`, then `decode_category_header` for the length of each category.
The contents of the categories are in sii_categories.py.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import TypeVar

from catenary.errors import DecodeError
from catenary.wire.sii_categories import (
    ClockMode,
    General,
    Pdo,
    SyncManagerEntry,
    decode_clock_modes,
    decode_general,
    decode_pdos,
    decode_strings,
    decode_sync_managers,
)

T = TypeVar("T")

HEADER_SIZE = 128
CATEGORY_HEADER_SIZE = 4
MAXIMUM_SIZE = 0x20000  # bytes: 64 Ki words, more than any EEPROM on the market
MAXIMUM_CATEGORIES = 512
END_OF_CATEGORIES = 0xFFFF

CONFIGURATION_WORDS = 0x0008  # number of words that the controller loads at power-up

# Word addresses
STATION_ALIAS_WORD = 0x0004
CHECKSUM_WORD = 0x0007
IDENTITY_WORD = 0x0008
BOOTSTRAP_WORD = 0x0014
MAILBOX_WORD = 0x0018
CATEGORIES_WORD = 0x0040

_HEADER = struct.Struct("<5H4sH4I8s8HH66sHH")
_CATEGORY = struct.Struct("<HH")
_CHECKSUM_SIZE = 14  # number of bytes that the checksum covers
CHECKSUM_DISABLED = 0x88A4  # controllers accept it instead of a checksum, for debugging


class CategoryType(IntEnum):
    """Types of categories that a MainDevice uses."""

    NOP = 0
    STRINGS = 10
    DATA_TYPES = 20
    GENERAL = 30
    FMMU = 40
    SYNC_MANAGER = 41
    FMMU_EXTENDED = 42
    SYNC_UNIT = 43
    TXPDO = 50
    RXPDO = 51
    DISTRIBUTED_CLOCKS = 60


class MailboxProtocol(IntFlag):
    """Mailbox protocols that a device supports (word 0x001C)."""

    AOE = 0x0001
    EOE = 0x0002
    COE = 0x0004
    FOE = 0x0008
    SOE = 0x0010
    VOE = 0x0020


@dataclass(frozen=True, slots=True)
class MailboxArea:
    """Memory area of one direction of a mailbox. A size of 0 means no mailbox."""

    offset: int = 0
    size: int = 0


_NO_PROTOCOL = MailboxProtocol(0)
_NO_AREA = MailboxArea()


@dataclass(frozen=True, slots=True)
class Header:
    """Header of an image: the first 64 words.

    The device receives messages in the `receive` areas and sends messages in the `send` areas.
    """

    vendor: int
    product: int
    revision: int
    serial: int = 0
    pdi_control: int = 0
    pdi_configuration: int = 0
    sync_pulse_length: int = 0  # [10 ns]
    pdi_configuration_2: int = 0
    station_alias: int = 0
    checksum: int | None = None  # None: computed by encode
    bootstrap_receive: MailboxArea = _NO_AREA
    bootstrap_send: MailboxArea = _NO_AREA
    standard_receive: MailboxArea = _NO_AREA
    standard_send: MailboxArea = _NO_AREA
    mailbox_protocols: MailboxProtocol = _NO_PROTOCOL
    size_kbit: int = 16
    version: int = 1
    reserved: bytes = bytes(78)  # words 0x05-0x06, 0x10-0x13, 0x1D-0x3D, verbatim

    def encode(self) -> bytes:
        """Return the 128 encoded bytes. Raises ValueError if a field does not fit."""
        areas = (
            *(self.bootstrap_receive, self.bootstrap_send),
            *(self.standard_receive, self.standard_send),
        )
        if len(self.reserved) != 78:
            raise ValueError(f"SII header: reserved must have 78 bytes, got {len(self.reserved)}")
        numbers = [number for area in areas for number in (area.offset, area.size)]
        try:
            image = _HEADER.pack(
                *(self.pdi_control, self.pdi_configuration, self.sync_pulse_length),
                *(self.pdi_configuration_2, self.station_alias, self.reserved[0:4], 0),
                *(self.vendor, self.product, self.revision, self.serial, self.reserved[4:12]),
                *(*numbers, self.mailbox_protocols, self.reserved[12:78]),
                *(self.size_kbit - 1, self.version),
            )
            checksum = checksum_of(image) if self.checksum is None else self.checksum
            return image[:_CHECKSUM_SIZE] + struct.pack("<H", checksum) + image[16:]
        except struct.error as error:
            raise ValueError(f"SII header: {error}") from None


def decode_header(data: bytes) -> Header:
    """Decode the header in the first 128 bytes.

    Raises:
        DecodeError: The data is too short, or the checksum is wrong. With a wrong checksum, the
            controller does not load its configuration either.
    """
    if len(data) < HEADER_SIZE:
        raise DecodeError(f"SII header: needs {HEADER_SIZE} bytes, received {len(data)}")
    (pdi_control, pdi_configuration, pulse_length, pdi_configuration_2, alias, *rest) = (
        _HEADER.unpack_from(data)
    )
    (reserved_1, checksum, vendor, product, revision, serial, reserved_2, *rest) = rest
    (offset_0, size_0, offset_1, size_1, offset_2, size_2, offset_3, size_3, *rest) = rest
    protocols, reserved_3, size_word, version = rest
    _verify(checksum, checksum_of(data))
    return Header(
        *(vendor, product, revision, serial),
        *(pdi_control, pdi_configuration, pulse_length, pdi_configuration_2, alias, checksum),
        bootstrap_receive=MailboxArea(offset_0, size_0),
        bootstrap_send=MailboxArea(offset_1, size_1),
        standard_receive=MailboxArea(offset_2, size_2),
        standard_send=MailboxArea(offset_3, size_3),
        mailbox_protocols=MailboxProtocol(protocols),
        size_kbit=size_word + 1,
        version=version,
        reserved=reserved_1 + reserved_2 + reserved_3,
    )


def _verify(checksum: int, expected: int) -> None:
    if checksum & 0xFF != expected and checksum != CHECKSUM_DISABLED:
        raise DecodeError(
            f"SII: checksum 0x{checksum:04X}, expected 0x{expected:04X}",
            hint="the EEPROM is empty or only partly written: write the vendor's image again",
        )


def checksum_of(data: bytes) -> int:
    """Return the CRC-8 of the first 14 bytes: polynomial x^8 + x^2 + x + 1, start value 0xFF."""
    crc = 0xFF
    for byte in data[:_CHECKSUM_SIZE]:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x07) & 0xFF if crc & 0x80 else crc << 1
    return crc


@dataclass(frozen=True, slots=True)
class Category:
    """One encoded category. Bit 15 of the type marks vendor-specific categories."""

    type: int
    data: bytes

    def encode(self) -> bytes:
        """Return the header and the data. Raises ValueError if the length is odd or too large."""
        if len(self.data) % 2:
            raise ValueError(
                f"SII category {self.type}: length must be even, got {len(self.data)} bytes"
            )
        try:
            return _CATEGORY.pack(self.type, len(self.data) // 2) + self.data
        except struct.error as error:
            raise ValueError(f"SII category {self.type}: {error}") from None


def decode_category_header(data: bytes) -> tuple[int, int]:
    """Return the type and the length [bytes] of the category at the start of `data`.

    The length of the end mark is 0.
    """
    if data[:2] == b"\xff\xff":
        return END_OF_CATEGORIES, 0
    if len(data) < CATEGORY_HEADER_SIZE:
        raise DecodeError(f"SII category header: needs 4 bytes, {len(data)} left")
    kind, words = _CATEGORY.unpack_from(data)
    return kind, 2 * words


@dataclass(frozen=True, slots=True)
class Sii:
    """A whole image: header and categories. The properties decode the known categories."""

    header: Header
    categories: tuple[Category, ...] = ()
    trailing: bytes = b"\xff\xff"  # the bytes from the end mark on

    def encode(self, size: int | None = None) -> bytes:
        """Return the image, padded with 0xFF to `size`. Raises ValueError if it does not fit."""
        body = b"".join(category.encode() for category in self.categories)
        image = self.header.encode() + body + self.trailing
        if size is not None and len(image) > size:
            raise ValueError(f"SII: {len(image)} bytes exceed the EEPROM of {size} bytes")
        return image.ljust(size or 0, b"\xff")

    @property
    def strings(self) -> tuple[str, ...]:
        """Texts in order. Other categories refer to them by number, starting at 1; see `string`."""
        return self._join(CategoryType.STRINGS, decode_strings)

    def string(self, number: int) -> str:
        """Return the text with this number; empty if the number is 0 or does not exist."""
        strings = self.strings
        return strings[number - 1] if 0 < number <= len(strings) else ""

    @property
    def general(self) -> General | None:
        """General category: names, mailbox details, current; None if it is missing."""
        found = (each.data for each in self.categories if each.type == CategoryType.GENERAL)
        data = next(found, None)
        return None if data is None else decode_general(data)

    @property
    def fmmus(self) -> tuple[int, ...]:
        """Intended use of each FMMU: a `FmmuUse`, or a vendor-specific number."""
        return self._join(CategoryType.FMMU, tuple)

    @property
    def sync_managers(self) -> tuple[SyncManagerEntry, ...]:
        """SyncManagers, by number."""
        return self._join(CategoryType.SYNC_MANAGER, decode_sync_managers)

    @property
    def transmit_pdos(self) -> tuple[Pdo, ...]:
        """PDOs that the device can send: inputs of the MainDevice."""
        return self._join(CategoryType.TXPDO, decode_pdos)

    @property
    def receive_pdos(self) -> tuple[Pdo, ...]:
        """PDOs that the device can receive: outputs of the MainDevice."""
        return self._join(CategoryType.RXPDO, decode_pdos)

    @property
    def clock_modes(self) -> tuple[ClockMode, ...]:
        """Modes of distributed clocks, in the order of the image."""
        return self._join(CategoryType.DISTRIBUTED_CLOCKS, decode_clock_modes)

    def _join(self, kind: CategoryType, decode: Callable[[bytes], tuple[T, ...]]) -> tuple[T, ...]:
        # Some vendors split a category into several (Pollen: one TXPDO category per PDO).
        return tuple(
            item for each in self.categories if each.type == kind for item in decode(each.data)
        )


def decode_sii(image: bytes) -> Sii:
    """Return the decoded image of an EEPROM.

    All known categories are decoded once, so that the properties of the result do not raise errors.

    Raises:
        DecodeError: The image is invalid.
    """
    if len(image) > MAXIMUM_SIZE:
        raise DecodeError(f"SII: {len(image)} bytes, the maximum is {MAXIMUM_SIZE}")
    header = decode_header(image)
    found, end = _split(image)
    sii = Sii(header, found, bytes(image[end:]))
    _ = (sii.strings, sii.general, sii.sync_managers)
    _ = (sii.transmit_pdos, sii.receive_pdos, sii.clock_modes)
    return sii


def _split(image: bytes) -> tuple[tuple[Category, ...], int]:
    found: list[Category] = []
    offset = HEADER_SIZE
    while offset < len(image):  # without an end mark, the categories end with the image
        kind, size = decode_category_header(image[offset : offset + CATEGORY_HEADER_SIZE])
        if kind == END_OF_CATEGORIES:
            break
        start = offset + CATEGORY_HEADER_SIZE
        if start + size > len(image):
            left = len(image) - start
            raise DecodeError(
                f"SII: category {kind} at byte {offset} specifies {size} bytes, but {left} are left"
            )
        found.append(Category(kind, bytes(image[start : start + size])))
        if len(found) > MAXIMUM_CATEGORIES:
            raise DecodeError(f"SII: more than {MAXIMUM_CATEGORIES} categories and no end mark")
        offset = start + size
    return tuple(found), offset
