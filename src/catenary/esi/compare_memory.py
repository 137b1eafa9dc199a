"""Comparison of mailbox areas, SyncManagers and FMMUs of an SII with an ESI."""

from __future__ import annotations

from collections.abc import Iterator

from catenary.esi.compare_configuration import area_text
from catenary.esi.device import EsiDevice, EsiSyncManager
from catenary.esi.difference import Difference, Severity, Sides, Subject
from catenary.esi.sii import FMMU_USES
from catenary.model.coe_facts import CoeFacts
from catenary.wire.sii import MailboxArea, Sii
from catenary.wire.sii_categories import FmmuUse, SyncManagerEntry, SyncManagerUse

MAILBOXES = (SyncManagerUse.MAILBOX_OUT, SyncManagerUse.MAILBOX_IN)
TRANSFER_BITS = 0x0F  # of the control byte: buffering and direction
WATCHDOG_BIT = 0x40
START = "a device refuses SyncManagers at another address (AL status codes 0x0016, 0x001D, 0x001E)"
START_ADVICE = "compare both with the manual; a master must use the values of the firmware"


def compare_memory(esi: EsiDevice, sii: Sii, coe: CoeFacts | None) -> Iterator[Difference]:
    """Yield the differences of mailbox areas, SyncManagers and FMMUs.

    Args:
        esi: The ESI.
        sii: The SII of the device.
        coe: What its object dictionary gives. It was read through the mailbox of the SII.
    """
    yield from _sync_managers(esi, sii, coe)
    yield from _fmmus(esi, sii)


def _sync_managers(esi: EsiDevice, sii: Sii, coe: CoeFacts | None) -> Iterator[Difference]:
    found = sii.sync_managers
    if esi.sync_managers and not found:
        yield Difference(
            Severity.WARNING,
            Subject.SYNC_MANAGER,
            "SyncManagers",
            Sides(str(len(esi.sync_managers)), "none"),
            esi.sync_managers[0].source,
            "a master that uses only the SII cannot configure the process data",
            "use the ESI",
        )
        found = ()
    for manager in esi.sync_managers:
        own = found[manager.index] if manager.index < len(found) else None
        if manager.use in MAILBOXES:
            yield from _mailbox(manager, own, sii, coe)
        if own is not None:
            yield from _sync_manager(manager, own)
        elif found:
            yield _absent(manager)
    yield from _undescribed(esi, found)


def _absent(manager: EsiSyncManager) -> Difference:
    return Difference(
        Severity.WARNING,
        Subject.SYNC_MANAGER,
        f"SyncManager {manager.index}",
        Sides(_use(manager.use), "missing"),
        manager.source,
        "a master that uses only the SII leaves it unconfigured",
        "use the ESI",
    )


def _undescribed(esi: EsiDevice, found: tuple[SyncManagerEntry, ...]) -> Iterator[Difference]:
    known = {manager.index for manager in esi.sync_managers}
    for index, own in enumerate(found):
        if index not in known and own.address:
            yield Difference(
                Severity.WARNING,
                Subject.SYNC_MANAGER,
                f"SyncManager {index}",
                Sides("missing", _use(own.use)),
                esi.source,
                "a master that uses the ESI leaves it unconfigured",
                "check whether the ESI belongs to this revision",
            )


def _use(use: int) -> str:
    try:
        return SyncManagerUse(use).name.lower().replace("_", " ")
    except ValueError:
        return f"use {use}"


def _mailbox(
    manager: EsiSyncManager, own: SyncManagerEntry | None, sii: Sii, coe: CoeFacts | None
) -> Iterator[Difference]:
    """Yield the differences of one mailbox area. The area in the header of the SII counts."""
    out = manager.use is SyncManagerUse.MAILBOX_OUT
    area = sii.header.standard_receive if out else sii.header.standard_send
    name = "receive" if out else "send"
    if own is not None and area.size and (own.address, own.length) != (area.offset, area.size):
        yield Difference(
            Severity.INFO,
            Subject.MAILBOX,
            f"{name} mailbox, SyncManager {manager.index} and header of the SII",
            Sides(
                area_text(manager.start, manager.default_size), area_text(own.address, own.length)
            ),
            manager.source,
            f"the header of the SII has {area_text(area.offset, area.size)}",
        )
    if not area.size or not manager.default_size:
        if area.size or manager.default_size:
            yield _only_one(manager, area, name)
        return
    works = coe is not None  # the device answered through the mailbox of its SII
    if manager.start != area.offset:
        sii_text = f"0x{area.offset:04X}"
        yield Difference(
            Severity.ERROR,
            Subject.MAILBOX,
            f"{name} mailbox, start",
            Sides(f"0x{manager.start:04X}", sii_text, sii_text if works else None),
            manager.source,
            START,
            START_ADVICE,
        )
    if manager.default_size != area.size:
        yield _mailbox_size(manager, area, name, works)


def _only_one(manager: EsiSyncManager, area: MailboxArea, name: str) -> Difference:
    return Difference(
        Severity.WARNING,
        Subject.MAILBOX,
        f"{name} mailbox",
        Sides(area_text(manager.start, manager.default_size), area_text(area.offset, area.size)),
        manager.source,
        "without a mailbox in the SII, Catenary does not use the mailbox of the device",
        "check whether the ESI belongs to this device",
    )


def _mailbox_size(manager: EsiSyncManager, area: MailboxArea, name: str, works: bool) -> Difference:
    limits = manager.min_size, manager.max_size
    low, high = limits[0] or 0, limits[1] or 0
    allowed = any(limits) and low <= area.size <= (high or area.size)
    sii_text = f"{area.size} bytes"
    if allowed:
        reason = f"the ESI allows {low} to {high or 'any number of'} bytes"
    else:
        reason = "some devices refuse other sizes (AL status code 0x0016)"
    return Difference(
        Severity.INFO if allowed else Severity.WARNING,
        Subject.MAILBOX,
        f"{name} mailbox, size",
        Sides(f"{manager.default_size} bytes", sii_text, sii_text if works else None),
        manager.source,
        reason,
        "" if allowed else "compare both with the manual of the device",
    )


def _sync_manager(manager: EsiSyncManager, own: SyncManagerEntry) -> Iterator[Difference]:
    """Yield the differences of one SyncManager, except the area of a mailbox."""
    name = f"SyncManager {manager.index}"
    if own.use and manager.use is not SyncManagerUse.UNUSED and own.use != manager.use:
        yield Difference(
            Severity.ERROR,
            Subject.SYNC_MANAGER,
            f"{name}, use",
            Sides(_use(manager.use), _use(own.use)),
            manager.source,
            "the master transfers other data than the device expects",
            "check whether the ESI belongs to this device",
        )
        return
    data = manager.use not in MAILBOXES
    if data and manager.start and own.address and manager.start != own.address:
        yield Difference(
            Severity.ERROR,
            Subject.SYNC_MANAGER,
            f"{name}, start",
            Sides(f"0x{manager.start:04X}", f"0x{own.address:04X}"),
            manager.source,
            START,
            START_ADVICE,
        )
    if data and manager.default_size and own.length and manager.default_size != own.length:
        yield Difference(
            Severity.INFO,
            Subject.SYNC_MANAGER,
            f"{name}, default size",
            Sides(f"{manager.default_size} bytes", f"{own.length} bytes"),
            manager.source,
            "the master calculates the size from the PDOs",
        )
    if manager.control != own.control:
        yield _control(manager, own, name)


def _control(manager: EsiSyncManager, own: SyncManagerEntry, name: str) -> Difference:
    changed = manager.control ^ own.control
    if changed & TRANSFER_BITS:
        severity, reason = (
            Severity.ERROR,
            "buffering or direction differs, which the device refuses",
        )
    elif changed & WATCHDOG_BIT:
        severity, reason = Severity.WARNING, "one of them disables the process-data watchdog"
    else:
        severity, reason = Severity.INFO, "only interrupts of the device's processor differ"
    return Difference(
        severity,
        Subject.SYNC_MANAGER,
        f"{name}, control",
        Sides(f"0x{manager.control:02X}", f"0x{own.control:02X}"),
        manager.source,
        reason,
        "" if severity is Severity.INFO else "compare both with the manual of the device",
    )


def _fmmus(esi: EsiDevice, sii: Sii) -> Iterator[Difference]:
    """Yield the difference of the FMMUs. Unused ones do not count."""
    unused = (FmmuUse.UNUSED, FmmuUse.NONE)
    given = [FMMU_USES.get(text.lower()) for text in esi.fmmus]
    if None in given or not given:
        return  # the file has none, or uses that an SII has no number for
    expected = [int(use) for use in given if use is not None and use not in unused]
    found = [use for use in sii.fmmus if use not in unused]
    if expected == found:
        return
    yield Difference(
        Severity.WARNING if found else Severity.INFO,
        Subject.FMMU,
        "FMMUs",
        Sides(_fmmu_text(expected), _fmmu_text(found)),
        esi.source,
        "masters assign FMMUs themselves; only a device with a fixed order depends on this",
    )


def _fmmu_text(uses: list[int]) -> str:
    known = set(FmmuUse)
    names = [
        FmmuUse(use).name.lower().replace("_", " ") if use in known else f"use {use}"
        for use in uses
    ]
    return ", ".join(names) or "none"
