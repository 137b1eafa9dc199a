"""The station alias in the EEPROM, ETG.1000.6 §5.4: a word that the checksum covers."""

from __future__ import annotations

from catenary.errors import EepromError
from catenary.procedure.exchange import Procedure
from catenary.procedure.sii import read_words
from catenary.procedure.sii_write import Change, write_words
from catenary.procedure.station import Station
from catenary.wire.sii import (
    CHECKSUM_DISABLED,
    CHECKSUM_WORD,
    CONFIGURATION_WORDS,
    STATION_ALIAS_WORD,
    checksum_of,
)


def read_alias(station: Station) -> Procedure[int]:
    """The alias in the EEPROM: what the device will have after its next power-up."""
    return int.from_bytes((yield from read_words(station, STATION_ALIAS_WORD, 1)), "little")


def write_alias(station: Station, alias: int) -> Procedure[None]:
    """Writes alias and checksum. The device takes it over at its next power-up. EepromError where
    the checksum is wrong already: a right one would hide that the rest was never checked."""
    if not 0 <= alias <= 0xFFFF:
        raise ValueError(f"a station alias is 0 to 65535, not {alias}")
    old = yield from read_words(station, 0, CONFIGURATION_WORDS)
    checksum = int.from_bytes(old[2 * CHECKSUM_WORD :], "little")
    if checksum != CHECKSUM_DISABLED:
        if checksum & 0xFF != checksum_of(old):
            raise EepromError(
                f"{station}: the checksum of its EEPROM is 0x{checksum:04X}, "
                f"0x{checksum_of(old):04X} would be right: its configuration is not to be trusted",
                hint="write the whole image of its maker: catenary sii write",
            )
        new = bytearray(old)
        new[2 * STATION_ALIAS_WORD : 2 * STATION_ALIAS_WORD + 2] = alias.to_bytes(2, "little")
        checksum = checksum & 0xFF00 | checksum_of(bytes(new))
    yield from write_words(
        station, [Change(STATION_ALIAS_WORD, alias), Change(CHECKSUM_WORD, checksum)]
    )
