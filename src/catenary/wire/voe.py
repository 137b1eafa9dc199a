"""Vendor-specific protocol over EtherCAT (VoE), ETG.1000.6 §5.10: the header, then any data."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from catenary.errors import DecodeError

HEADER_SIZE = 6
_HEADER = struct.Struct("<IH")


@dataclass(frozen=True, slots=True)
class VoeMessage:
    """One VoE message. The vendor defines the types and the data."""

    vendor: int  # vendor ID, 32 bits
    type: int  # vendor type, 16 bits
    data: bytes = b""

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        try:
            return _HEADER.pack(self.vendor, self.type) + self.data
        except struct.error as error:
            raise ValueError(
                f"VoE: vendor 0x{self.vendor:X} or type 0x{self.type:X} does not fit: {error}"
            ) from None


def decode_voe(data: bytes) -> VoeMessage:
    """Decode the data of a mailbox message of type VOE."""
    if len(data) < HEADER_SIZE:
        raise DecodeError(f"VoE: needs {HEADER_SIZE} bytes, received {len(data)}")
    vendor, kind = _HEADER.unpack_from(data)
    return VoeMessage(vendor, kind, bytes(data[HEADER_SIZE:]))
