"""Comparison of the header of an SII with an ESI: ConfigData, bootstrap mailbox and size."""

from __future__ import annotations

from collections.abc import Iterator

from catenary.esi.device import EsiDevice, EsiEeprom
from catenary.esi.difference import Difference, Severity, Sides, Subject
from catenary.wire.sii import Header, Sii
from catenary.wire.sii_categories import General, GeneralFlags

BYTES_PER_KBIT = 128
ALIAS_WORD = 4
# words of ConfigData, ETG.2010 table 2; the alias (word 4) is set for each device
WORDS = {
    0: "PDI control",
    1: "PDI configuration",
    2: "length of the SYNC pulses",
    3: "extended PDI configuration",
    5: "reserved word 5",
    6: "reserved word 6",
}
PDI = "the controller loads this word from the EEPROM at power-up"
WRITE = "write the vendor's image into the EEPROM (`catenary sii build`, `catenary sii write`)"


def compare_configuration(esi: EsiDevice, sii: Sii) -> Iterator[Difference]:
    """Yield the differences between the header of an SII and an ESI.

    Args:
        esi: The ESI.
        sii: The SII of the device.
    """
    if esi.eeprom is not None:
        yield from _config_data(esi, esi.eeprom, sii.header)
        yield from _bootstrap(esi, esi.eeprom, sii.header)
        yield from _size(esi, esi.eeprom, sii.header)
    yield from _order(esi, sii)
    yield from _lrw(esi, sii.general or General())


def _config_data(esi: EsiDevice, eeprom: EsiEeprom, header: Header) -> Iterator[Difference]:
    """Yield the words that differ. Words that ConfigData lacks are not compared."""
    data = eeprom.config_data
    image = header.encode()
    for word, name in WORDS.items():
        given, found = data[2 * word : 2 * word + 2], image[2 * word : 2 * word + 2]
        if len(given) < 2 or given == found:
            continue
        yield Difference(
            Severity.INFO if word > ALIAS_WORD else Severity.WARNING,
            Subject.CONFIGURATION,
            f"ConfigData, {name}",
            Sides(_word(given), _word(found)),
            esi.source,
            PDI,
            WRITE,
        )


def _word(data: bytes) -> str:
    return f"0x{int.from_bytes(data, 'little'):04X}"


def _bootstrap(esi: EsiDevice, eeprom: EsiEeprom, header: Header) -> Iterator[Difference]:
    if len(eeprom.bootstrap) < 8:
        return
    numbers = [
        int.from_bytes(eeprom.bootstrap[place : place + 2], "little") for place in (0, 2, 4, 6)
    ]
    areas = (header.bootstrap_receive, header.bootstrap_send)
    for name, offset, size, area in zip(
        ("receive", "send"), numbers[::2], numbers[1::2], areas, strict=True
    ):
        if (offset, size) != (area.offset, area.size):
            yield Difference(
                Severity.WARNING,
                Subject.MAILBOX,
                f"bootstrap {name} mailbox",
                Sides(area_text(offset, size), area_text(area.offset, area.size)),
                esi.source,
                "a firmware update in BOOT may fail",
                WRITE,
            )


def area_text(offset: int, size: int) -> str:
    """Return an area of the memory as text.

    Args:
        offset: First address.
        size: Number of bytes; 0 for no area.
    """
    return f"{size} bytes at 0x{offset:04X}" if size else "none"


def _size(esi: EsiDevice, eeprom: EsiEeprom, header: Header) -> Iterator[Difference]:
    found = header.size_kbit * BYTES_PER_KBIT
    if eeprom.byte_size and eeprom.byte_size != found:
        yield Difference(
            Severity.INFO,
            Subject.CONFIGURATION,
            "size of the EEPROM",
            Sides(f"{eeprom.byte_size} bytes", f"{found} bytes"),
            esi.source,
            "tools that write the EEPROM use this size",
        )


def _order(esi: EsiDevice, sii: Sii) -> Iterator[Difference]:
    order = sii.string(sii.general.order) if sii.general else ""
    if order and esi.type and order != esi.type:
        yield Difference(
            Severity.INFO,
            Subject.IDENTITY,
            "order code",
            Sides(esi.type, order),
            esi.source,
            "the name has no effect on the operation",
        )


def _lrw(esi: EsiDevice, general: General) -> Iterator[Difference]:
    denied = bool(general.flags & GeneralFlags.NO_LRW)
    if denied == esi.use_lrd_lwr:
        return
    yield Difference(
        Severity.WARNING,
        Subject.CAPABILITY,
        "support of LRW",
        Sides(_support(not esi.use_lrd_lwr), _support(not denied)),
        esi.source,
        "a master that sends LRW to a device without support gets wrong working counters",
        "the master must use LRD and LWR if the ESI or the SII denies LRW",
    )


def _support(value: bool) -> str:
    return "supported" if value else "not supported"
