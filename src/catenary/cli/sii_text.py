"""EEPROM images as text, with one field per line.

Every field of ETG.2010 has a line, and other data is shown as bytes. Two images with the same text
therefore differ only in padding.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from difflib import unified_diff
from enum import IntFlag

from catenary import types
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
from catenary.wire.sii_categories import (
    ClockMode,
    General,
    GeneralFlags,
    Pdo,
    PdoEntry,
    PdoFlags,
    SyncManagerEnable,
    SyncManagerEntry,
    SyncManagerUse,
)

ROW = 16  # bytes per line
GROUP_AGAIN = 1  # place of byte 14 of the general category in General.reserved
KNOWN = frozenset(
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
    """Decode an image, but ignore its checksum.

    Raises:
        DecodeError: The image is invalid for another reason.
    """
    start = 2 * CHECKSUM_WORD
    found = image[start : start + 2]
    sii = decode_sii(image[:start] + CHECKSUM_DISABLED.to_bytes(2, "little") + image[start + 2 :])
    return replace(sii, header=replace(sii.header, checksum=int.from_bytes(found, "little")))


def text_lines(sii: Sii) -> list[str]:
    """Return all fields of the image as lines."""
    return [
        *_header(sii.header),
        *_order(sii.categories),
        *_strings(sii),
        *(() if sii.general is None else _general(sii, sii.general)),
        *(f"FMMU {n}: use {use}" for n, use in enumerate(sii.fmmus)),
        *(_sync_manager(number, each) for number, each in enumerate(sii.sync_managers)),
        *_pdos(sii, "RxPDO", sii.receive_pdos),
        *_pdos(sii, "TxPDO", sii.transmit_pdos),
        *(line for n, mode in enumerate(sii.clock_modes) for line in _clock_mode(sii, n, mode)),
        *(line for each in sii.categories if each.type not in KNOWN for line in _other(each)),
        *_rows("after the categories", sii.trailing),
    ]


def differences(old: bytes, new: bytes) -> list[str]:
    """Return the lines that differ, with - before old lines and + before new lines.

    If only padding differs, return the words that differ. Raises DecodeError if an image is
    invalid.
    """
    before, after = text_lines(tolerant(old)), text_lines(tolerant(new))
    lines = unified_diff(before, after, n=0, lineterm="")
    found = [line for line in lines if not line.startswith(("---", "+++", "@@"))]
    return found or word_differences(old, new)


def word_differences(old: bytes, new: bytes) -> list[str]:
    """Return the words that differ, by address."""
    return [
        f"word 0x{start // 2:04X}: {old[start : start + 2].hex(' ') or 'missing'} -> "
        f"{new[start : start + 2].hex(' ') or 'missing'}"
        for start in range(0, max(len(old), len(new)), 2)
        if old[start : start + 2] != new[start : start + 2]
    ]


def _header(header: Header) -> Iterator[str]:
    yield f"vendor 0x{header.vendor:08X}"
    yield f"product 0x{header.product:08X}"
    yield f"revision 0x{header.revision:08X}"
    yield f"serial {header.serial}"
    yield f"station alias {header.station_alias}"
    yield f"checksum 0x{header.checksum or 0:04X}"
    yield f"PDI control 0x{header.pdi_control:04X}, configuration 0x{header.pdi_configuration:04X}"
    yield f"PDI configuration 2 0x{header.pdi_configuration_2:04X}"
    yield f"SYNC pulse length {header.sync_pulse_length * 10} ns"
    yield f"mailbox {_area(header.standard_receive)} in, {_area(header.standard_send)} out"
    yield f"bootstrap {_area(header.bootstrap_receive)} in, {_area(header.bootstrap_send)} out"
    yield f"mailbox protocols {_flags(header.mailbox_protocols)}"
    yield f"EEPROM {header.size_kbit} kbit, version {header.version}"
    for name, part in (
        ("words 0x05 and 0x06", header.reserved[0:4]),
        ("words 0x10 to 0x13", header.reserved[4:12]),
        ("words 0x1D to 0x3D", header.reserved[12:]),
    ):
        if any(part):
            yield from _rows(f"reserved {name}", part)


def _area(area: MailboxArea) -> str:
    return f"{area.size} bytes at 0x{area.offset:04X}" if area.size or area.offset else "none"


def _flags(flags: IntFlag) -> str:
    """Return the names of all set bits, and the unnamed bits as a number."""
    names = [str(each.name) for each in flags]
    rest = int(flags) & ~sum(int(each) for each in type(flags))
    return ", ".join([*names, f"0x{rest:X}"] if rest else names) or "none"


def _order(categories: tuple[Category, ...]) -> Iterator[str]:
    for each in categories:
        yield f"category {each.type}, {len(each.data)} bytes"


def _strings(sii: Sii) -> Iterator[str]:
    for number, text in enumerate(sii.strings, start=1):
        yield f"string {number}: {text!r}"


def _general(sii: Sii, general: General) -> Iterator[str]:
    yield f"name {sii.string(general.name)!r}"
    yield f"order {sii.string(general.order)!r}"
    yield f"group {sii.string(general.group)!r}"
    yield f"image {sii.string(general.image)!r}"
    yield (
        f"numbers of these strings {general.name}, {general.order}, {general.group}, "
        f"{general.image}"
    )
    yield f"CoE {_flags(general.coe)}"
    yield f"FoE {general.foe}, EoE {general.eoe}, SoE channels {general.soe_channels}"
    yield f"DS402 channels {general.ds402_channels}, SysMan class {general.sysman_class}"
    yield f"flags 0x{general.flags:02X}: {_flags(GeneralFlags(general.flags))}"
    yield f"current {general.current_ma} mA, ports 0x{general.physical_ports:04X}"
    yield f"identification at 0x{general.identification_address:04X}"
    again = general.reserved[GROUP_AGAIN]
    if again:
        yield f"group again, number {again}: {sii.string(again)!r}"
    others = general.reserved[:GROUP_AGAIN] + b"\0" + general.reserved[GROUP_AGAIN + 1 :]
    if any(others):
        yield from _rows("general, reserved", others)


def _sync_manager(number: int, each: SyncManagerEntry) -> str:
    enable = _flags(SyncManagerEnable(each.enable))
    use = each.use
    meaning = f" ({SyncManagerUse(use).name})" if use in set(SyncManagerUse) else ""
    return (
        f"SyncManager {number}: {each.length} bytes at 0x{each.address:04X}, "
        f"control 0x{each.control:02X}, status 0x{each.status:02X}, "
        f"enable 0x{each.enable:02X} ({enable}), use {use}{meaning}"
    )


def _pdos(sii: Sii, kind: str, pdos: tuple[Pdo, ...]) -> Iterator[str]:
    for pdo in pdos:
        name = f"{kind} 0x{pdo.index:04X}"
        where = "unassigned" if pdo.sync_manager == 0xFF else f"SyncManager {pdo.sync_manager}"
        yield (
            f"{name} {sii.string(pdo.name)!r}: {where}, synchronisation {pdo.synchronization}, "
            f"flags 0x{pdo.flags:04X} ({_flags(PdoFlags(pdo.flags))})"
        )
        yield from (f"{name}   {_entry(sii, entry)}" for entry in pdo.entries)


def _entry(sii: Sii, entry: PdoEntry) -> str:
    flags = f", flags 0x{entry.flags:04X}" * bool(entry.flags)
    return (
        f"0x{entry.index:04X}:{entry.subindex:02X} {entry.bit_length} bits "
        f"{_type(entry.data_type)} {sii.string(entry.name)!r}{flags}"
    )


def _type(index: int) -> str:
    try:
        return types.by_index(index).name
    except ValueError:
        return f"type 0x{index:02X}"


def _clock_mode(sii: Sii, number: int, mode: ClockMode) -> Iterator[str]:
    start = f"OpMode {number} {sii.string(mode.name)!r}"
    yield f"{start}: AssignActivate 0x{mode.assign_activate:04X}"
    yield (
        f"{start}: SYNC0 cycle {mode.cycle_time_ns} ns, factor {mode.sync0_factor}, "
        f"shift {mode.shift_time_ns} ns"
    )
    yield f"{start}: SYNC1 factor {mode.sync1_factor}, shift {mode.shift_time_1_ns} ns"
    yield f"{start}: description {sii.string(mode.description)!r}"
    if any(mode.reserved):
        yield f"{start}: reserved {mode.reserved.hex(' ')}"


def _other(category: Category) -> Iterator[str]:
    yield from _rows(f"category {category.type}", category.data)


def _rows(title: str, data: bytes) -> Iterator[str]:
    """Yield lines of unnamed bytes; one line if all bytes have the same value."""
    if data and data == data[:1] * len(data):
        yield f"{title}: {len(data)} bytes of {data[:1].hex()}"
        return
    for start in range(0, len(data), ROW):
        yield f"{title}, +0x{start:04X}: {data[start : start + ROW].hex(' ')}"
