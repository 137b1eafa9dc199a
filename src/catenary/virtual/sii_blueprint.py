"""Virtual device from an SII alone (ETG.2010): identity, memory, PDOs and their rules.

An SII lists only the objects in PDOs. It does not name PDOs that exclude each other.
"""

from __future__ import annotations

import struct
from os import PathLike
from pathlib import Path

from catenary.errors import ConfigurationError, DecodeError
from catenary.virtual.blueprint import (
    BUFFER_MAX,
    EMULATION,
    RAM_START,
    SYNC_MANAGERS_MAX,
    Blueprint,
    ram_for,
)
from catenary.virtual.description import (
    Channel,
    Description,
    FileFacts,
    MailboxDefault,
    MappedEntry,
    Pdo,
    SyncManagerDefault,
)
from catenary.virtual.mapping_quirks import MappingQuirks
from catenary.wire import sii as wire
from catenary.wire.sii import MailboxProtocol, Sii, decode_sii
from catenary.wire.sii_categories import (
    CoeDetails,
    General,
    GeneralFlags,
    PdoFlags,
    SyncManagerEnable,
    SyncManagerEntry,
    SyncManagerUse,
)
from catenary.wire.sii_categories import Pdo as SiiPdo
from catenary.wire.sync_manager import Buffering, Direction

UNPROGRAMMED = (0, 0xFFFF_FFFF)  # product codes of an empty EEPROM
DRIVE, MODULAR = 0x0002_0192, 5001  # values of object 0x1000
CONTROLWORD = 0x6040
PRODUCT_BYTE, SERIAL_BYTE = 2 * (wire.IDENTITY_WORD + 2), 2 * (wire.IDENTITY_WORD + 6)
ALIAS_BYTE, CHECKSUM_BYTE = 2 * wire.STATION_ALIAS_WORD, 2 * wire.CHECKSUM_WORD


def sii_blueprint(
    source: bytes | str | PathLike[str],
    *,
    alias: int | None = None,
    serial: int | None = None,
    clock: bool | None = None,
) -> Blueprint:
    """Return the facts of a device from its SII.

    Args:
        source: The image, or the path of a binary file.
        alias: Station alias; None: that of the image.
        serial: Serial number; None: that of the image.
        clock: True if the device has a clock; None: True if the image has modes for it.

    Raises:
        ConfigurationError: The file cannot be read, or the image is not valid or has no identity.
    """
    image, name = _read(source)
    _require_identity(image, name)
    sii = decoded(image, name)
    image += bytes(len(image) % 2)  # an EEPROM has whole words
    image = numbered(image, alias, serial)
    has_clock = bool(sii.clock_modes) if clock is None else clock
    description = describe_sii(decoded(image, name), clock=has_clock)
    coe = MailboxProtocol.COE in sii.header.mailbox_protocols
    return Blueprint(description, image, ports_of(sii.general), serves_coe=coe)


def _read(source: bytes | str | PathLike[str]) -> tuple[bytes, str]:
    """Return the image and its name for messages."""
    if isinstance(source, bytes):
        return source, "SII"
    try:
        return Path(source).read_bytes(), str(source)
    except OSError as error:
        raise ConfigurationError(f"{source}: {error.strerror}") from error


def _require_identity(image: bytes, name: str) -> None:
    product = int.from_bytes(image[PRODUCT_BYTE : PRODUCT_BYTE + 4], "little")
    if len(image) >= wire.HEADER_SIZE and product in UNPROGRAMMED:
        raise ConfigurationError(
            f"{name}: the SII has no identity: product code 0x{product:08X}",
            hint="the EEPROM is empty; read the SII of another device, or use the vendor's ESI",
        )


def decoded(image: bytes, name: str) -> Sii:
    """Return the decoded image. A wrong checksum is accepted, as some real devices have one.

    Args:
        image: The image.
        name: Name for messages.

    Raises:
        ConfigurationError: The image is not valid.
    """
    trusted = image
    if len(image) >= wire.HEADER_SIZE:
        disabled = struct.pack("<H", wire.CHECKSUM_DISABLED)
        trusted = image[:CHECKSUM_BYTE] + disabled + image[CHECKSUM_BYTE + 2 :]
    try:
        return decode_sii(trusted)
    except DecodeError as error:
        raise ConfigurationError(
            f"{name}: {error.message}",
            hint="the image must be binary and complete: catenary sii read TARGET POSITION -o FILE",
        ) from error


def numbered(image: bytes, alias: int | None, serial: int | None) -> bytes:
    """Return the image with another alias or serial number; None keeps that of the image.

    Args:
        image: The image.
        alias: Station alias. The checksum is computed again.
        serial: Serial number.

    Raises:
        ValueError: A number is out of range.
    """
    changed = bytearray(image)
    if serial is not None:
        if not 0 <= serial <= 0xFFFF_FFFF:
            raise ValueError(f"serial must be 0 to 4294967295, not {serial}")
        struct.pack_into("<I", changed, SERIAL_BYTE, serial)
    if alias is not None:
        if not 0 <= alias <= 0xFFFF:
            raise ValueError(f"alias must be 0 to 65535, not {alias}")
        struct.pack_into("<H", changed, ALIAS_BYTE, alias)
        struct.pack_into("<H", changed, CHECKSUM_BYTE, wire.checksum_of(bytes(changed)))
    return bytes(changed)


def describe_sii(sii: Sii, *, clock: bool) -> Description:
    """Return the description of a device from its SII.

    Args:
        sii: The decoded image.
        clock: True if the device has a clock.
    """
    header, general = sii.header, sii.general or General()
    managers = sii.sync_managers[:SYNC_MANAGERS_MAX]
    channels = channels_of(managers)
    coe = MailboxProtocol.COE in header.mailbox_protocols
    rx = _pdos(sii, sii.receive_pdos, [c.sync_manager for c in channels if c.outputs])
    tx = _pdos(sii, sii.transmit_pdos, [c.sync_manager for c in channels if not c.outputs])
    order = sii.string(general.order)
    drive = any(entry.index == CONTROLWORD for pdo in rx for entry in pdo.entries)
    return Description(
        name=sii.string(general.name) or order or f"0x{header.vendor:08X}:0x{header.product:08X}",
        order=order,
        group=sii.string(general.group),
        product_code=header.product,
        serial=header.serial,
        alias=header.station_alias,
        emulation=bool(header.pdi_control & EMULATION),
        pdi_type=header.pdi_control & 0xFF,
        mailbox=_mailbox(sii, general.coe) if header.mailbox_protocols else None,
        sync_managers=tuple(_manager(each) for each in managers),
        fmmus=sii.fmmus,
        rx_pdos=rx,
        tx_pdos=tx,
        clock=clock,
        ram=_ram(managers, (*rx, *tx)),
        current_milliampere=general.current_ma,
        mapping_quirks=permissions(general.coe, coe=coe),
        lrw=not general.flags & GeneralFlags.NO_LRW,
        facts=FileFacts(
            vendor=header.vendor,
            revision=header.revision,
            channels=channels,
            device_type=DRIVE if drive else MODULAR,
            sdo_information=not general.coe or CoeDetails.SDO_INFORMATION in general.coe,
            complete_access=CoeDetails.COMPLETE_ACCESS in general.coe,
        ),
    )


def permissions(details: CoeDetails, *, coe: bool) -> MappingQuirks:
    """Return which PDO objects are read-only. Without any detail, CoE permits all.

    Args:
        details: CoE details of the SII.
        coe: True if the device serves CoE.
    """

    def fixed(bit: CoeDetails) -> bool:
        return not coe or (bool(details) and bit not in details)

    return MappingQuirks(
        fixed_pdos="declared" if fixed(CoeDetails.PDO_CONFIGURATION) else "no",
        fixed_lists="declared" if fixed(CoeDetails.PDO_ASSIGN) else "no",
    )


def use_of(manager: SyncManagerEntry) -> SyncManagerUse:
    """Return the use of a SyncManager. Early images leave it at 0; its control byte then decides.

    A SyncManager without an address is unused.
    """
    if manager.use in (1, 2, 3, 4):
        return SyncManagerUse(manager.use)
    if not manager.address:
        return SyncManagerUse.UNUSED
    mailbox = manager.control & 3 == Buffering.MAILBOX
    if manager.control >> 2 & 3 == Direction.WRITE:
        return SyncManagerUse.MAILBOX_OUT if mailbox else SyncManagerUse.OUTPUTS
    return SyncManagerUse.MAILBOX_IN if mailbox else SyncManagerUse.INPUTS


def channels_of(managers: tuple[SyncManagerEntry, ...]) -> tuple[Channel, ...]:
    """Return the SyncManagers that carry process data.

    Args:
        managers: SyncManagers of the SII.
    """
    return tuple(
        Channel(
            number,
            use_of(each) is SyncManagerUse.OUTPUTS,
            each.address,
            BUFFER_MAX,
            each.length,
        )
        for number, each in enumerate(managers)
        if use_of(each) in (SyncManagerUse.OUTPUTS, SyncManagerUse.INPUTS)
    )


def ports_of(general: General | None) -> tuple[int, ...]:
    """Return the ports of a device: four bits each in the SII; two if it names none."""
    kinds = general.physical_ports if general is not None else 0
    found = tuple(port for port in range(4) if kinds >> 4 * port & 0xF)
    return found if 0 in found else (0, 1)


def _manager(each: SyncManagerEntry) -> SyncManagerDefault:
    enabled = SyncManagerEnable.ENABLED in each.enable
    return SyncManagerDefault(
        each.address, each.length, each.control, int(enabled), int(use_of(each))
    )


def _mailbox(sii: Sii, details: CoeDetails) -> MailboxDefault | None:
    receive, send = sii.header.standard_receive, sii.header.standard_send
    if not receive.size or not send.size or min(receive.offset, send.offset) < RAM_START:
        return None
    return MailboxDefault(receive.offset, receive.size, send.offset, send.size, int(details))


def _pdos(sii: Sii, pdos: tuple[SiiPdo, ...], managers: list[int]) -> tuple[Pdo, ...]:
    """Return the PDOs of one direction. Only these SyncManagers can carry them."""
    return tuple(
        Pdo(
            pdo.index,
            sii.string(pdo.name),
            tuple(
                MappedEntry(e.index, e.subindex, e.bit_length, sii.string(e.name), e.data_type)
                for e in pdo.entries
            ),
            pdo.sync_manager if pdo.sync_manager in managers else 0xFF,
            fixed=bool(pdo.flags & PdoFlags.FIXED_CONTENT),
            mandatory=bool(pdo.flags & PdoFlags.MANDATORY) and pdo.sync_manager in managers,
        )
        for pdo in pdos
    )


def _ram(managers: tuple[SyncManagerEntry, ...], pdos: tuple[Pdo, ...]) -> int:
    buffers = []
    for number, each in enumerate(managers):
        bits = sum(pdo.bits for pdo in pdos if pdo.sync_manager == number)
        buffers.append((each.address, max(bits // 8 + 1, each.length)))
    return ram_for(buffers)
