"""Matching of found devices to known ones after power cycles, moves or replacements."""

from __future__ import annotations

from collections.abc import Sequence


def vacancies(found: Sequence[int], known: Sequence[int]) -> dict[int, tuple[int, ...]]:
    """Return the free positions to which each unmatched device may belong.

    A device matches if its address is known and the matches are in the order of the wiring. The
    largest possible number of devices is matched, so that a moved device does not count as a
    neighbour.

    Args:
        found: Station addresses in the order in which a frame passes the devices. A device has 0
            after a power-up.
        known: Station addresses of the known devices, by position.

    Returns:
        A map from the rank of each unmatched device in `found` to the free positions in `known`,
        which are those between its matched neighbours.
    """
    place = {address: position for position, address in enumerate(known)}
    matched = _longest_increasing([place.get(address, -1) for address in found])
    free: dict[int, tuple[int, ...]] = {}
    for rank in range(len(found)):
        if rank in matched:
            continue
        before = max((matched[other] for other in matched if other < rank), default=-1)
        after = min((matched[other] for other in matched if other > rank), default=len(known))
        free[rank] = tuple(range(before + 1, after))
    return free


def _longest_increasing(places: Sequence[int]) -> dict[int, int]:
    """Return the longest strictly increasing sequence of non-negative places, as {rank: place}.

    If there are several, the result is the first one found.
    """
    length: dict[int, int] = {}  # of the longest sequence that ends at this rank
    before: dict[int, int] = {}  # the previous rank in that sequence
    for rank, place in enumerate(places):
        if place < 0:
            continue
        lower = [other for other in length if places[other] < place]
        best = max(lower, key=lambda other: length[other], default=None)
        length[rank] = 1 if best is None else length[best] + 1
        if best is not None:
            before[rank] = best
    chain: dict[int, int] = {}
    last = max(length, key=lambda other: length[other], default=None)
    while last is not None:
        chain[last] = places[last]
        last = before.get(last)
    return chain
