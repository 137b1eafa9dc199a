"""Twins from files: from an SII, and from the ESI of a vendor."""

from __future__ import annotations

from os import PathLike

from catenary.virtual.devices.described import DescribedDevice, esi_device
from catenary.virtual.devices.twin import NO_OPTIONS, Twin, TwinOptions
from catenary.virtual.sii_blueprint import sii_blueprint


def twin_from_sii(
    source: bytes | str | PathLike[str],
    *,
    name: str,
    alias: int | None,
    serial: int | None,
    clock: bool | None,
    options: TwinOptions | None,
) -> Twin:
    """Return a device from an SII. `Device.from_sii` documents the arguments."""
    blueprint = sii_blueprint(source, alias=alias, serial=serial, clock=clock)
    return Twin(blueprint, name=name, options=options or NO_OPTIONS)


def twin_from_esi(
    path: str | PathLike[str],
    device: str,
    *,
    product: int | None,
    revision: int | None,
    name: str,
    alias: int,
    serial: int,
    options: TwinOptions | None,
) -> DescribedDevice:
    """Return a device from an ESI. `Device.from_esi` documents the arguments."""
    if product is None and revision is not None:
        raise ValueError(f"revision={revision:#x} needs product=, the product code")
    if product is not None:
        device = f"0x{product:08X}" + ("" if revision is None else f":0x{revision:08X}")
    return DescribedDevice(
        esi_device(path, device),
        name=name,
        alias=alias,
        serial=serial,
        options=options or NO_OPTIONS,
    )
