"""Type and capabilities of a controller, registers 0x0000 to 0x0009, ETG.1000.4 §6.1."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum, IntFlag

from catenary.errors import DecodeError

SIZE = 10
_BLOCK = struct.Struct("<BBHBBBBH")


class Feature(IntFlag):
    """Bits of the ESC features register (0x0008). NO_... bits mark missing features."""

    FMMU_BYTE_ORIENTED = 0x0001
    UNUSED_REGISTER_ACCESS = 0x0002
    DISTRIBUTED_CLOCKS = 0x0004
    DISTRIBUTED_CLOCKS_64_BIT = 0x0008
    LOW_JITTER_EBUS = 0x0010
    ENHANCED_LINK_DETECTION_EBUS = 0x0020
    ENHANCED_LINK_DETECTION_MII = 0x0040
    SEPARATE_FCS_ERRORS = 0x0080
    ENHANCED_SYNC_ACTIVATION = 0x0100
    NO_LRW = 0x0200
    NO_READ_WRITE = 0x0400  # BRW, APRW and FPRW
    FIXED_CONFIGURATION = 0x0800  # FMMUs and SyncManagers cannot be configured


class PortKind(IntEnum):
    """Kind of a port: two bits of the port descriptor (0x0007)."""

    ABSENT = 0
    NOT_CONFIGURED = 1
    EBUS = 2
    MII = 3


@dataclass(frozen=True, slots=True)
class Information:
    """The first ten bytes of a controller's registers."""

    type: int
    revision: int
    build: int
    fmmu_count: int
    sync_manager_count: int
    ram_size: int  # [kbyte]
    ports: tuple[PortKind, PortKind, PortKind, PortKind]
    features: Feature

    @property
    def supports_lrw(self) -> bool:
        """True if one datagram can both read and write the process data (LRW)."""
        return not self.features & Feature.NO_LRW

    @property
    def supports_clocks(self) -> bool:
        """True if the controller has a distributed clock."""
        return bool(self.features & Feature.DISTRIBUTED_CLOCKS)

    @property
    def clock_bits(self) -> int:
        """Width of the system time [bits]; 0 without a distributed clock."""
        if not self.supports_clocks:
            return 0
        return 64 if self.features & Feature.DISTRIBUTED_CLOCKS_64_BIT else 32

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        descriptor = sum(kind << 2 * port for port, kind in enumerate(self.ports))
        try:
            return _BLOCK.pack(
                *(self.type, self.revision, self.build, self.fmmu_count),
                *(self.sync_manager_count, self.ram_size, descriptor, self.features),
            )
        except struct.error as error:
            raise ValueError(f"ESC information: {error}") from None


def decode_information(data: bytes) -> Information:
    """Decode the first ten bytes of the registers."""
    if len(data) != SIZE:
        raise DecodeError(f"ESC information: needs {SIZE} bytes, received {len(data)}")
    kind, revision, build, fmmus, sync_managers, ram_size, descriptor, features = _BLOCK.unpack(
        data
    )
    port_0, port_1, port_2, port_3 = (PortKind(descriptor >> 2 * port & 3) for port in range(4))
    return Information(
        *(kind, revision, build, fmmus, sync_managers, ram_size),
        (port_0, port_1, port_2, port_3),
        Feature(features),
    )
