"""Choice of one device in an ESI file, by name, product or product and revision."""

from __future__ import annotations

from collections.abc import Sequence

from catenary.errors import ConfigurationError
from catenary.esi.device import EsiDevice, EsiFile

SHOWN_MAX = 10  # devices that an error lists


def select_device(file: EsiFile, wanted: str = "") -> EsiDevice:
    """Return the device that a text names.

    Args:
        file: Contents of the file.
        wanted: Order code or name, also a part of it if it is unique, or PRODUCT[:REVISION] as
            numbers; empty for the only device of the file. Without a revision, the newest one is
            returned.

    Raises:
        ConfigurationError: No device fits, or several different ones.
    """
    found = _found(file.devices, wanted.strip())
    kinds = {(device.key.vendor, device.key.product) for device in found}
    if len(kinds) == 1:
        return max(found, key=lambda device: device.key.revision)
    several = "several devices" if found else "no device"
    asked = f" for {wanted!r}" if wanted else ""
    raise ConfigurationError(
        f"{file.path}: {several}{asked}; {_listed(found or file.devices)}",
        hint="name the device by its order code, or by PRODUCT:REVISION",
    )


def _found(devices: Sequence[EsiDevice], wanted: str) -> Sequence[EsiDevice]:
    if not wanted:
        return devices
    by_name = [each for each in devices if wanted.lower() in (each.type.lower(), each.name.lower())]
    by_part = [each for each in devices if wanted.lower() in f"{each.type}\n{each.name}".lower()]
    return by_name or _by_number(devices, wanted) or by_part


def _by_number(devices: Sequence[EsiDevice], wanted: str) -> Sequence[EsiDevice]:
    try:
        product, *revision = (int(part, 0) for part in wanted.split(":"))
    except ValueError:
        return ()
    numbers = [product, *revision]
    return [
        each
        for each in devices
        if len(numbers) <= 2 and [each.key.product, each.key.revision][: len(numbers)] == numbers
    ]


def _listed(devices: Sequence[EsiDevice]) -> str:
    shown = [
        f"{each.type} (0x{each.key.product:08X}:0x{each.key.revision:08X})"
        for each in devices[:SHOWN_MAX]
    ]
    more = f" and {len(devices) - SHOWN_MAX} more" if len(devices) > SHOWN_MAX else ""
    return f"the file has {', '.join(shown)}{more}" if shown else "the file has no device"
