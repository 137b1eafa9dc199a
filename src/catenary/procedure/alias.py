"""Station alias in the EEPROM, ETG.1000.6 §5.4. The checksum covers this word."""

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
    """Read the alias in the EEPROM. The device uses it from its next power-up."""
    return int.from_bytes((yield from read_words(station, STATION_ALIAS_WORD, 1)), "little")


def write_alias(station: Station, alias: int) -> Procedure[None]:
    """Write the alias and the checksum to the EEPROM. The alias is used from the next power-up.

    Args:
        station: The device.
        alias: The alias, 0 to 65535; 0 means no alias.

    Raises:
        ValueError: The alias is out of range.
        EepromError: The present checksum is wrong, or a word cannot be written. A corrected
            checksum would hide invalid words in the rest of the configuration.
    """
    if not 0 <= alias <= 0xFFFF:
        raise ValueError(f"station alias {alias} is out of range; use 0 to 65535")
    old = yield from read_words(station, 0, CONFIGURATION_WORDS)
    checksum = int.from_bytes(old[2 * CHECKSUM_WORD :], "little")
    if checksum != CHECKSUM_DISABLED:
        if checksum & 0xFF != checksum_of(old):
            raise EepromError(
                f"{station}: the checksum of its EEPROM is 0x{checksum:04X}, expected "
                f"0x{checksum_of(old):04X}: its configuration may be damaged",
                hint="write the whole image of the vendor: catenary sii write",
            )
        new = bytearray(old)
        new[2 * STATION_ALIAS_WORD : 2 * STATION_ALIAS_WORD + 2] = alias.to_bytes(2, "little")
        checksum = checksum & 0xFF00 | checksum_of(bytes(new))
    yield from write_words(
        station, [Change(STATION_ALIAS_WORD, alias), Change(CHECKSUM_WORD, checksum)]
    )
