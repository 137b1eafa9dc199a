"""Reading the SII, ETG.1000.4 §6.4 (interface) and ETG.1000.6 §5.4 (content).

Frugal: of the header's 64 words only those are read that say something, of the categories those
that somebody wants, and no word twice. One frame carries the commands to all devices, one brings
back all their answers.
"""

from __future__ import annotations

import struct
from collections.abc import Collection

from catenary.errors import EepromError
from catenary.procedure.exchange import Procedure, after, read_memory, write_memory
from catenary.procedure.station import Deadline, Pace, Station, answered
from catenary.wire.register import SII_CONTROL_STATUS, SII_DATA
from catenary.wire.sii_interface import Command, ControlStatus

READ_TIMEOUT = 0.5  # [s] for 4 or 8 bytes; an I²C EEPROM needs less than a millisecond
SHORTEN = 0.9
NOT_WORTH_WAITING = 50e-6  # [s]; a frame takes as long
ERRORS_FORGIVEN = 3  # an EEPROM behind a busy processor may miss an acknowledge (SOEM, IgH retry)

HEADER_WORDS = 0x40
END = 0xFFFF
ADDRESSES = 0x10000  # words that a 16-bit count can reach
CATEGORIES_MAX = 64  # of a sane image; an unprogrammed one goes on for ever
# What the header says, as (first word, words): the rest is for the EEPROM's writer.
HEADER_PARTS = ((0x00, 0x10), (0x14, 0x0A), (0x3E, 0x02))
STRINGS, GENERAL, FMMU, SYNC_MANAGERS, TX_PDO, RX_PDO, CLOCKS = 10, 30, 40, 41, 50, 51, 60
WANTED = frozenset((STRINGS, GENERAL, FMMU, SYNC_MANAGERS, TX_PDO, RX_PDO, CLOCKS))

_START = SII_CONTROL_STATUS.address  # control/status, address and data are one block
_SIZE = SII_DATA.address + SII_DATA.size - _START
_DATA = SII_DATA.address - _START
_COMMAND = struct.Struct("<HI")
_BUSY = ControlStatus(busy=True).word
_NOT_READY = ControlStatus(busy=True, command_error=True, write_enable_error=True).word
_EIGHT_BYTES = ControlStatus(eight_bytes=True).word


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
    """Owns the bytes read last: a read brings two or four words, also those asked for next; and
    how long reads take, so that the first look comes when the EEPROM is ready."""

    def __init__(self, station: Station) -> None:
        self._station = station
        self._start = 0  # word address of `_data`
        self._data = b""
        self._typical = 0.0  # [s]

    def words(self, first: int, count: int) -> Procedure[bytes]:
        """`count` words from word address `first`."""
        end = self._start + len(self._data) // 2
        data = b""
        if self._start <= first < end:
            data = self._data[2 * (first - self._start) :]
        while len(data) < 2 * count:
            self._start = first + len(data) // 2
            self._data = yield from self._read(self._start)
            data += self._data
        return data[: 2 * count]

    def _read(self, word: int) -> Procedure[bytes]:
        """What one read command brings: 4 or 8 bytes."""
        station = self._station
        deadline, pace, errors, looks = Deadline(READ_TIMEOUT), Pace(), 0, 0
        started_ns = yield from self._command(Command.READ, word)
        if self._typical:
            yield after(self._typical)
        while True:
            [reply] = yield [read_memory(station.address, _START, _SIZE, repeatable=True)]
            block = answered(reply, station, "SII data")
            status = int.from_bytes(block[:2], "little")
            looks += 1
            if not status & _NOT_READY:
                self._learn(looks, (reply.time_ns - started_ns) * 1e-9)
                return block[_DATA : _DATA + (8 if status & _EIGHT_BYTES else 4)]
            if not status & _BUSY:
                errors += 1
                if errors > ERRORS_FORGIVEN:
                    raise _failed(station, word, status)
                yield from self._command(Command.IDLE, word)
                yield from self._command(Command.READ, word)
            if deadline.passed(reply):
                raise _failed(station, word, status)
            yield after(pace.pause())

    def _learn(self, looks: int, elapsed: float) -> None:
        """The pause before the next first look: as long as this took, then slowly shorter."""
        if looks > 1:
            self._typical = elapsed
        elif self._typical:
            shorter = SHORTEN * self._typical
            self._typical = shorter if shorter > NOT_WORTH_WAITING else 0.0

    def _command(self, command: Command, word: int) -> Procedure[int]:
        """Writes a command with its address; when it was back [ns]."""
        data = _COMMAND.pack(command << 8, word)
        [reply] = yield [write_memory(self._station.address, _START, data, repeatable=True)]
        answered(reply, self._station, "SII command")
        return reply.time_ns


def _failed(station: Station, word: int, status: int) -> EepromError:
    why = f"busy for {READ_TIMEOUT:g} s" if status & _BUSY else "an error of the interface"
    return EepromError(
        f"{station}: SII word 0x{word:04X} cannot be read: {why} (control/status 0x{status:04X})",
        hint="the EEPROM is missing or its processor holds it: power-cycle the device",
    )
