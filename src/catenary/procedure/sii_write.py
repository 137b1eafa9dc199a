"""Word-by-word write access to the SII, ETG.1000.4 §6.4.5. Each word is verified."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import NamedTuple

from catenary.errors import EepromError
from catenary.procedure.exchange import Procedure, after, read, write_memory
from catenary.procedure.sii import read_words
from catenary.procedure.station import Deadline, Pace, Station, answered
from catenary.wire.datagram import EcatCommand
from catenary.wire.register import SII_CONTROL_STATUS
from catenary.wire.sii import CONFIGURATION_WORDS
from catenary.wire.sii_interface import ControlStatus, SiiCommand

WRITE_TIMEOUT = 0.5  # [s] for a word; EEPROMs need 3 to 10 ms
ATTEMPTS = 4  # per word: an EEPROM behind a busy processor may fail to acknowledge
REST = 5e-3  # [s] longest write cycle of an I²C EEPROM; some devices do not report busy then (IgH)

# One datagram for control, address and data: the enable bit is valid only in the frame that sets it
# (ESC data sheet, register 0x0502).
_COMMAND = struct.Struct("<HIH")
_WRITE = ControlStatus(command=SiiCommand.WRITE, write_enable=True).word
_ADDRESSES = 0x10000


class Change(NamedTuple):
    """One word to write."""

    word: int  # address
    value: int


def changes(old: bytes, new: bytes) -> tuple[Change, ...]:
    """Return the words in which two images differ. The configuration and its checksum come last.

    While the configuration is only partly written, its checksum is wrong. The controller can
    therefore detect an interrupted write.

    Args:
        old: The present image.
        new: The new image, of the same length.

    Raises:
        ValueError: The lengths differ or are odd.
    """
    if len(old) != len(new) or len(new) % 2:
        raise ValueError(
            f"images of {len(old)} and {len(new)} bytes: lengths must be equal and even"
        )
    differing = [
        Change(word, int.from_bytes(new[2 * word : 2 * word + 2], "little"))
        for word in range(len(new) // 2)
        if old[2 * word : 2 * word + 2] != new[2 * word : 2 * word + 2]
    ]
    return tuple(sorted(differing, key=lambda each: (each.word < CONFIGURATION_WORDS, each.word)))


def write_words(station: Station, wanted: Sequence[Change]) -> Procedure[None]:
    """Write words in order.

    Args:
        station: The device.
        wanted: The words to write.

    Raises:
        EepromError: A word could not be written. The message names it. Later words are not written.
        ValueError: An address or a value has more than 16 bits.
    """
    for each in wanted:
        yield from write_word(station, each)


def write_word(station: Station, wanted: Change) -> Procedure[None]:
    """Write one word and verify it.

    Args:
        station: The device.
        wanted: The word to write.

    Raises:
        EepromError: The word could not be written.
        ValueError: The address or the value has more than 16 bits.
    """
    if not 0 <= wanted.word < _ADDRESSES or not 0 <= wanted.value <= 0xFFFF:
        raise ValueError(f"SII: address and value must be 0 to 65535, got {wanted}")
    data = _COMMAND.pack(_WRITE, wanted.word, wanted.value)
    found, status = b"", ControlStatus()
    for _ in range(ATTEMPTS):
        yield from _until_idle(station, wanted.word)
        # Not repeatable: a controller that is busy with the first command rejects the second one.
        yield [write_memory(station.address, SII_CONTROL_STATUS.address, data, repeatable=False)]
        status = yield from _until_idle(station, wanted.word)
        yield after(REST)
        if not status.failed:
            found = yield from read_words(station, wanted.word, 1)
            if int.from_bytes(found, "little") == wanted.value:
                return
    raise _refused(station, wanted, found, status)


def _until_idle(station: Station, word: int) -> Procedure[ControlStatus]:
    deadline, pace = Deadline(WRITE_TIMEOUT), Pace()
    while True:
        [reply] = yield [read(EcatCommand.FPRD, station.address, SII_CONTROL_STATUS)]
        data = answered(reply, station, "SII status")
        status = ControlStatus.from_word(SII_CONTROL_STATUS.unpack(data))
        if not status.busy:
            return status
        if deadline.passed(reply):
            raise EepromError(
                f"{station}: its EEPROM was busy with word 0x{word:04X} for {WRITE_TIMEOUT:g} s",
                hint="power-cycle the device, then read its EEPROM",
            )
        yield after(pace.pause())


def _refused(station: Station, wanted: Change, found: bytes, status: ControlStatus) -> EepromError:
    if status.failed:
        why = f"the EEPROM does not acknowledge (control/status 0x{status.word:04X})"
        hint = "it is write-protected, or smaller than its header specifies"
    else:
        why = f"the value read back is 0x{int.from_bytes(found, 'little'):04X}"
        hint = "it is write-protected (by a pin, or by a processor that emulates it), or worn out"
    return EepromError(
        f"{station}: SII word 0x{wanted.word:04X} cannot be set to 0x{wanted.value:04X}: {why}",
        hint=hint,
    )
