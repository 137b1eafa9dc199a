"""Size of an EEPROM, according to its image."""

from __future__ import annotations

import struct
from typing import NamedTuple

from catenary.errors import DecodeError
from catenary.procedure.exchange import Procedure, read
from catenary.procedure.sii import CATEGORIES_MAX, END, HEADER_WORDS, read_words
from catenary.procedure.station import Station, answered
from catenary.wire.datagram import EcatCommand
from catenary.wire.register import SII_CONTROL_STATUS
from catenary.wire.sii import MAXIMUM_SIZE, decode_header
from catenary.wire.sii_check import BYTES_PER_KBIT
from catenary.wire.sii_interface import ControlStatus

SMALL = 2048  # bytes: the range of one address byte, 16 kbit
PROBE_WORDS = 16  # includes vendor, product, revision and serial number
CAUTIOUS = 4096  # bytes: the smallest EEPROM with two address bytes


class Extent(NamedTuple):
    """Size of an EEPROM, and a note about faults of its image."""

    size: int  # bytes
    limit: int  # number of bytes that its controller can address
    note: str = ""


def read_extent(station: Station) -> Procedure[Extent]:
    """Read the size of an EEPROM.

    The size is in the header. If the header is damaged, the image ends at the end mark. Without an
    end mark, as in an unprogrammed EEPROM, the size is at most `CAUTIOUS`.
    """
    [reply] = yield [read(EcatCommand.FPRD, station.address, SII_CONTROL_STATUS)]
    word = SII_CONTROL_STATUS.unpack(answered(reply, station, "SII status"))
    limit = MAXIMUM_SIZE if ControlStatus.from_word(word).two_byte_address else SMALL
    data = yield from read_words(station, 0, HEADER_WORDS)
    try:
        size = decode_header(data).size_kbit * BYTES_PER_KBIT
    except DecodeError as error:
        end = yield from _end_of_categories(station, limit)
        if end is None:
            bound = min(limit, CAUTIOUS)
            return Extent(bound, limit, f"{error.message}; no end mark, {bound} bytes are used")
        return Extent(end, limit, f"{error.message}; {end} bytes up to the end mark")
    if size > limit and not (yield from _wraps(station, data)):
        limit = MAXIMUM_SIZE
    if size <= limit:
        return Extent(size, limit)
    return Extent(
        limit, limit, f"its header specifies {size} bytes, but its controller can address {limit}"
    )


def _wraps(station: Station, header: bytes) -> Procedure[bool]:
    """Return True if the content repeats after the range of one address byte.

    Emulated EEPROMs (KickCAT, other processors) support two address bytes, but do not report this.
    """
    beyond = yield from read_words(station, SMALL // 2, PROBE_WORDS)
    return beyond == header[: 2 * PROBE_WORDS]


def _end_of_categories(station: Station, limit: int) -> Procedure[int | None]:
    """Return the size up to and including the end mark; None if there is none within `limit`."""
    word = HEADER_WORDS
    for _ in range(CATEGORIES_MAX):
        kind, length = struct.unpack("<HH", (yield from read_words(station, word, 2)))
        if kind == END:
            return 2 * (word + 1)
        word += 2 + length
        if 2 * word >= limit:
            break
    return None
