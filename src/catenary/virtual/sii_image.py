"""SII images, ETG.2010, encoded from the description of a device.

The code is independent of the decoder `catenary.wire.sii`, so that each tests the other.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

from catenary.virtual.description import VENDOR_ID, Description, Pdo, SyncManagerDefault
from catenary.virtual.op_modes import STANDARD, OpMode
from catenary.virtual.sii_quirks import NO_SII_QUIRKS, SiiQuirks

STRINGS, GENERAL, FMMU, SYNC_MANAGER, TX_PDO, RX_PDO, CLOCK, END = (
    10,
    30,
    40,
    41,
    50,
    51,
    60,
    0xFFFF,
)
FIXED_CONTENT = 0x0010  # PDO flag
COE_PROTOCOL, FOE_PROTOCOL = 0x0004, 0x0008
AOE, EOE, SOE, VOE = 1, 2, 5, 15  # in the mailbox header
PROTOCOL_BITS = {AOE: 0x0001, EOE: 0x0002, SOE: 0x0010, VOE: 0x0020}  # in word 0x001C
# Flags in byte 0x0B of the general category
NO_LRW, IDENTIFICATION_IN_MEMORY = 0x02, 0x10
HEADER_BYTES = 128
UNUSED = SyncManagerDefault(0, 0, 0, 0, 0)


class _Strings:
    """String category. Each string is stored once and numbered from 1; 0 means no string."""

    def __init__(self, prefix: str) -> None:
        self.texts: list[bytes] = []
        self._prefix = prefix

    def number(self, text: str) -> int:
        encoded = (self._prefix + text).encode("latin-1", "replace")[:255] if text else b""
        if not encoded or (encoded not in self.texts and len(self.texts) == 255):
            return 0
        if encoded not in self.texts:
            self.texts.append(encoded)
        return self.texts.index(encoded) + 1

    def encode(self) -> bytes:
        return bytes([len(self.texts)]) + b"".join(bytes([len(t)]) + t for t in self.texts)


def checksum(configuration: bytes) -> int:
    """Return the CRC-8 of the first 14 bytes (x^8 + x^2 + x + 1, initial value 0xFF)."""
    crc = 0xFF
    for byte in configuration[:14]:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x07 if crc & 0x80 else crc << 1) & 0xFF
    return crc


def _header(device: Description, size: int, mailbox_size: int | None) -> bytes:
    pdi_control = device.pdi_type | (0x0100 if device.emulation else 0)
    configuration = struct.pack("<HHHHH4x", pdi_control, 0, 100, 0, device.alias)
    words = configuration + struct.pack("<H", checksum(configuration))
    words += struct.pack("<4I", VENDOR_ID, device.product_code, device.revision, device.serial)
    words += bytes(8)  # delays
    boot = device.bootstrap
    words += bytes(8) if boot is None else struct.pack("<4H", *boot.areas)
    box = device.mailbox
    if box is None:
        words += bytes(10)
    else:
        words += struct.pack(
            "<5H",
            box.receive_offset,
            box.receive_size if mailbox_size is None else mailbox_size,
            box.send_offset,
            box.send_size if mailbox_size is None else mailbox_size,
            _protocols(device),
        )
    words = words.ljust(124, b"\0")
    return words + struct.pack("<HH", max(size * 8 // 1024 - 1, 0), 1)


def _protocols(device: Description) -> int:
    """Return the mailbox protocols as the bits of word 0x001C."""
    found = COE_PROTOCOL | (FOE_PROTOCOL if device.serves_files else 0)
    return found | sum(PROTOCOL_BITS[number] for number in device.protocols)


def _general(device: Description, strings: _Strings) -> bytes:
    name = strings.number(device.name)  # first, because SOEM shows string 1 as the name
    group, order = strings.number(device.group), strings.number(device.order)
    details = device.mailbox.coe_details if device.mailbox else 0
    flags = IDENTIFICATION_IN_MEMORY if device.identification else 0
    flags |= 0 if device.lrw else NO_LRW
    ports = sum(1 << 4 * port for port in device.ports)  # 1: MII
    return struct.pack(
        "<BBBBxBBBBBBBhBxHH12x",
        *(group, 0, order, name, details, device.serves_files, EOE in device.protocols),
        *(SOE in device.protocols, device.axes, 0, flags),
        *(device.current_milliampere, group, ports, 0x0012 if device.identification else 0),
    )


def _pdos(pdos: Sequence[Pdo], strings: _Strings, quirks: SiiQuirks, flags: int) -> bytes:
    if quirks.pdos == "absent":
        return b""

    def number(name: str) -> int:
        return 0 if quirks.pdos == "unnamed" else strings.number(name)

    out = b""
    for pdo in pdos:
        count, sync_manager = len(pdo.entries), pdo.sync_manager
        out += struct.pack("<HBBBBH", pdo.index, count, sync_manager, 0, number(pdo.name), flags)
        for e in pdo.entries:
            name = number(e.name)
            out += struct.pack("<HBBBBH", e.index, e.subindex, name, e.data_type, e.bits, 0)
    return out


def _clock(modes: Sequence[OpMode], strings: _Strings) -> bytes:
    return b"".join(
        struct.pack(
            "<IiihHhBB4x",
            *(mode.sync0_ns, mode.shift_ns, mode.sync1_shift_ns),
            *(mode.sync1_factor, mode.assign_activate, mode.sync0_factor),
            *(strings.number(mode.name), 0),
        )
        for mode in modes
    )


def _category(kind: int, content: bytes) -> bytes:
    padded = content + b"\0" * (len(content) % 2)
    return struct.pack("<HH", kind, len(padded) // 2) + padded


def make_sii_image(device: Description, quirks: SiiQuirks = NO_SII_QUIRKS) -> bytes:
    """Return the complete EEPROM content, padded with 0xFF to a power of two of at least 2 KiB.

    Args:
        device: Description of the device.
        quirks: Differences of the SII from the description.
    """
    strings = _Strings(quirks.text_prefix)
    sync_managers = device.sync_managers
    if quirks.sync_managers is not None:
        filled = (*sync_managers, *[UNUSED] * quirks.sync_managers)
        sync_managers = filled[: quirks.sync_managers]
    parts = [(GENERAL, _general(device, strings)), (FMMU, bytes(device.fmmus))]
    managers = b"".join(
        struct.pack("<HHBBBB", s.start, s.length, s.control, 0, s.enable, s.kind)
        for s in sync_managers
    )
    parts.append((SYNC_MANAGER, managers))
    # All PDOs of a direction share one category, as in real terminals: SOEM reads only the first.
    flags = FIXED_CONTENT if device.mapping_quirks.fixed_pdos == "declared" else 0
    parts.append((TX_PDO, _pdos(device.tx_pdos, strings, quirks, flags)))
    parts.append((RX_PDO, _pdos(device.rx_pdos, strings, quirks, flags)))
    if device.clock and (device.axes or device.op_modes is not STANDARD):
        parts.append((CLOCK, _clock(device.op_modes, strings)))
    parts.insert(0, (STRINGS, strings.encode()))
    body = b"".join(_category(kind, content) for kind, content in parts if content)
    body += struct.pack("<HH", END, 0xFFFF)
    size = 2048
    while size < HEADER_BYTES + len(body):
        size *= 2
    return (_header(device, size, quirks.mailbox_size) + body).ljust(size, b"\xff")
