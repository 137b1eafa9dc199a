"""Comparison of a device with its ESI: registers, SII, and object dictionary if it was read.

Unequal values are warnings, because vendors' files and devices often differ. An error is only what
keeps the device from OP, or changes the meaning of its process data.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from catenary.esi.compare_capabilities import compare_capabilities
from catenary.esi.compare_clocks import compare_clocks
from catenary.esi.compare_configuration import compare_configuration
from catenary.esi.compare_memory import compare_memory
from catenary.esi.compare_objects import compare_objects
from catenary.esi.compare_pdos import compare_pdos
from catenary.esi.default_modules import with_default_modules
from catenary.esi.device import EsiDevice, RevisionCheck
from catenary.esi.difference import Difference, Severity, Sides, Subject
from catenary.esi.lookup import accepts
from catenary.model.coe_facts import CoeFacts
from catenary.model.device import DeviceDescription, Identity
from catenary.wire.sii import Sii

ANOTHER_DEVICE = "the file describes another device, so nothing else was compared"
RANK = {Severity.ERROR: 0, Severity.WARNING: 1, Severity.INFO: 2}


def compare(
    description: DeviceDescription,
    esi: EsiDevice,
    sii: Sii | None = None,
    coe: CoeFacts | None = None,
) -> tuple[Difference, ...]:
    """Compare a device with its ESI. The default modules of a modular device are assumed.

    If vendor or product differ, this is the only difference.

    Args:
        description: The device, from a scan.
        esi: Its ESI.
        sii: Its SII; None if it cannot be decoded.
        coe: What its object dictionary gives; None if it was not read.

    Returns:
        Errors first, then warnings and infos.
    """
    other = _other_device(description.identity, esi)
    if other is not None:
        return (other,)
    whole = with_default_modules(esi)
    found = [*_revision(description.identity, esi)]
    if coe is not None:
        found += _coe_identity(description.identity, esi, coe)
    if sii is not None:
        found += compare_configuration(esi, sii)
        found += compare_memory(esi, sii, coe)
        found += compare_clocks(description, esi, sii)
    found += compare_capabilities(esi, sii, coe)
    found += compare_pdos(replace(whole, slots=esi.slots), sii, coe)
    if coe is not None:
        found += compare_objects(whole, coe)
    return tuple(sorted(found, key=lambda each: RANK[each.severity]))


def another_device(found: Identity, esi: EsiDevice) -> bool:
    """Return True if a device has another vendor or product than its ESI.

    Args:
        found: Identity of the device.
        esi: The ESI.
    """
    return (found.vendor, found.product) != (esi.key.vendor, esi.key.product)


def _other_device(found: Identity, esi: EsiDevice) -> Difference | None:
    if not another_device(found, esi):
        return None
    blank = not (found.vendor and found.product)
    return Difference(
        Severity.ERROR,
        Subject.IDENTITY,
        "vendor and product",
        Sides(_key(esi.key.vendor, esi.key.product), _key(found.vendor, found.product)),
        esi.source,
        ANOTHER_DEVICE,
        "write the vendor's image into its EEPROM (`catenary sii build`, `catenary sii write`)"
        if blank
        else "check the position, and use the vendor's ESI for this device",
    )


def _key(vendor: int, product: int) -> str:
    return f"0x{vendor:08X}:0x{product:08X}"


def _revision(found: Identity, esi: EsiDevice) -> Iterator[Difference]:
    """Yield the verdict on the revision: if it is not equal, `CheckRevisionNo` decides.

    Without a rule, a newer device may replace an older one, as Beckhoff states (see `esi.lookup`).
    KickCAT accepts only an equal revision (leducp/KickCAT#430).
    """
    device, file = found.revision, esi.key.revision
    rule = esi.revision_check
    accepted = accepts(rule, device, file)
    if device == file:
        return
    if rule is not RevisionCheck.NONE and not accepted:
        severity = Severity.ERROR
        reason = f"CheckRevisionNo of the ESI is {rule.value}, which excludes this revision"
    elif accepted:
        severity = Severity.INFO
        reason = (
            f"CheckRevisionNo of the ESI is {rule.value}, which accepts this revision"
            if rule is not RevisionCheck.NONE
            else "a newer device usually supports the description of an older one"
        )
    else:
        severity = Severity.WARNING
        reason = "the ESI describes a newer device; this one may lack some of its features"
    yield Difference(
        severity,
        Subject.IDENTITY,
        "revision",
        Sides(f"0x{file:08X}", f"0x{device:08X}"),
        esi.source,
        reason,
        "" if severity is Severity.INFO else "use the vendor's ESI for this revision",
    )


def _coe_identity(found: Identity, esi: EsiDevice, coe: CoeFacts) -> Iterator[Difference]:
    """Yield differences between the SII and object 0x1018. Masters may check either of them."""
    if coe.identity is None:
        return
    for subindex, name in enumerate(("vendor", "product", "revision"), start=1):
        sii, own = getattr(found, name), getattr(coe.identity, name)
        if own == sii:
            continue
        yield Difference(
            Severity.WARNING,
            Subject.IDENTITY,
            f"0x1018:{subindex:02X} ({name})",
            Sides(f"0x{getattr(esi.key, name):08X}", f"0x{sii:08X}", f"0x{own:08X}"),
            esi.source,
            "a master that checks 0x1018 refuses the device",
            "write the SII that belongs to its firmware",
        )
