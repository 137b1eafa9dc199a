"""The image of an EEPROM in words, one fact a line: to be read, and to be compared."""

from __future__ import annotations

from collections.abc import Iterator
from difflib import unified_diff

from catenary.wire.sii import (
    CHECKSUM_DISABLED,
    CHECKSUM_WORD,
    Category,
    CategoryType,
    Header,
    MailboxArea,
    Sii,
    decode_sii,
)
from catenary.wire.sii_categories import Pdo

_KNOWN = frozenset(
    (
        CategoryType.STRINGS,
        CategoryType.GENERAL,
        CategoryType.FMMU,
        CategoryType.SYNC_MANAGER,
        CategoryType.TXPDO,
        CategoryType.RXPDO,
        CategoryType.DISTRIBUTED_CLOCKS,
    )
)


def tolerant(image: bytes) -> Sii:
    """The image, whatever its checksum. DecodeError where more than that is wrong."""
    start = 2 * CHECKSUM_WORD
    return decode_sii(image[:start] + CHECKSUM_DISABLED.to_bytes(2, "little") + image[start + 2 :])


def text_lines(sii: Sii) -> list[str]:
    """All that the image says."""
    return [
        *_header(sii.header),
        *_strings(sii),
        *_general(sii),
        *(f"FMMU {n}: use {use}" for n, use in enumerate(sii.fmmus)),
        *_sync_managers(sii),
        *_pdos(sii, "RxPDO", sii.receive_pdos),
        *_pdos(sii, "TxPDO", sii.transmit_pdos),
        *_clock_modes(sii),
        *(_other(each) for each in sii.categories if each.type not in _KNOWN),
    ]


def differences(old: Sii, new: Sii) -> list[str]:
    """The lines that differ, - the old ones, + the new ones."""
    lines = unified_diff(text_lines(old), text_lines(new), n=0, lineterm="")
    return [line for line in lines if not line.startswith(("---", "+++", "@@"))]


def _header(header: Header) -> Iterator[str]:
    yield f"vendor 0x{header.vendor:08X}"
    yield f"product 0x{header.product:08X}"
    yield f"revision 0x{header.revision:08X}"
    yield f"serial {header.serial}"
    yield f"station alias {header.station_alias}"
    yield f"PDI control 0x{header.pdi_control:04X}, configuration 0x{header.pdi_configuration:04X}"
    yield f"PDI configuration 2 0x{header.pdi_configuration_2:04X}"
    yield f"SYNC pulse length {header.sync_pulse_length * 10} ns"
    yield f"mailbox {_area(header.standard_receive)} in, {_area(header.standard_send)} out"
    yield f"bootstrap {_area(header.bootstrap_receive)} in, {_area(header.bootstrap_send)} out"
    protocols = ", ".join(str(each.name) for each in header.mailbox_protocols)
    yield f"mailbox protocols {protocols or 'none'}"
    yield f"EEPROM {header.size_kbit} kbit, version {header.version}"


def _area(area: MailboxArea) -> str:
    return f"{area.size} bytes at 0x{area.offset:04X}" if area.size else "none"


def _strings(sii: Sii) -> Iterator[str]:
    for number, text in enumerate(sii.strings, start=1):
        yield f"string {number}: {text!r}"


def _general(sii: Sii) -> Iterator[str]:
    general = sii.general
    if general is None:
        return
    yield f"name {sii.string(general.name)!r}"
    yield f"order {sii.string(general.order)!r}"
    yield f"group {sii.string(general.group)!r}"
    details = ", ".join(str(each.name) for each in general.coe)
    yield f"CoE {details or 'none'}"
    yield f"FoE {general.foe}, EoE {general.eoe}, SoE channels {general.soe_channels}"
    yield f"current {general.current_ma} mA, ports 0x{general.physical_ports:04X}"


def _sync_managers(sii: Sii) -> Iterator[str]:
    for number, each in enumerate(sii.sync_managers):
        yield (
            f"SyncManager {number}: {each.length} bytes at 0x{each.address:04X}, "
            f"control 0x{each.control:02X}, enable 0x{each.enable:02X}, use {each.use}"
        )


def _pdos(sii: Sii, kind: str, pdos: tuple[Pdo, ...]) -> Iterator[str]:
    for pdo in pdos:
        where = "unassigned" if pdo.sync_manager == 0xFF else f"SyncManager {pdo.sync_manager}"
        yield f"{kind} 0x{pdo.index:04X} {sii.string(pdo.name)!r}: {where}, flags 0x{pdo.flags:04X}"
        for entry in pdo.entries:
            yield (
                f"{kind} 0x{pdo.index:04X}   0x{entry.index:04X}:{entry.subindex:02X} "
                f"{entry.bit_length} bits {sii.string(entry.name)!r}"
            )


def _clock_modes(sii: Sii) -> Iterator[str]:
    for mode in sii.clock_modes:
        yield (
            f"clock mode {sii.string(mode.name)!r}: AssignActivate 0x{mode.assign_activate:04X}, "
            f"cycle {mode.cycle_time_ns} ns, shift {mode.shift_time_ns} ns"
        )


def _other(category: Category) -> str:
    return f"category {category.type}: {len(category.data)} bytes {category.data[:16].hex(' ')}"
