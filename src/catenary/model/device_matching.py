"""Matching of found devices to known ones, after some were power-cycled, moved or replaced."""

from __future__ import annotations

from collections.abc import Sequence


def vacancies(found: Sequence[int], known: Sequence[int]) -> dict[int, tuple[int, ...]]:
    """Return the free positions to which each unmatched device may belong.

    A device matches if its address is known and in the order of the cable. As many devices as
    possible are matched, so that a device with an address from another place is not a neighbour.

    Args:
        found: Station addresses in the order of the frame; a device that was powered up has 0.
        known: Station addresses of the known devices, by position.

    Returns:
        For the rank of each unmatched device in `found`: the positions in `known` between its
        matched neighbours.
    """
    place = {address: position for position, address in enumerate(known)}
    ours = _longest_rising([place.get(address, -1) for address in found])
    free: dict[int, tuple[int, ...]] = {}
    for rank in range(len(found)):
        if rank in ours:
            continue
        before = max((ours[other] for other in ours if other < rank), default=-1)
        behind = min((ours[other] for other in ours if other > rank), default=len(known))
        free[rank] = tuple(range(before + 1, behind))
    return free


def _longest_rising(places: Sequence[int]) -> dict[int, int]:
    """Return the longest strictly rising sequence of non-negative places, as {rank: place}.

    Of several such sequences, the first one found is returned.
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
