"""Reading the SII, ETG.1000.4 §6.4 (interface) and ETG.1000.6 §5.4 (content).

Frugal: the header's first 64 words are read only where they say something, a category only if
somebody wants it, and the next address is written in the frame that would otherwise carry
nothing. One frame writes the addresses of all devices, one reads all their answers.
"""

from __future__ import annotations

import struct
from collections.abc import Collection

from catenary.errors import EepromError
from catenary.procedure.exchange import Procedure, Request, after, physical
from catenary.procedure.station import Deadline, Pace, Station, answered
from catenary.wire.datagram import Command as DatagramCommand
from catenary.wire.register import SII_CONTROL_STATUS, SII_DATA
from catenary.wire.sii_interface import Command, ControlStatus

READ_TIMEOUT = 0.5  # [s] for 4 or 8 bytes; an I²C EEPROM needs less than a millisecond
ERRORS_FORGIVEN = 3  # an EEPROM behind a busy processor may miss an acknowledge (SOEM, IgH retry)

HEADER_WORDS = 0x40
END = 0xFFFF
ADDRESSES = 0x10000  # words that a 16-bit count can reach
CATEGORIES_MAX = 64  # of a sane image; an unprogrammed one goes on for ever
# What the header says, as (first word, words): the rest is for the EEPROM's writer.
HEADER_PARTS = ((0x00, 0x10), (0x14, 0x0A), (0x3E, 0x02))
STRINGS, GENERAL, FMMU, SYNC_MANAGERS, TX_PDO, RX_PDO, CLOCKS = 10, 30, 40, 41, 50, 51, 60
WANTED = frozenset((STRINGS, GENERAL, FMMU, SYNC_MANAGERS, TX_PDO, RX_PDO, CLOCKS))

_BLOCK = SII_DATA.address + SII_DATA.size - SII_CONTROL_STATUS.address
_DATA = SII_DATA.address - SII_CONTROL_STATUS.address
_COMMAND = struct.Struct("<HI")  # control/status and address, written together


def read_image(station: Station, *, wanted: Collection[int] = WANTED) -> Procedure[bytes]:
    """The image up to END, with zeros where nothing was read and unwanted categories left out.

    A list of categories that never ends, as on an unprogrammed EEPROM, is cut off.
    """
    reader = _Reader(station)
    image = bytearray(2 * HEADER_WORDS)
    for first, count in HEADER_PARTS:
        image[2 * first : 2 * (first + count)] = yield from reader.words(first, count)
    word = HEADER_WORDS
    for _ in range(CATEGORIES_MAX):
        head = yield from reader.words(word, 2)
        kind, length = struct.unpack("<HH", head)
        if kind == END or word + 2 + length > ADDRESSES:
            break
        if kind in wanted:
            image += head + (yield from reader.words(word + 2, length))
        word += 2 + length
    return bytes(image + struct.pack("<H", END))


class _Reader:
    """Owns the words read so far: a read brings two or four, also those asked for next."""

    def __init__(self, station: Station) -> None:
        self._station = station
        self._known: dict[int, bytes] = {}

    def words(self, first: int, count: int) -> Procedure[bytes]:
        """`count` words from word address `first`."""
        for word in range(first, first + count):
            if word in self._known:
                continue
            data = yield from _read_once(self._station, word)
            for offset in range(len(data) // 2):
                self._known[word + offset] = data[2 * offset : 2 * offset + 2]
        return b"".join(self._known[word] for word in range(first, first + count))


def _read_once(station: Station, word: int) -> Procedure[bytes]:
    """What one read command brings: 4 or 8 bytes."""
    deadline, pace, errors = Deadline(READ_TIMEOUT), Pace(), 0
    yield from _command(station, Command.READ, word)
    while True:
        [reply] = yield [_fprd(station)]
        block = answered(reply, station, "SII data")
        status = ControlStatus.from_word(
            SII_CONTROL_STATUS.unpack(block[: SII_CONTROL_STATUS.size])
        )
        if not status.busy and not status.failed:
            return block[_DATA : _DATA + status.read_size]
        if not status.busy:
            errors += 1
            if errors > ERRORS_FORGIVEN:
                raise _failed(station, word, status)
            yield from _command(station, Command.IDLE, word)
            yield from _command(station, Command.READ, word)
        if deadline.passed(reply):
            raise _failed(station, word, status)
        yield after(pace.pause())


def _command(station: Station, command: Command, word: int) -> Procedure[None]:
    data = _COMMAND.pack(ControlStatus(command).word, word)
    address = physical(station.address, SII_CONTROL_STATUS.address)
    [reply] = yield [Request(DatagramCommand.FPWR, address, data, True)]
    answered(reply, station, f"SII command {command.name}")


def _fprd(station: Station) -> Request:
    address = physical(station.address, SII_CONTROL_STATUS.address)
    return Request(DatagramCommand.FPRD, address, bytes(_BLOCK), True)


def _failed(station: Station, word: int, status: ControlStatus) -> EepromError:
    why = f"busy for {READ_TIMEOUT:g} s" if status.busy else "an error of the interface"
    return EepromError(
        f"{station}: SII word 0x{word:04X} cannot be read: {why} "
        f"(control/status 0x{status.word:04X})",
        hint="the EEPROM is missing or its processor holds it: power-cycle the device",
    )
