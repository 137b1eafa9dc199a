"""Identity and firmware version of a device: objects 0x1018 and 0x100A."""

from __future__ import annotations

from contextlib import suppress
from typing import NamedTuple

from catenary.bus.sub_device import SubDevice
from catenary.errors import CatenaryError
from catenary.model.device import Identity
from catenary.model.text import printable

IDENTITY, VERSION = 0x1018, 0x100A  # objects


class Reported(NamedTuple):
    """Identity and firmware version that a device reports."""

    identity: Identity  # 0x1018; that of the SII if the object cannot be read
    version: str | None  # 0x100A; None if it cannot be read

    def __str__(self) -> str:
        version = "unknown" if self.version is None else self.version
        return f"version {version}, revision 0x{self.identity.revision:08X}"


def read_reported(sub: SubDevice) -> Reported:
    """Read identity and version of a device.

    An identity that cannot be read is that of the SII.

    Args:
        sub: The device.
    """
    identity, version = sub.identity, None
    with suppress(CatenaryError):
        numbers = [int.from_bytes(sub.sdo.read(IDENTITY, k)[:4], "little") for k in range(1, 5)]
        identity = Identity(*numbers)
    with suppress(CatenaryError):
        text = sub.sdo.read(VERSION).split(b"\0", 1)[0].decode("latin-1")
        version = printable(text).strip()
    return Reported(identity, version)


def same_device(before: Identity, now: Identity) -> bool:
    """Compare two identities, of which one may be that of the SII without a serial number.

    Args:
        before: The first identity.
        now: The second identity.
    """
    serials = {before.serial, now.serial} - {0}
    return (before.vendor, before.product) == (now.vendor, now.product) and len(serials) < 2
