"""SII image of a device (ETG.2010), built from its ESI.

The rules where ETG.2010 leaves a choice:

- The order of the categories is 10, 30, 40, 41, 50, 51, 60, then those of the file, as in
  Beckhoff's images. All PDOs of a direction share one category: SOEM reads only the first.
- Names outside of Latin-1 get question marks, longer names are truncated to 255 characters, and
  strings after the 255th are left out. Each results in a note.
- An image that exceeds `ByteSize` is an error, because the device could not store it. Without
  `ByteSize`, the size is the smallest power of two that fits, at least 2 KiB.
- `Eeprom/Data`, the whole image, takes precedence over all other elements.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

from catenary.errors import ConfigurationError, DecodeError
from catenary.esi.device import EsiDevice, EsiEeprom, EsiPdo, EsiSyncManager
from catenary.esi.sii_general import sii_general
from catenary.esi.sii_process_data import sii_clock_modes, sii_pdos
from catenary.esi.sii_strings import SiiStrings
from catenary.model.device import Direction
from catenary.wire.sii import (
    MAXIMUM_SIZE,
    Category,
    CategoryType,
    Header,
    MailboxArea,
    MailboxProtocol,
    Sii,
    decode_sii,
)
from catenary.wire.sii_categories import (
    FmmuUse,
    SyncManagerEnable,
    SyncManagerEntry,
    SyncManagerUse,
    encode_clock_modes,
    encode_fmmus,
    encode_pdos,
    encode_strings,
    encode_sync_managers,
)

SMALLEST = 2048  # [bytes]: 16 kbit, the smallest EEPROM in use
BYTES_PER_KBIT = 128
# Words 0 to 6, which precede the checksum; KickCAT also ignores the rest (ESI/SIIBuilder.cc).
CONFIGURATION_BYTES = 14
FMMU_USES = {
    "outputs": FmmuUse.OUTPUTS,
    "inputs": FmmuUse.INPUTS,
    "mboxstate": FmmuUse.MAILBOX_STATE,
    "": FmmuUse.UNUSED,
}


PdoContent = Literal["named", "unnamed", "absent"]
# Next step if an image exceeds its EEPROM
SHORTER: dict[PdoContent, str] = {
    "named": "build it without the names of PDOs (--pdos unnamed), or without PDOs (--pdos absent)",
    "unnamed": "build it without PDOs (--pdos absent), or correct ByteSize in the ESI",
    "absent": "correct ByteSize in the ESI",
}


class SiiBuild(NamedTuple):
    """An image, and notes about contents of the file that it cannot represent."""

    image: bytes
    notes: tuple[str, ...]


def build_sii(device: EsiDevice, *, serial: int = 0, alias: int | None = None) -> bytes:
    """Return the SII image of a device, padded to the size of its EEPROM.

    Args:
        device: The device.
        serial: Serial number.
        alias: Station alias; None takes that of `ConfigData`.

    Raises:
        ValueError: The serial number or the alias is out of range.
        ConfigurationError: The image exceeds the EEPROM, or a value does not fit into its field.
    """
    return assemble_sii(device, serial=serial, alias=alias).image


def assemble_sii(
    device: EsiDevice, *, serial: int = 0, alias: int | None = None, pdos: PdoContent = "named"
) -> SiiBuild:
    """Return the SII image of a device, with notes.

    Args:
        device: The device.
        serial: Serial number.
        alias: Station alias; None takes that of `ConfigData`.
        pdos: "unnamed" leaves the names of PDOs and entries out, "absent" the PDOs, for small
            EEPROMs. A device with CoE lists its PDOs in its dictionary.

    Raises:
        ValueError: The serial number or the alias is out of range.
        ConfigurationError: The image exceeds the EEPROM, or a value does not fit into its field.
    """
    _check("serial", serial, 32)
    if alias is not None:
        _check("alias", alias, 16)
    eeprom = device.eeprom or EsiEeprom()
    notes: list[str] = []
    if eeprom.data:
        return SiiBuild(
            _given(device, eeprom, serial, alias), ("the image is that of Eeprom/Data",)
        )
    try:
        categories = _categories(device, eeprom, notes, pdos)
        header = _header(device, eeprom, notes)
        if alias is not None:
            header = replace(header, station_alias=alias)
        sii = Sii(replace(header, serial=serial), categories)
        size = _size(device, eeprom, len(sii.encode()), pdos)
        sii = replace(sii, header=replace(sii.header, size_kbit=_kbit(size)))
        return SiiBuild(sii.encode(size), tuple(notes))
    except ValueError as error:
        raise ConfigurationError(f"{device}: {error}") from error


def _check(name: str, value: int, bits: int) -> None:
    if not 0 <= value < 1 << bits:
        raise ValueError(f"{name} must be 0 to {(1 << bits) - 1}, got {value}")


def _kbit(size: int) -> int:
    return -(-size // BYTES_PER_KBIT)


def _size(device: EsiDevice, eeprom: EsiEeprom, needed: int, pdos: PdoContent) -> int:
    """Return the size of the EEPROM [bytes].

    Raises:
        ConfigurationError: The image does not fit.
    """
    size = eeprom.byte_size or SMALLEST
    while not eeprom.byte_size and size < needed:
        size *= 2
    if needed <= size <= MAXIMUM_SIZE:
        return size + size % 2
    raise ConfigurationError(
        f"{device}: the image has {needed} bytes, but its EEPROM has {min(size, MAXIMUM_SIZE)}",
        hint=SHORTER[pdos],
    )


def _given(device: EsiDevice, eeprom: EsiEeprom, serial: int, alias: int | None) -> bytes:
    """Return the image of `Eeprom/Data` with another serial number and alias."""
    try:
        sii = decode_sii(eeprom.data)
    except DecodeError as error:
        raise ConfigurationError(f"{device}: Eeprom/Data: {error.message}") from error
    header = sii.header
    alias = header.station_alias if alias is None else alias
    header = replace(header, serial=serial or header.serial, station_alias=alias, checksum=None)
    return replace(sii, header=header).encode()


def _header(device: EsiDevice, eeprom: EsiEeprom, notes: list[str]) -> Header:
    if not eeprom.config_data:
        notes.append("the file has no ConfigData: the controller gets no process data interface")
    words = eeprom.config_data[:CONFIGURATION_BYTES].ljust(CONFIGURATION_BYTES, b"\0")
    control, configuration, pulse, configuration_2, alias = (
        int.from_bytes(words[place : place + 2], "little") for place in range(0, 10, 2)
    )
    bootstrap_receive, bootstrap_send = bootstrap_areas(eeprom.bootstrap)
    return Header(
        *(device.key.vendor, device.key.product, device.key.revision),
        pdi_control=control,
        pdi_configuration=configuration,
        sync_pulse_length=pulse,
        pdi_configuration_2=configuration_2,
        station_alias=alias,
        bootstrap_receive=bootstrap_receive,
        bootstrap_send=bootstrap_send,
        standard_receive=_area(device.sync_managers, SyncManagerUse.MAILBOX_OUT),
        standard_send=_area(device.sync_managers, SyncManagerUse.MAILBOX_IN),
        mailbox_protocols=device.mailbox.protocols if device.mailbox else MailboxProtocol(0),
        reserved=words[10:14].ljust(78, b"\0"),
    )


def bootstrap_areas(words: bytes) -> tuple[MailboxArea, MailboxArea]:
    """Return the areas of `BootStrap`, which the device receives and sends; a missing one is empty.

    Args:
        words: Words 0x14 to 0x17 of the EEPROM.
    """
    numbers = [int.from_bytes(words[place : place + 2], "little") for place in range(0, 8, 2)]
    return MailboxArea(*numbers[:2]), MailboxArea(*numbers[2:])


def _area(managers: Sequence[EsiSyncManager], use: SyncManagerUse) -> MailboxArea:
    for manager in managers:
        if manager.use is use and manager.default_size:
            return MailboxArea(manager.start, manager.default_size)
    return MailboxArea()


def _categories(
    device: EsiDevice, eeprom: EsiEeprom, notes: list[str], pdos: PdoContent
) -> tuple[Category, ...]:
    strings = SiiStrings()
    general = sii_general(device, strings)
    outputs, inputs = (
        sii_pdos(found, device.dictionary, strings, notes, names=pdos == "named")
        for found in _written_pdos(device, pdos)
    )
    modes = sii_clock_modes(device.op_modes, strings, notes)
    found = (
        (CategoryType.STRINGS, encode_strings(strings.texts)),
        (CategoryType.GENERAL, general.encode()),
        (CategoryType.FMMU, encode_fmmus(_fmmus(device.fmmus, notes))),
        (CategoryType.SYNC_MANAGER, encode_sync_managers(_sync_managers(device))),
        (CategoryType.TXPDO, encode_pdos(inputs)),
        (CategoryType.RXPDO, encode_pdos(outputs)),
        (CategoryType.DISTRIBUTED_CLOCKS, encode_clock_modes(modes)),
        *((own.number, own.data + bytes(len(own.data) % 2)) for own in eeprom.categories),
    )
    notes += strings.notes
    return tuple(Category(number, data) for number, data in found if data)


def _written_pdos(
    device: EsiDevice, pdos: PdoContent
) -> tuple[tuple[EsiPdo, ...], tuple[EsiPdo, ...]]:
    if pdos == "absent":
        return (), ()
    return device.pdos_of(Direction.OUTPUT), device.pdos_of(Direction.INPUT)


def _fmmus(texts: Sequence[str], notes: list[str]) -> list[int]:
    """Return the uses of the FMMUs; empty if the file names none that ETG.2000 defines."""
    uses = [FMMU_USES.get(text.lower()) for text in texts]
    known = any(uses)
    for number, (text, use) in enumerate(zip(texts, uses, strict=True)):
        if use is None:
            result = "it is written as unused" if known else "the category is left out"
            notes.append(f"FMMU {number}: the use {text!r} has no number; {result}")
    return [int(use or FmmuUse.UNUSED) for use in uses] if known else []


def _sync_managers(device: EsiDevice) -> list[SyncManagerEntry]:
    return [
        SyncManagerEntry(
            each.start, each.default_size, each.control, enable=_enable(each), use=each.use
        )
        for each in device.sync_managers
    ]


def _enable(manager: EsiSyncManager) -> SyncManagerEnable:
    return (
        (SyncManagerEnable.ENABLED if manager.enabled else SyncManagerEnable(0))
        | (SyncManagerEnable.VIRTUAL if manager.virtual else SyncManagerEnable(0))
        | (SyncManagerEnable.OP_ONLY if manager.op_only else SyncManagerEnable(0))
    )
