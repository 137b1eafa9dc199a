"""Pairing of the devices of two clones: by identity and serial number, then by order."""

from __future__ import annotations

from bisect import bisect_left
from collections import defaultdict, deque
from collections.abc import Callable, Collection, Hashable, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher

from catenary.line.values import ClonedDevice, Line
from catenary.model.device import Identity

ALIGNED_MAX = 2048  # devices per side; longer segments are paired without an alignment


@dataclass(frozen=True, slots=True)
class Pairing:
    """Devices that belong together. All numbers are positions."""

    pairs: tuple[tuple[int, int], ...]  # (old, new), by the new position
    moved: frozenset[int]  # old positions of the pairs that are out of order
    missing: tuple[int, ...]  # old
    added: tuple[int, ...]  # new


def pair_devices(old: Line, new: Line) -> Pairing:
    """Return the pairs of devices of two clones.

    1. Equal identities in the same order.
    2. Equal products and serial numbers, at any place.
    3. Equal products between the same neighbours.
    4. Equal identities without serial numbers, at any place.
    5. Other devices between the same neighbours, in their order: exchanged, or not identified.

    Args:
        old: The earlier clone.
        new: The present clone.
    """
    serials = old.serials and new.serials
    before, now = ([_identity(each, serials) for each in line.devices] for line in (old, new))
    pairs = _Pairs(before, now)
    pairs.align()
    pairs.join(lambda identity, gap: identity and identity.serial and _without_revision(identity))
    pairs.join(lambda identity, gap: identity and (gap, identity[:3]))
    pairs.join(lambda identity, gap: identity and (gap, identity[:2]))
    pairs.join(lambda identity, gap: identity and not identity.serial and identity[:3])
    pairs.join(lambda identity, gap: (gap,))
    found = sorted(pairs.found.items())
    fixed = _increasing([position for _, position in found])
    return Pairing(
        tuple(sorted(found, key=lambda pair: pair[1])),
        frozenset(position for n, (position, _) in enumerate(found) if n not in fixed),
        tuple(n for n in range(len(before)) if n not in pairs.found),
        tuple(n for n in range(len(now)) if n not in pairs.taken),
    )


def _identity(device: ClonedDevice, serials: bool) -> Identity | None:
    if device.identity is None or serials:
        return device.identity
    return device.identity._replace(serial=0)


def _without_revision(identity: Identity) -> Hashable:
    return (identity.vendor, identity.product, identity.serial)


class _Pairs:
    """Pairs that were found so far. It owns `found` (old → new) and `taken` (new)."""

    def __init__(self, old: Sequence[Identity | None], new: Sequence[Identity | None]) -> None:
        self.found: dict[int, int] = {}
        self.taken: set[int] = set()
        self._old = old
        self._new = new
        self._old_gaps: Sequence[int] = [0] * len(old)
        self._new_gaps: Sequence[int] = [0] * len(new)

    def align(self) -> None:
        """Pair equal identities in the same order. They bound the gaps of the other rules."""
        if max(len(self._old), len(self._new)) <= ALIGNED_MAX:
            matcher = SequenceMatcher(None, self._old, self._new, autojunk=False)
            for first, second, length in matcher.get_matching_blocks():
                for n in range(length):
                    self._pair(first + n, second + n)
        self._old_gaps = _gaps(len(self._old), self.found)
        self._new_gaps = _gaps(len(self._new), self.taken)

    def join(self, key: Callable[[Identity | None, int], Hashable]) -> None:
        """Pair the remaining devices with equal keys, in their order.

        Args:
            key: Function of identity and gap; a false result leaves the device out.
        """
        free: dict[Hashable, deque[int]] = defaultdict(deque)
        for position, identity in enumerate(self._new):
            of = key(identity, self._new_gaps[position])
            if of and position not in self.taken:
                free[of].append(position)
        for position, identity in enumerate(self._old):
            of = key(identity, self._old_gaps[position])
            if of and position not in self.found and free.get(of):
                self._pair(position, free[of].popleft())

    def _pair(self, old: int, new: int) -> None:
        self.found[old] = new
        self.taken.add(new)


def _gaps(count: int, paired: Collection[int]) -> list[int]:
    """Return the number of paired devices before each position."""
    gaps, before = [], 0
    for position in range(count):
        gaps.append(before)
        before += position in paired
    return gaps


def _increasing(values: Sequence[int]) -> frozenset[int]:
    """Return the places of a longest increasing sequence."""
    lowest: list[int] = []  # last value of the best sequence of each length
    places: list[int] = []  # its place
    before: list[int] = []  # place of the value before each value; -1 if there is none
    for place, value in enumerate(values):
        length = bisect_left(lowest, value)
        lowest[length : length + 1] = [value]
        places[length : length + 1] = [place]
        before.append(places[length - 1] if length else -1)
    found = []
    last = places[-1] if places else -1
    while last >= 0:
        found.append(last)
        last = before[last]
    return frozenset(found)
