"""Read access to the SII, ETG.1000.4 §6.4 (interface) and ETG.1000.6 §5.4 (content).

Only the used words of the header and the requested categories are read. Known words are not read
again. If an EEPROM is ready by the next frame, the frame that fetches a word also contains the read
command for the next one.
"""

from __future__ import annotations

import struct
from collections.abc import Collection

from catenary.errors import EepromError
from catenary.model.device import Identity
from catenary.procedure.exchange import Procedure, after, read_memory, write_memory
from catenary.procedure.station import Deadline, Pace, Station, answered
from catenary.wire.register import SII_CONTROL_STATUS, SII_DATA
from catenary.wire.sii_interface import ControlStatus, SiiCommand

READ_TIMEOUT = 0.5  # [s] for 4 or 8 bytes; an I²C EEPROM needs less than a millisecond
SHORTEN = 0.9  # reduces the pause before the first poll while that poll is successful
NOT_WORTH_WAITING = 50e-6  # [s]; about the duration of a frame
# Per read: an EEPROM behind a busy processor may fail to acknowledge. SOEM and IgH retry, too.
ERRORS_FORGIVEN = 3

HEADER_WORDS = 0x40
IDENTITY_WORD, IDENTITY_WORDS = 0x08, 8
END = 0xFFFF
ADDRESSES = 0x10000  # number of words with a 16-bit address
CATEGORIES_MAX = 64  # limit for valid images; an unprogrammed one has no end mark
# Used parts of the header: (first word, number of words). Other words are not needed.
HEADER_PARTS = ((0x00, 0x10), (0x14, 0x0A), (0x3E, 0x02))
STRINGS, GENERAL, FMMU, SYNC_MANAGERS, TX_PDO, RX_PDO, CLOCKS = 10, 30, 40, 41, 50, 51, 60
WANTED = frozenset((STRINGS, GENERAL, FMMU, SYNC_MANAGERS, TX_PDO, RX_PDO, CLOCKS))

_START = SII_CONTROL_STATUS.address  # control/status, address and data are adjacent
_SIZE = SII_DATA.address + SII_DATA.size - _START
_DATA = SII_DATA.address - _START
_COMMAND = struct.Struct("<HI")
_BUSY = ControlStatus(busy=True).word
_NOT_READY = ControlStatus(busy=True, command_error=True, write_enable_error=True).word
_EIGHT_BYTES = ControlStatus(eight_bytes=True).word


def read_image(station: Station, *, wanted: Collection[int] = WANTED) -> Procedure[bytes]:
    """Read the image up to the end mark.

    Unread words of the header are zero. Categories that are not wanted are omitted. If there is no
    end mark, as in an unprogrammed EEPROM, the categories are truncated.

    Args:
        station: The device.
        wanted: Types of the categories to read.

    Raises:
        EepromError: The EEPROM cannot be read.
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


def read_words(station: Station, first: int, count: int) -> Procedure[bytes]:
    """Read words without interpretation.

    Args:
        station: The device.
        first: Address of the first word.
        count: Number of words.

    Raises:
        EepromError: The EEPROM cannot be read.
    """
    return (yield from _Reader(station).words(first, count))


def read_identity(station: Station) -> Procedure[Identity]:
    """Read vendor, product, revision and serial number: words 0x08 to 0x0F."""
    data = yield from read_words(station, IDENTITY_WORD, IDENTITY_WORDS)
    return Identity(*struct.unpack("<4I", data))


class _Reader:
    """Reader of an EEPROM. It keeps the bytes of the last read and the typical read time.

    A read returns two or four words, so the next words may already be known. The read time
    determines when the EEPROM is first polled.
    """

    def __init__(self, station: Station) -> None:
        self._station = station
        self._start = 0  # word address of `_data`
        self._data = b""
        self._typical = 0.0  # [s]
        self._prompt = False  # the first poll was successful without a pause
        self._commanded = (-1, 0)  # the word of the pending read, and its start [ns]

    def words(self, first: int, count: int) -> Procedure[bytes]:
        """Read `count` words from word address `first`."""
        end = self._start + len(self._data) // 2
        data = b""
        if self._start <= first < end:
            data = self._data[2 * (first - self._start) :]
        while len(data) < 2 * count:
            self._start = first + len(data) // 2
            # Assume the width of the last read. Before the first read, it is unknown.
            ahead = self._start + len(self._data) // 2
            wanted = self._start < ahead < first + count
            self._data = yield from self._read(self._start, ahead if wanted else None)
            data += self._data
        return data[: 2 * count]

    def _read(self, word: int, ahead: int | None) -> Procedure[bytes]:
        """Return the 4 or 8 bytes of one read command. `ahead` is the next word to read."""
        if ahead is not None and self._prompt:
            data = yield from self._read_and_command(word, ahead)
            if data:
                return data
        return (yield from self._read_alone(word))

    def _read_and_command(self, word: int, ahead: int) -> Procedure[bytes]:
        """Fetch `word` and command the read of `ahead` in one frame.

        Return no bytes if this fails. It is then unknown which of the two words the EEPROM has
        read, and `word` must be read again.
        """
        started_ns = yield from self._start_read(word)
        command = _COMMAND.pack(SiiCommand.READ << 8, ahead)
        station = self._station
        fetched, commanded = yield [
            read_memory(station.address, _START, _SIZE, repeatable=False),
            write_memory(station.address, _START, command, repeatable=False),
        ]
        status = int.from_bytes(fetched.data[:2], "little")
        lost = fetched.lost or commanded.lost or fetched.working_counter != 1
        if lost or status & _NOT_READY:
            self._prompt = False
            yield from self._until_idle(word)
            return b""
        if commanded.working_counter == 1:
            self._commanded = (ahead, commanded.time_ns)
        self._learn(1, (fetched.time_ns - started_ns) * 1e-9)
        return fetched.data[_DATA : _DATA + (8 if status & _EIGHT_BYTES else 4)]

    def _until_idle(self, word: int) -> Procedure[None]:
        """Wait until an abandoned read has ended."""
        deadline, pace = Deadline(READ_TIMEOUT), Pace()
        while True:
            [reply] = yield [read_memory(self._station.address, _START, 2, repeatable=True)]
            status = int.from_bytes(answered(reply, self._station, "SII status"), "little")
            if not status & _BUSY:
                return
            if deadline.passed(reply):
                raise _failed(self._station, word, status)
            yield after(pace.pause())

    def _start_read(self, word: int) -> Procedure[int]:
        """Command the read of `word` unless it is pending. Return the time of the command [ns]."""
        commanded, since_ns = self._commanded
        self._commanded = (-1, 0)
        if commanded == word:
            return since_ns
        return (yield from self._command(SiiCommand.READ, word))

    def _read_alone(self, word: int) -> Procedure[bytes]:
        station = self._station
        deadline, pace, errors, polls = Deadline(READ_TIMEOUT), Pace(), 0, 0
        started_ns = yield from self._start_read(word)
        if self._typical:
            yield after(self._typical)
        while True:
            [reply] = yield [read_memory(station.address, _START, _SIZE, repeatable=True)]
            block = answered(reply, station, "SII data")
            status = int.from_bytes(block[:2], "little")
            polls += 1
            if not status & _NOT_READY:
                self._learn(polls, (reply.time_ns - started_ns) * 1e-9)
                return block[_DATA : _DATA + (8 if status & _EIGHT_BYTES else 4)]
            if not status & _BUSY:
                errors += 1
                if errors > ERRORS_FORGIVEN:
                    raise _failed(station, word, status)
                yield from self._command(SiiCommand.IDLE, word)
                yield from self._command(SiiCommand.READ, word)
            if deadline.passed(reply):
                raise _failed(station, word, status)
            yield after(pace.pause())

    def _learn(self, polls: int, elapsed: float) -> None:
        """Set the pause before the first poll to the time of this read, or reduce it slowly."""
        self._prompt = polls == 1 and not self._typical
        if polls > 1:
            self._typical = elapsed
        elif self._typical:
            shorter = SHORTEN * self._typical
            self._typical = shorter if shorter > NOT_WORTH_WAITING else 0.0

    def _command(self, command: SiiCommand, word: int) -> Procedure[int]:
        """Write a command with its address. Return the time of the reply [ns]."""
        data = _COMMAND.pack(command << 8, word)
        [reply] = yield [write_memory(self._station.address, _START, data, repeatable=True)]
        answered(reply, self._station, "SII command")
        return reply.time_ns


def _failed(station: Station, word: int, status: int) -> EepromError:
    why = f"busy for {READ_TIMEOUT:g} s" if status & _BUSY else "interface error"
    return EepromError(
        f"{station}: SII word 0x{word:04X} cannot be read: {why} (control/status 0x{status:04X})",
        hint="the EEPROM is missing, or the device's processor uses it: power-cycle the device",
    )
