"""Comparison of the objects that two masters wrote to a device."""

from __future__ import annotations

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Iterator, Sequence
from difflib import SequenceMatcher
from typing import NamedTuple

from catenary.capture.device_pairs import out_of_place
from catenary.capture.difference import Difference, Mark, Topic, level, mark_of
from catenary.capture.events import Step
from catenary.capture.object_writes import Objects, ObjectWrite, Place, value_of
from catenary.wire.abort import abort_code
from catenary.wire.al import AlState

_MAXIMUM_ALIGNED = 200  # writes of one object; more are compared in their order


class _Pair(NamedTuple):
    """Numbers of a write in A and in B; None if a capture has no such write."""

    a: int | None
    b: int | None


def compare_objects(a: Objects, b: Objects) -> Iterator[Difference]:
    """Yield a row for each write that differs, in the order of A, and one for the order.

    A write of only one capture has no effect if the other one wrote or read the same last value,
    or if the same capture overwrites it later.

    Args:
        a: Objects of A.
        b: Objects of B.
    """
    pairs = _pairs(a.writes, b.writes)
    for pair in pairs:
        left = None if pair.a is None else a.writes[pair.a]
        right = None if pair.b is None else b.writes[pair.b]
        row = _difference(left, right, a, b)
        if row is not None:
            yield row
    order = _order(pairs, a, b)
    if order is not None:
        yield order


def _pairs(a: Sequence[ObjectWrite], b: Sequence[ObjectWrite]) -> list[_Pair]:
    """Return the pairs of writes. Those of B alone follow the write before them."""
    pairs: list[_Pair] = []
    left, right = _by_place(a), _by_place(b)
    for place in dict.fromkeys((*left, *right)):
        pairs += _align(left[place], right[place], a, b)
    both = sorted((j, i) for i, j in pairs if i is not None and j is not None)
    starts = [number for number, _ in both]

    def key(pair: _Pair) -> tuple[int, int]:
        if pair.a is not None:
            return pair.a, -1
        assert pair.b is not None
        before = bisect_right(starts, pair.b)
        return (both[before - 1][1] if before else -1), pair.b

    return sorted(pairs, key=key)


def _by_place(writes: Sequence[ObjectWrite]) -> dict[Place, list[int]]:
    found: dict[Place, list[int]] = defaultdict(list)
    for number, write in enumerate(writes):
        found[write.place].append(number)
    return found


def _align(
    left: list[int], right: list[int], a: Sequence[ObjectWrite], b: Sequence[ObjectWrite]
) -> Iterator[_Pair]:
    """Yield the pairs of the writes to one object."""
    if len(left) == len(right) or max(len(left), len(right)) > _MAXIMUM_ALIGNED:
        blocks = [(0, len(left), 0, len(right))]
    else:
        matcher = SequenceMatcher(
            None, [a[i].value for i in left], [b[i].value for i in right], autojunk=False
        )
        blocks = [each[1:] for each in matcher.get_opcodes()]
    for first_a, last_a, first_b, last_b in blocks:
        for offset in range(max(last_a - first_a, last_b - first_b)):
            i, j = first_a + offset, first_b + offset
            yield _Pair(
                left[i] if i < last_a else None,
                right[j] if j < last_b else None,
            )


def _difference(
    a: ObjectWrite | None, b: ObjectWrite | None, in_a: Objects, in_b: Objects
) -> Difference | None:
    present = a or b
    assert present is not None
    if a and b:
        effect, note = True, ""
        if a.value == b.value:
            if _is_late(a) is _is_late(b):
                return None
            note = f"not before SAFE-OP in {'A' if _is_late(a) else 'B'}"
        elif a.succeeded is not b.succeeded:
            note = _refusal(a, "A") if b.succeeded else _refusal(b, "B")
    else:
        effect, note = _alone(present, in_a, in_b, "B") if a else _alone(present, in_b, in_a, "A")
    return Difference(
        mark_of(a, b),
        present.topic,
        present.name,
        present.step,
        str(a) if a else "",
        str(b) if b else "",
        effect,
        note,
        a.packet if a else None,
        b.packet if b else None,
    )


def _refusal(write: ObjectWrite, name: str) -> str:
    if write.abort is None:
        return f"not answered in {name}"
    return f"refused in {name}: {abort_code(write.abort).text}"


def _alone(write: ObjectWrite, own: Objects, other: Objects, name: str) -> tuple[bool, str]:
    """Return the effect and the note of a write that the other capture does not have.

    Args:
        write: The write.
        own: Objects of its capture.
        other: Objects of the other capture.
        name: "A" or "B", the other capture.
    """
    if not write.succeeded:
        return False, "not answered" if write.abort is None else "refused"
    if write.data != own.written[write.place]:
        return False, "overwritten later"
    found = other.known.get(write.place)
    if found is None:
        return True, ""
    verb = "wrote" if other.written.get(write.place) == found else "read"
    if found == write.data:
        return False, f"{name} {verb} this value"
    return True, f"{name} {verb} {value_of(found)}"


def _order(pairs: Sequence[_Pair], a: Objects, b: Objects) -> Difference | None:
    """Return the row for writes in another order; None if the order is the same."""
    both = [(pair.a, pair.b) for pair in pairs if pair.a is not None and pair.b is not None]
    both.sort()
    moved = out_of_place([in_b for _, in_b in both])
    if not moved:
        return None
    chosen = [both[place] for place in sorted(moved)]
    first = a.writes[chosen[0][0]]
    return Difference(
        Mark.ORDER,
        Topic.OBJECT,
        "order of the SDO writes",
        Step(first.step.before, first.step.before),
        _list([a.writes[i] for i, _ in chosen]),
        _list([b.writes[j] for j in sorted(j for _, j in chosen)]),
        effect=False,
        note=f"{len(moved)} SDO writes",
        packet_a=first.packet,
    )


def _list(writes: Sequence[ObjectWrite], shown: int = 3) -> str:
    names = [each.name for each in writes[:shown]]
    return ", ".join(names) + (" ..." if len(writes) > shown else "")


def _is_late(write: ObjectWrite) -> bool:
    return level(write.step.before) >= level(AlState.SAFE_OP)
