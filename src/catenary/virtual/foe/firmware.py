"""Firmware of a virtual device: images, and the flash memory that stores one of them."""

from __future__ import annotations

import struct
import zlib
from typing import NamedTuple

MAGIC = b"CATENARY FIRMWARE\n"
_HEADER = struct.Struct("<18sIII16s")  # magic, product, revision, CRC-32 of the contents, version
VERSION_BYTES = 16

# Error codes of FoE
CHECKSUM, WRONG_FIRMWARE, NO_FILE_HEADER = 0x800C, 0x800D, 0x8010


def make_firmware(product: int, version: str, *, revision: int = 0, size: int = 4096) -> bytes:
    """Return a firmware image for a virtual device.

    Args:
        product: Product code of the device.
        version: Version that the device then reports in 0x100A, at most 16 characters.
        revision: Revision that the device then reports in 0x1018; 0: the present one.
        size: Size of the image [bytes], at least 46.

    Raises:
        ValueError: The version or the size is out of range.
    """
    encoded = version.encode("ascii", "replace")
    if not 1 <= len(encoded) <= VERSION_BYTES:
        raise ValueError(f"version must have 1 to {VERSION_BYTES} characters, not {version!r}")
    if size < _HEADER.size:
        raise ValueError(f"size must be at least {_HEADER.size} bytes, not {size}")
    contents = bytes(k * 31 + k // 256 & 0xFF for k in range(size - _HEADER.size))
    return _HEADER.pack(MAGIC, product, revision, zlib.crc32(contents), encoded) + contents


class Image(NamedTuple):
    """Firmware image in the memory of a device."""

    version: str
    revision: int  # 0: that of the device


class Flash:
    """Memory for one firmware image. It keeps its content without power."""

    def __init__(self, product: int, version: str) -> None:
        self._product = product
        self.image: Image | None = Image(version, 0)  # None: erased, only the boot loader runs
        self.file = b""  # last valid file
        self.running: Image | None = self.image  # image that the device runs; None: the boot loader

    def erase(self) -> None:
        """Erase the memory, before a new image is written."""
        self.image = None

    def program(self, data: bytes) -> int:
        """Store an image. Return 0, or the error code of FoE if the image is not valid."""
        if len(data) < _HEADER.size or not data.startswith(MAGIC):
            return NO_FILE_HEADER
        _magic, product, revision, checksum, version = _HEADER.unpack_from(data)
        if zlib.crc32(data[_HEADER.size :]) != checksum:
            return CHECKSUM
        if product != self._product:
            return WRONG_FIRMWARE
        self.file = data
        self.image = Image(version.rstrip(b"\0").decode("ascii", "replace"), revision)
        return 0

    def restart(self) -> None:
        """Start the stored image, or the boot loader."""
        self.running = self.image
