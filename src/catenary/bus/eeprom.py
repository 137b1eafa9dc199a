"""Reading and writing of whole EEPROMs in parts, with progress reports."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeAlias, TypeVar

from catenary.errors import CatenaryError, EepromError
from catenary.procedure.exchange import Procedure
from catenary.procedure.sii import read_words
from catenary.procedure.sii_owner import with_eeprom
from catenary.procedure.sii_write import Change, write_words
from catenary.procedure.station import Station
from catenary.wire.sii import CHECKSUM_WORD, CONFIGURATION_WORDS

T = TypeVar("T")
Progress: TypeAlias = Callable[[int, int], None]  # words done, words in total

WORDS_READ = 256  # words between two progress reports
WORDS_WRITTEN = 16


class Conversing(Protocol):
    """Part of a MainDevice that this module needs."""

    def converse(self, procedure: Procedure[T]) -> T: ...


def silent(done: int, total: int) -> None:
    """Ignore the progress.

    Args:
        done: Number of words done.
        total: Number of words in total.
    """


def read_eeprom(
    main: Conversing, station: Station, size: int, *, progress: Progress = silent
) -> bytes:
    """Return the first `size` bytes of an EEPROM.

    Args:
        main: MainDevice of the device.
        station: Device.
        size: Number of bytes; an odd number is rounded down.
        progress: Function to call with (words done, words in total).
    """
    total = size // 2
    data = b""
    for first in range(0, total, WORDS_READ):
        count = min(WORDS_READ, total - first)
        data += main.converse(with_eeprom(station, read_words(station, first, count)))
        progress(first + count, total)
    return data


def write_eeprom(
    main: Conversing, station: Station, wanted: Sequence[Change], *, progress: Progress = silent
) -> None:
    """Write words in order, and read each word back.

    Args:
        main: MainDevice of the device.
        station: Device.
        wanted: Words to write.
        progress: Function to call with (words done, words in total).

    Raises:
        EepromError: A write failed. The message names the progress and the resulting state.
    """
    for first in range(0, len(wanted), WORDS_WRITTEN):
        part = wanted[first : first + WORDS_WRITTEN]
        try:
            main.converse(with_eeprom(station, write_words(station, part)))
        except CatenaryError as error:
            raise EepromError(
                f"{error.message}; {aftermath(wanted, first, first + len(part))}",
                hint=f"{error.hint}. Write the same file again when that is done"
                if error.hint
                else "write the same file again",
            ) from error
        progress(first + len(part), len(wanted))


def aftermath(wanted: Sequence[Change], done: int, begun: int) -> str:
    """Return the state of a device after an interrupted write, as text.

    Args:
        wanted: Words to write.
        done: Number of words that are certainly written.
        begun: Number of words whose write has begun.
    """
    touched = any(each.word < CONFIGURATION_WORDS for each in wanted[:begun])
    sealed = all(each.word != CHECKSUM_WORD for each in wanted[done:])
    how = f"{done} of {len(wanted)} words are written, perhaps a few more"
    if touched and not sealed:
        return (
            f"{how}, and the checksum may be wrong: after the next power-up the controller may not "
            "load its configuration, but its EEPROM can still be written"
        )
    return f"{how}: the device starts as before, but its EEPROM is a mixture of old and new words"
