"""Which device is which, after some were switched off, moved or exchanged. Pure."""

from __future__ import annotations

from collections.abc import Sequence


def vacancies(found: Sequence[int], known: Sequence[int]) -> dict[int, tuple[int, ...]]:
    """For each device that is no longer, or not yet, one of ours, the places it may belong to.

    `found`: the station addresses read by position, in the order of the frame; a device that was
    switched on has 0. `known`: the station addresses of our devices, by position. Returns, by rank
    in `found`, the positions in `known` that nobody holds between the neighbours of that device.

    A device that brings an address along from elsewhere is no neighbour: those count that keep the
    order of the cable, as many as can be.
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
    """The longest strictly rising sequence among the places that are not negative: its ranks, each
    with its place. Of several the first."""
    length: dict[int, int] = {}  # of the longest one that ends at this rank
    before: dict[int, int] = {}  # the rank before it there
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
