"""Search for PDOs of a device that together carry wanted objects. Their entries stay as they are.

Two PDOs cannot be assigned together if one excludes the other (`Exclude` of an ESI), or if both
carry the same object. The second rule is ours: an SII has no exclusions, and alternatives on real
devices carry the same objects. Beckhoff's EL30xx has a standard and a compact PDO per channel
(0x1A00 and 0x1A01); Kollmorgen's AKD has fixed PDOs 0x1701 to 0x1725, each with the controlword.
PDOs that the device has assigned together now stay together: the EL3632 maps one object twice.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator, Sequence
from itertools import count
from typing import TYPE_CHECKING, NamedTuple

from catenary.model.device import Pdo

if TYPE_CHECKING:  # request.py needs NumPy, a scan does not
    from catenary.plan.request import ObjectReference

STEPS_MAX = 2000  # combinations that are tried: real devices need a few


class Combination(NamedTuple):
    """PDOs for one SyncManager, in their order, and the difference from now."""

    pdos: tuple[Pdo, ...]
    added: tuple[Pdo, ...] = ()
    removed: tuple[Pdo, ...] = ()


class _Offer(NamedTuple):
    """A PDO, with its objects as sets: the search compares them often."""

    pdo: Pdo
    entries: frozenset[tuple[int, int, int]]  # index, subindex, length
    objects: frozenset[tuple[int, int]]


class _State(NamedTuple):
    chosen: frozenset[int]  # indices of PDOs
    added: frozenset[int]


def find_combination(
    assigned: Sequence[Pdo], offered: Sequence[Pdo], wanted: Sequence[ObjectReference]
) -> Combination | None:
    """Return the combination that carries all wanted objects and changes least; None: no
    combination does.

    Fewest PDOs removed, then fewest added, then the device's order. Mandatory PDOs stay.

    Args:
        assigned: PDOs of the SyncManager now.
        offered: All PDOs that may be assigned to it, those of now included.
        wanted: Objects with their lengths.
    """
    known = {pdo.index: _offer(pdo) for pdo in (*offered, *assigned)}
    places = [each.place for each in wanted]
    start = frozenset(pdo.index for pdo in assigned)
    order = count()
    queue = [(0, 0, next(order), _State(start, frozenset()))]
    seen: set[_State] = set()
    while queue and len(seen) < STEPS_MAX:
        state = heapq.heappop(queue)[-1]
        if state in seen:
            continue
        seen.add(state)
        carried = frozenset().union(*(known[index].entries for index in state.chosen))
        missing = next((place for place in places if place not in carried), None)
        if missing is None:
            return _combination(assigned, known, state)
        for after in _steps(state, known, missing):
            removed = len(start - after.chosen)
            heapq.heappush(queue, (removed, len(after.added), next(order), after))
    return None


def explain_failure(
    assigned: Sequence[Pdo], offered: Sequence[Pdo], wanted: Sequence[ObjectReference]
) -> str:
    """Return why no combination carries the wanted objects."""
    nowhere = [each for each in wanted if not any_carries((*offered, *assigned), each)]
    if nowhere:
        return f"none of its PDOs carries {object_names(nowhere)}"
    missing = [each for each in wanted if not any_carries(assigned, each)]
    carriers = [pdo for pdo in offered if any(carries(pdo, each) for each in missing)]
    return (
        f"{object_names(missing)} {'is' if len(missing) == 1 else 'are'} in {pdo_names(carriers)}, "
        "which cannot be assigned together with other PDOs that are mandatory or carry the rest"
    )


def carries(pdo: Pdo, reference: ObjectReference) -> bool:
    """Return True if the PDO has the object in the wanted length."""
    return any(entry.place == reference.place for entry in pdo.entries)


def any_carries(pdos: Sequence[Pdo], reference: ObjectReference) -> bool:
    """Return True if one of the PDOs has the object in the wanted length."""
    return any(carries(pdo, reference) for pdo in pdos)


def conflict(one: Pdo, other: Pdo) -> bool:
    """Return True if the two PDOs cannot be assigned together."""
    return _conflict(_offer(one), _offer(other))


def object_names(references: Sequence[ObjectReference]) -> str:
    """Return `0x6064:00 (32 bits), ...`."""
    return ", ".join(f"0x{r.index:04X}:{r.subindex:02X} ({r.bit_length} bits)" for r in references)


def pdo_names(pdos: Iterable[Pdo], *, empty: str = "no PDO") -> str:
    """Return `0x1A00, 0x1A01`, or `empty`."""
    return ", ".join(f"0x{pdo.index:04X}" for pdo in pdos) or empty


def place_names(places: Iterable[tuple[int, int, int]], *, empty: str) -> str:
    """Return `0x6064:00/32, ...`, or `empty`. For entries without their names (`Entry.place`)."""
    return ", ".join(f"0x{index:04X}:{sub:02X}/{bits}" for index, sub, bits in places) or empty


def _steps(
    state: _State, known: dict[int, _Offer], missing: tuple[int, int, int]
) -> Iterator[_State]:
    """Add each PDO that carries the missing object. PDOs in conflict with it leave."""
    for index, offer in known.items():
        if index in state.chosen or missing not in offer.entries:
            continue
        leaving = {other for other in state.chosen if _conflict(offer, known[other])}
        if leaving & state.added or any(known[other].pdo.mandatory for other in leaving):
            continue
        yield _State(state.chosen - leaving | {index}, state.added | {index})


def _combination(assigned: Sequence[Pdo], known: dict[int, _Offer], state: _State) -> Combination:
    now = [pdo.index for pdo in assigned]
    added = tuple(known[index].pdo for index in known if index in state.added)
    pdos = [pdo for pdo in assigned if pdo.index in state.chosen] + list(added)
    if now == sorted(now):  # Beckhoff's EL6731 wants PDOs in the order of their indices
        pdos.sort(key=lambda pdo: pdo.index)
    removed = tuple(pdo for pdo in assigned if pdo.index not in state.chosen)
    return Combination(tuple(pdos), added, removed)


def _offer(pdo: Pdo) -> _Offer:
    entries = frozenset(entry.place for entry in pdo.entries if entry.index)
    return _Offer(pdo, entries, frozenset(entry[:2] for entry in entries))


def _conflict(one: _Offer, other: _Offer) -> bool:
    if other.pdo.index in one.pdo.excludes or one.pdo.index in other.pdo.excludes:
        return True
    return not one.objects.isdisjoint(other.objects)
