"""Comparison of the PDOs of a device with its ESI: existence, entries and assignment.

Entries are compared by their bit offset in the PDO, so that one gap equals several shorter ones.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from catenary.esi.device import EsiDevice, EsiPdo
from catenary.esi.difference import Difference, Severity, Sides, Subject
from catenary.esi.pdo_views import Layout, Views, layout, views_of
from catenary.model.coe_facts import CoeFacts
from catenary.model.device import Direction
from catenary.wire.sii import Sii

SHOWN = 8
MEANING = "the device and the ESI interpret the process data differently"


def compare_pdos(esi: EsiDevice, sii: Sii | None, coe: CoeFacts | None) -> Iterator[Difference]:
    """Yield the differences of the PDOs of both directions, and of their assignment.

    Args:
        esi: The ESI, with its default modules in place.
        sii: The SII of the device; None if it cannot be decoded.
        coe: What the object dictionary gives; None if it was not read.
    """
    for direction in Direction:
        views = views_of(esi, sii, coe, direction)
        if views.sii is None and sii is not None and views.esi and views.coe is None:
            yield _no_pdos(views, direction, esi)
            continue
        if views.sii is None and views.coe is None:
            continue  # nothing to compare with
        for pdo in views.esi.values():
            yield from _pdo(pdo, views)
        yield from _undescribed(views, direction, esi)
        yield from _assignments(views, esi, direction)


def _kind(direction: Direction) -> str:
    return "RxPDO" if direction is Direction.OUTPUT else "TxPDO"


def _no_pdos(views: Views, direction: Direction, esi: EsiDevice) -> Difference:
    """Return the difference of an SII without PDOs of one direction. With CoE, this is common."""
    first = next(iter(views.esi.values()))
    return Difference(
        Severity.INFO if esi.mailbox is not None or views.modular else Severity.WARNING,
        Subject.PDO,
        f"{_kind(direction)}s",
        Sides(str(len(views.esi)), "none"),
        first.source,
        "many devices list their PDOs only in the object dictionary",
        "use the ESI, or bring the device to PRE-OP so that its objects can be read",
    )


def _pdo(pdo: EsiPdo, views: Views) -> Iterator[Difference]:
    expected = layout([(e.index, e.subindex, e.bit_length) for e in pdo.entries])
    sii, coe = views.sii_layout(pdo.index), views.coe_layout(pdo.index)
    name = f"{_kind(pdo.direction)} 0x{pdo.index:04X} ({pdo.name})"
    if coe is None and (views.coe is not None or sii is None):
        yield from _missing(pdo, views, name, sii)
        return
    if coe is not None and sii is None and views.sii is not None and not views.modular:
        yield Difference(
            Severity.INFO,
            Subject.PDO,
            name,
            Sides("present", "missing", "present"),
            pdo.source,
            "masters that use only the SII do not offer this PDO",
        )
    if pdo.virtual or all(own in (None, expected) for own in (sii, coe)):
        return
    yield Difference(
        _severity(pdo, views, expected, coe),
        Subject.PDO,
        f"{name}, {_place(expected, sii, coe)}",
        Sides(*(_text(own, expected, sii, coe) for own in (expected, sii, coe))),
        pdo.source,
        _reason(expected, coe),
        "use the ESI for this firmware, or read the mapping from the device",
    )


def _missing(pdo: EsiPdo, views: Views, name: str, sii: Layout | None) -> Iterator[Difference]:
    """Yield the difference of a PDO that the device does not have. A module may be absent."""
    needed = (pdo.sync_manager is not None or pdo.mandatory) and not views.modular
    if views.modular and sii is None and views.coe is None:
        return  # an SII does not list the PDOs of modules
    yield Difference(
        Severity.ERROR if needed else Severity.WARNING,
        Subject.PDO,
        name,
        Sides(
            "present",
            None if views.sii is None else "missing" if sii is None else "present",
            None if views.coe is None else "missing",
        ),
        pdo.source,
        "the default configuration of the ESI contains this PDO"
        if needed
        else "the device refuses its assignment",
        "check whether the ESI belongs to this revision, or which modules are in place",
    )


def _severity(pdo: EsiPdo, views: Views, expected: Layout, coe: Layout | None) -> Severity:
    """Return the severity of unequal entries.

    They are an error if the PDO is in use and the master cannot write the entries of the ESI. If
    the object dictionary agrees with the ESI, only the SII is out of date.
    """
    if coe == expected or not views.is_assigned(pdo.index) or views.modular:
        return Severity.WARNING
    writable = coe is not None and views.configurable and not pdo.fixed
    return Severity.WARNING if writable else Severity.ERROR


def _reason(expected: Layout, coe: Layout | None) -> str:
    if coe == expected:
        return "masters that use only the SII interpret the process data differently"
    return MEANING


def _place(expected: Layout, *others: Layout | None) -> str:
    """Return the place of the first difference, such as "entry 2" or "length"."""
    number = _first(expected, *others)
    return "length" if number is None else f"entry {number + 1}"


def _first(expected: Layout, *others: Layout | None) -> int | None:
    """Return the number of the first object that differs; None if only the length does."""
    found = [
        next(
            (
                n
                for n, pair in enumerate(zip(expected[0], own[0], strict=False))
                if len(set(pair)) > 1
            ),
            min(len(expected[0]), len(own[0])),
        )
        for own in others
        if own is not None and own[0] != expected[0]
    ]
    return min(found, default=None)


def _text(own: Layout | None, expected: Layout, *others: Layout | None) -> str | None:
    """Return the object of a source at the first difference; its length if the objects agree."""
    if own is None:
        return None
    number = _first(expected, *others)
    if number is None:
        return f"{own[1]} bits"
    return str(own[0][number]) if number < len(own[0]) else f"{len(own[0])} objects"


def _undescribed(views: Views, direction: Direction, esi: EsiDevice) -> Iterator[Difference]:
    """Yield PDOs of the device that the ESI does not describe."""
    known = {pdo.index for pdo in esi.pdos}
    present = dict.fromkeys((*(views.sii or ()), *sorted(views.assigned)))
    for index in (each for each in present if each not in known):
        fixed = not (views.assignable and views.coe is not None)
        error = views.is_assigned(index) and fixed and not views.modular
        yield Difference(
            Severity.ERROR if error else Severity.INFO if views.modular else Severity.WARNING,
            Subject.PDO,
            f"{_kind(direction)} 0x{index:04X}",
            Sides(
                "missing",
                None if views.sii is None else "present" if index in views.sii else "missing",
                None if views.coe is None else "present" if views.coe_layout(index) else "missing",
            ),
            esi.source,
            "the device transfers process data that the ESI does not describe"
            if views.is_assigned(index)
            else "the ESI does not offer this PDO",
            "check whether the ESI belongs to this revision, or which modules are in place",
        )


def _assignments(views: Views, esi: EsiDevice, direction: Direction) -> Iterator[Difference]:
    """Yield the SyncManagers whose lists of PDOs differ.

    PDOs that one side lacks are omitted, because they have their own difference.
    """
    for manager in esi.sync_managers:
        if manager.use is not direction.use:
            continue
        expected = [p.index for p in views.esi.values() if p.sync_manager == manager.index]
        sii = None
        if views.sii is not None:
            sii = [p.index for p in views.sii.values() if p.sync_manager == manager.index]
        read = views.coe.assignments.get(manager.index) if views.coe is not None else None
        coe = None if read is None else [i for i in read if i in views.esi]
        common = [i for i in expected if _known(views, i)]
        given = Sides(
            _list(common),
            None if sii is None or views.modular else _list([i for i in sii if i in views.esi]),
            None if coe is None else _list(coe),
        )
        if not given.differ:
            continue
        changeable = views.assignable and not manager.fixed_assignment and coe is not None
        harmless = changeable or views.modular or given.coe == given.esi
        yield Difference(
            Severity.WARNING if harmless else Severity.ERROR,
            Subject.PDO,
            f"SyncManager {manager.index}, assigned PDOs",
            given,
            manager.source,
            "its list of PDOs was changed, or its firmware has other defaults"
            if given.coe not in (None, given.esi)
            else "masters that use only the SII transfer other process data",
            f"a master can write 0x{0x1C10 + manager.index:04X}"
            if changeable
            else "use the assignment of the device",
        )


def _known(views: Views, index: int) -> bool:
    """Return True if the device has a PDO of the ESI."""
    if views.coe is not None:
        return views.coe_layout(index) is not None
    return views.sii is not None and index in views.sii


def _list(indices: Sequence[int]) -> str:
    more = " ..." if len(indices) > SHOWN else ""
    return ", ".join(f"0x{index:04X}" for index in indices[:SHOWN]) + more if indices else "none"
