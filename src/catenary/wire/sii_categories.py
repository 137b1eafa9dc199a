"""Contents of the SII categories, ETG.1000.6 §5.4 tables 18 to 27 and ETG.2010.

Categories are padded to whole words. If less than one record remains at the end of a category, it
is padding. String numbers start at 1; 0 means no string.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import Any

from catenary.errors import DecodeError

_GENERAL = struct.Struct("<4BB5BBBhBBHH12s")
_SYNC_MANAGER = struct.Struct("<HHBBBB")
_PDO = struct.Struct("<HBBBBH")
_PDO_ENTRY = struct.Struct("<HBBBBH")
_CLOCK_MODE = struct.Struct("<IiihHhBB4s")


class CoeDetails(IntFlag):
    """CoE capabilities of the device: byte 5 of the general category."""

    SDO = 0x01
    SDO_INFORMATION = 0x02
    PDO_ASSIGN = 0x04
    PDO_CONFIGURATION = 0x08
    UPLOAD_AT_START = 0x10
    COMPLETE_ACCESS = 0x20


class FmmuUse(IntEnum):
    """Intended use of an FMMU."""

    UNUSED = 0
    OUTPUTS = 1
    INPUTS = 2
    MAILBOX_STATE = 3
    NONE = 0xFF


class SyncManagerUse(IntEnum):
    """Intended use of a SyncManager."""

    UNUSED = 0
    MAILBOX_OUT = 1
    MAILBOX_IN = 2
    OUTPUTS = 3
    INPUTS = 4


class SyncManagerEnable(IntFlag):
    """Bits of the enable byte of a SyncManager entry."""

    ENABLED = 0x01
    FIXED_CONTENT = 0x02
    VIRTUAL = 0x04
    OP_ONLY = 0x08


class GeneralFlags(IntFlag):
    """Flags of the general category, byte 0x0B."""

    SAFE_OP = 0x01
    NO_LRW = 0x02  # the device does not support LRW
    MAILBOX_DATA_LINK_LAYER = 0x04
    IDENTIFICATION_BY_AL_STATUS = 0x08
    IDENTIFICATION_BY_MEMORY = 0x10  # at General.identification_address


class PdoFlags(IntFlag):
    """Flags of a PDO. The last four are reserved, but ETG.2010 names them."""

    MANDATORY = 0x0001
    DEFAULT = 0x0002
    OVERSAMPLE = 0x0004
    FIXED_CONTENT = 0x0010
    VIRTUAL_CONTENT = 0x0020
    DOWNLOAD_ANYWAY = 0x0040
    FROM_MODULE = 0x0080
    MODULE_ALIGN = 0x0100
    DEPENDS_ON_SLOT = 0x0200
    DEPENDS_ON_SLOT_GROUP = 0x0400
    OVERWRITTEN_BY_MODULE = 0x0800
    CONFIGURABLE = 0x1000
    AUTOMATIC_NAME = 0x2000
    NO_AUTOMATIC_EXCLUDE = 0x4000
    WRITABLE = 0x8000


_NO_DETAILS = CoeDetails(0)


@dataclass(frozen=True, slots=True)
class General:
    """General category: string numbers of names, mailbox details, E-bus current."""

    group: int = 0
    image: int = 0
    order: int = 0
    name: int = 0
    coe: CoeDetails = _NO_DETAILS
    foe: int = 0
    eoe: int = 0
    soe_channels: int = 0
    ds402_channels: int = 0
    sysman_class: int = 0
    flags: int = 0
    current_ma: int = 0  # drawn from the E-bus; negative if fed into it [mA]
    physical_ports: int = 0  # four bits per port: 1 MII, 3 E-bus
    identification_address: int = 0  # address of the device identification
    reserved: bytes = bytes(15)  # bytes 4, 14, 15 and the last 12, verbatim

    def encode(self) -> bytes:
        """Return the 32 encoded bytes. Raises ValueError if a field does not fit."""
        reserved = self.reserved
        try:
            return _GENERAL.pack(
                *(self.group, self.image, self.order, self.name, reserved[0]),
                *(self.coe, self.foe, self.eoe, self.soe_channels, self.ds402_channels),
                *(self.sysman_class, self.flags, self.current_ma, reserved[1], reserved[2]),
                *(self.physical_ports, self.identification_address, reserved[3:15]),
            )
        except (struct.error, IndexError) as error:
            raise ValueError(f"SII general category: {error}") from None


def decode_general(data: bytes) -> General:
    """Decode the general category. Missing fields of early editions are 0."""
    if len(data) < 16:
        raise DecodeError(f"SII general category: needs at least 16 bytes, received {len(data)}")
    fields = _GENERAL.unpack(data[: _GENERAL.size].ljust(_GENERAL.size, b"\x00"))
    (group, image, order, name, pad, coe, foe, eoe, soe, ds402, sysman, flags) = fields[:12]
    current, pad_14, pad_15, ports, identification, last = fields[12:]
    return General(
        *(group, image, order, name, CoeDetails(coe), foe, eoe, soe, ds402, sysman, flags),
        *(current, ports, identification, bytes((pad, pad_14, pad_15)) + last),
    )


def encode_strings(strings: Sequence[str]) -> bytes:
    """Return the strings category.

    Raises:
        ValueError: There are more than 255 strings, a string has more than 255 characters, or a
            character is not in Latin-1.
    """
    if len(strings) > 255:
        raise ValueError(f"SII strings: at most 255 are possible, got {len(strings)}")
    parts = [bytes((len(strings),))]
    for text in strings:
        try:
            raw = text.encode("latin-1")
            parts.append(bytes((len(raw),)) + raw)
        except ValueError as error:
            raise ValueError(f"SII string {text!r}: {error}") from None
    return _even(b"".join(parts))


def decode_strings(data: bytes) -> tuple[str, ...]:
    """Decode the texts of the strings category as Latin-1."""
    strings: list[str] = []
    offset = 1
    for _ in range(data[0] if data else 0):
        length = data[offset] if offset < len(data) else len(data)
        if offset + 1 + length > len(data):
            raise DecodeError(
                f"SII strings: string {len(strings) + 1} of {data[0]} at byte {offset} exceeds "
                f"the {len(data)} bytes of the category"
            )
        strings.append(data[offset + 1 : offset + 1 + length].decode("latin-1"))
        offset += 1 + length
    return tuple(strings)


def encode_fmmus(uses: Sequence[int]) -> bytes:
    """Return the FMMU category. Raises ValueError if a number is not 0 to 255."""
    data = bytes(uses)
    return data + (b"\xff" if len(data) % 2 else b"")


@dataclass(frozen=True, slots=True)
class SyncManagerEntry:
    """Settings of a SyncManager. For the control byte, see `sync_manager.Control`."""

    address: int
    length: int
    control: int
    status: int = 0
    enable: SyncManagerEnable = SyncManagerEnable.ENABLED
    use: int = SyncManagerUse.UNUSED  # a SyncManagerUse, or an undefined number

    def encode(self) -> bytes:
        """Return the 8 encoded bytes. Raises ValueError if a field does not fit."""
        try:
            return _SYNC_MANAGER.pack(
                *(self.address, self.length, self.control, self.status, self.enable, self.use)
            )
        except struct.error as error:
            raise ValueError(f"SII SyncManager: {error}") from None


def encode_sync_managers(entries: Sequence[SyncManagerEntry]) -> bytes:
    """Return the SyncManager category."""
    return b"".join(entry.encode() for entry in entries)


def decode_sync_managers(data: bytes) -> tuple[SyncManagerEntry, ...]:
    """Decode the SyncManager category."""
    return tuple(
        SyncManagerEntry(address, length, control, status, SyncManagerEnable(enable), use)
        for address, length, control, status, enable, use in _records(_SYNC_MANAGER, data)
    )


@dataclass(frozen=True, slots=True)
class PdoEntry:
    """One object in a PDO. Index 0 marks a gap."""

    index: int
    subindex: int
    bit_length: int
    data_type: int = 0  # see types.by_index
    name: int = 0
    flags: int = 0

    def encode(self) -> bytes:
        """Return the 8 encoded bytes. Raises ValueError if a field does not fit."""
        try:
            return _PDO_ENTRY.pack(
                *(self.index, self.subindex, self.name),
                *(self.data_type, self.bit_length, self.flags),
            )
        except struct.error as error:
            raise ValueError(f"SII PDO entry: {error}") from None


@dataclass(frozen=True, slots=True)
class Pdo:
    """A PDO and its entries."""

    index: int
    entries: tuple[PdoEntry, ...] = ()
    sync_manager: int = 0xFF  # 0xFF if the PDO is not assigned
    synchronization: int = 0
    name: int = 0
    flags: int = 0

    @property
    def bit_length(self) -> int:
        """Sum of the lengths of its entries [bits]."""
        return sum(entry.bit_length for entry in self.entries)

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        try:
            head = _PDO.pack(
                *(self.index, len(self.entries), self.sync_manager),
                *(self.synchronization, self.name, self.flags),
            )
        except struct.error as error:
            raise ValueError(f"SII PDO: {error}") from None
        return head + b"".join(entry.encode() for entry in self.entries)


def encode_pdos(pdos: Sequence[Pdo]) -> bytes:
    """Return a TXPDO or RXPDO category."""
    return b"".join(pdo.encode() for pdo in pdos)


def decode_pdos(data: bytes) -> tuple[Pdo, ...]:
    """Decode a TXPDO or RXPDO category."""
    pdos: list[Pdo] = []
    offset = 0
    while offset + _PDO.size <= len(data):
        index, count, sync_manager, synchronization, name, flags = _PDO.unpack_from(data, offset)
        offset += _PDO.size
        end = offset + count * _PDO_ENTRY.size
        if end > len(data):
            raise DecodeError(
                f"SII PDO 0x{index:04X}: {count} entries do not fit into its category"
            )
        entries = tuple(
            PdoEntry(entry, subindex, bits, data_type, text, bits_flags)
            for entry, subindex, text, data_type, bits, bits_flags in _PDO_ENTRY.iter_unpack(
                data[offset:end]
            )
        )
        pdos.append(Pdo(index, entries, sync_manager, synchronization, name, flags))
        offset = end
    return tuple(pdos)


@dataclass(frozen=True, slots=True)
class ClockMode:
    """One mode of distributed clocks (category 60).

    If the cycle time is 0, `sync0_factor` gives SYNC0's cycle: a multiple of the exchange period,
    or a fraction if negative.
    """

    cycle_time_ns: int = 0
    shift_time_ns: int = 0
    shift_time_1_ns: int = 0
    sync1_factor: int = 0
    assign_activate: int = 0  # registers 0x0980 (low byte) and 0x0981
    sync0_factor: int = 0
    name: int = 0
    description: int = 0
    reserved: bytes = bytes(4)

    def encode(self) -> bytes:
        """Return the 24 encoded bytes. Raises ValueError if a field does not fit."""
        try:
            return _CLOCK_MODE.pack(
                *(self.cycle_time_ns, self.shift_time_ns, self.shift_time_1_ns),
                *(self.sync1_factor, self.assign_activate, self.sync0_factor),
                *(self.name, self.description, self.reserved),
            )
        except struct.error as error:
            raise ValueError(f"SII distributed clocks: {error}") from None


def encode_clock_modes(modes: Sequence[ClockMode]) -> bytes:
    """Return the distributed clocks category."""
    return b"".join(mode.encode() for mode in modes)


def decode_clock_modes(data: bytes) -> tuple[ClockMode, ...]:
    """Decode the distributed clocks category."""
    return tuple(ClockMode(*fields) for fields in _records(_CLOCK_MODE, data))


def _records(record: struct.Struct, data: bytes) -> Iterator[tuple[Any, ...]]:
    return record.iter_unpack(data[: len(data) // record.size * record.size])


def _even(data: bytes) -> bytes:
    return data + b"\x00" if len(data) % 2 else data
