"""Search for a combination of unchanged PDOs of a device that carries the requested objects.

Two PDOs cannot be assigned together if one excludes the other (`Exclude` of an ESI), or if both
carry the same object. The second rule is not in the standard. It is needed because
an SII does not list exclusions, and alternative PDOs on real devices carry the same objects.
Beckhoff's EL30xx has a standard and a compact PDO per channel (0x1A00 and 0x1A01). Kollmorgen's AKD
has fixed PDOs 0x1701 to 0x1725, each with the controlword.
PDOs that are assigned together now may stay together, because the EL3632 maps one object twice.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator, Sequence
from itertools import count
from typing import TYPE_CHECKING, NamedTuple

from catenary.model.device import Pdo

if TYPE_CHECKING:  # request.py imports NumPy, which a scan does not need
    from catenary.plan.request import ObjectReference

STEPS_MAX = 2000  # largest number of combinations to try; real devices need a few


class Combination(NamedTuple):
    """PDOs for one SyncManager, in order, and the difference from the present assignment."""

    pdos: tuple[Pdo, ...]
    added: tuple[Pdo, ...] = ()
    removed: tuple[Pdo, ...] = ()


class _Offer(NamedTuple):
    """A PDO, with its objects as sets, because the search compares them often."""

    pdo: Pdo
    entries: frozenset[tuple[int, int, int]]  # index, subindex, length
    objects: frozenset[tuple[int, int]]


class _State(NamedTuple):
    """One combination during the search."""

    chosen: frozenset[int]  # indices of PDOs
    added: frozenset[int]


def find_combination(
    assigned: Sequence[Pdo], offered: Sequence[Pdo], requested: Sequence[ObjectReference]
) -> Combination | None:
    """Return the combination that carries all objects and changes least; None if none was found.

    It prefers the fewest removed PDOs, then the fewest added ones, then the order of the device.
    Mandatory PDOs stay.

    Args:
        assigned: PDOs that are assigned to the SyncManager now.
        offered: All PDOs that may be assigned to it, including the assigned ones.
        requested: Objects with their lengths.
    """
    known = {pdo.index: _offer(pdo) for pdo in (*offered, *assigned)}
    places = [each.place for each in requested]
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
    assigned: Sequence[Pdo], offered: Sequence[Pdo], requested: Sequence[ObjectReference]
) -> str:
    """Return the reason why no combination carries the objects."""
    nowhere = [each for each in requested if not any_carries((*offered, *assigned), each)]
    if nowhere:
        return f"none of its PDOs carries {object_names(nowhere)}"
    missing = [each for each in requested if not any_carries(assigned, each)]
    carriers = [pdo for pdo in offered if any(carries(pdo, each) for each in missing)]
    return (
        f"{object_names(missing)} {'is' if len(missing) == 1 else 'are'} in {pdo_names(carriers)}, "
        "which cannot be assigned together with other PDOs that are mandatory or carry the rest"
    )


def carries(pdo: Pdo, reference: ObjectReference) -> bool:
    """Return True if the PDO has the object with the requested length."""
    return any(entry.place == reference.place for entry in pdo.entries)


def any_carries(pdos: Sequence[Pdo], reference: ObjectReference) -> bool:
    """Return True if one of the PDOs has the object with the requested length."""
    return any(carries(pdo, reference) for pdo in pdos)


def conflict(one: Pdo, other: Pdo) -> bool:
    """Return True if the two PDOs cannot be assigned together."""
    return _conflict(_offer(one), _offer(other))


def object_names(references: Sequence[ObjectReference]) -> str:
    """Return objects as text: `0x6064:00 (32 bits), ...`."""
    return ", ".join(f"0x{r.index:04X}:{r.subindex:02X} ({r.bit_length} bits)" for r in references)


def pdo_names(pdos: Iterable[Pdo], *, empty: str = "no PDO") -> str:
    """Return PDOs as text: `0x1A00, 0x1A01`, or `empty`."""
    return ", ".join(f"0x{pdo.index:04X}" for pdo in pdos) or empty


def place_names(places: Iterable[tuple[int, int, int]], *, empty: str) -> str:
    """Return places (`Entry.place`) as text: `0x6064:00/32, ...`, or `empty`."""
    return ", ".join(f"0x{index:04X}:{sub:02X}/{bits}" for index, sub, bits in places) or empty


def _steps(
    state: _State, known: dict[int, _Offer], missing: tuple[int, int, int]
) -> Iterator[_State]:
    """Yield a state for each PDO with the missing object. This PDO replaces those in conflict."""
    for index, offer in known.items():
        if index in state.chosen or missing not in offer.entries:
            continue
        removed = {other for other in state.chosen if _conflict(offer, known[other])}
        if removed & state.added or any(known[other].pdo.mandatory for other in removed):
            continue
        yield _State(state.chosen - removed | {index}, state.added | {index})


def _combination(assigned: Sequence[Pdo], known: dict[int, _Offer], state: _State) -> Combination:
    now = [pdo.index for pdo in assigned]
    added = tuple(known[index].pdo for index in known if index in state.added)
    pdos = [pdo for pdo in assigned if pdo.index in state.chosen] + list(added)
    if now == sorted(now):  # Beckhoff's EL6731 requires PDOs in the order of their indices
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
