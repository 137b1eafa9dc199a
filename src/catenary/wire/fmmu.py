"""FMMU blocks, registers 0x0600 + 16·k, ETG.1000.4 §6.6.

An FMMU maps bits of the logical address space to bits of the device's memory.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from catenary.errors import DecodeError

SIZE = 16
_BLOCK = struct.Struct("<IHBBHBBB3x")


@dataclass(frozen=True, slots=True)
class Fmmu:
    """One FMMU.

    It maps all bits from `logical_start_bit` of the first byte to `logical_end_bit` of the last
    byte. `length` is the number of logical bytes, including partial ones.
    """

    logical_address: int
    length: int
    logical_start_bit: int
    logical_end_bit: int
    physical_address: int
    physical_start_bit: int
    reads: bool = False  # data goes from the device into the frame
    writes: bool = False  # data goes from the frame into the device
    enabled: bool = True

    @property
    def bit_length(self) -> int:
        """Number of mapped bits."""
        return 8 * (self.length - 1) + self.logical_end_bit - self.logical_start_bit + 1

    def encode(self) -> bytes:
        """Return the encoded block. Raises ValueError if a field does not fit."""
        bits = (self.logical_start_bit, self.logical_end_bit, self.physical_start_bit)
        if not all(0 <= bit <= 7 for bit in bits):
            raise ValueError(f"FMMU: bit numbers must be 0 to 7, got {bits}")
        try:
            return _BLOCK.pack(
                *(self.logical_address, self.length, self.logical_start_bit),
                *(self.logical_end_bit, self.physical_address, self.physical_start_bit),
                self.reads | self.writes << 1,
                self.enabled,
            )
        except struct.error as error:
            raise ValueError(f"FMMU: {error}") from None


def decode_fmmu(data: bytes) -> Fmmu:
    """Decode an FMMU block of 16 bytes. Reserved bits are ignored."""
    if len(data) != SIZE:
        raise DecodeError(f"FMMU: needs {SIZE} bytes, received {len(data)}")
    logical, length, first, last, physical, start, kind, enabled = _BLOCK.unpack(data)
    return Fmmu(
        *(logical, length, first & 7, last & 7, physical, start & 7),
        reads=bool(kind & 1),
        writes=bool(kind & 2),
        enabled=bool(enabled & 1),
    )


def bits(
    logical_bit: int,
    physical_bit: int,
    bit_length: int,
    *,
    reads: bool = False,
    writes: bool = False,
) -> Fmmu:
    """Return the FMMU that maps consecutive bits.

    Args:
        logical_bit: First logical bit, counted from address 0.
        physical_bit: First bit in the device's memory, counted from address 0.
        bit_length: Number of bits, at least 1.
        reads: True for inputs (from the device into the frame).
        writes: True for outputs (from the frame into the device).

    Raises:
        ValueError: `bit_length` is less than 1.
    """
    if bit_length < 1:
        raise ValueError(f"FMMU: bit_length must be at least 1, got {bit_length}")
    last = logical_bit + bit_length - 1
    return Fmmu(
        logical_address=logical_bit // 8,
        length=last // 8 - logical_bit // 8 + 1,
        logical_start_bit=logical_bit % 8,
        logical_end_bit=last % 8,
        physical_address=physical_bit // 8,
        physical_start_bit=physical_bit % 8,
        reads=reads,
        writes=writes,
    )
