"""Pairs of devices of two clones."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.line import Line
from catenary.line.pairing import Pairing, pair_devices
from catenary.model.device import Identity
from tests.line.clones import one_device

A, B, C = (Identity(2, product, 1, 0) for product in (1, 2, 3))


def numbered(identity: Identity, serial: int) -> Identity:
    return identity._replace(serial=serial)


def line(*identities: Identity | None, serials: bool = True) -> Line:
    devices = (one_device(n, identity=each) for n, each in enumerate(identities))
    return Line(tuple(devices), serials)


def paired(old: Line, new: Line) -> dict[int, int]:
    return dict(pair_devices(old, new).pairs)


def test_equal_segments_are_paired_in_order() -> None:
    same = line(A, B, B, None)
    expected = Pairing(((0, 0), (1, 1), (2, 2), (3, 3)), frozenset(), (), ())
    assert pair_devices(same, same) == expected


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ((A, B, A), (A, A), {0: 0, 2: 1}),  # B is missing
        ((A, B, C, B), (A, C, B), {0: 0, 2: 1, 3: 2}),  # the first B is missing
        ((A, C), (A, B, C), {0: 0, 1: 2}),  # B was added
        ((A, B, C), (A, C, B), {0: 0, 1: 2, 2: 1}),  # the order changed
        ((A, B), (A, B._replace(revision=9)), {0: 0, 1: 1}),  # another revision
        ((A, B, C), (A, Identity(5, 5, 5, 5), C), {0: 0, 1: 1, 2: 2}),  # another product
        ((A, B, C), (A, None, C), {0: 0, 1: 1, 2: 2}),  # not identified now
    ],
)
def test_pairs_without_serial_numbers(
    old: tuple[Identity, ...], new: tuple[Identity | None, ...], expected: dict[int, int]
) -> None:
    assert paired(line(*old), line(*new)) == expected


def test_serial_numbers_find_a_device_at_another_place() -> None:
    one, two, three = (numbered(A, n) for n in (1, 2, 3))
    found = pair_devices(line(one, two, three), line(three, one, two))
    assert dict(found.pairs) == {0: 1, 1: 2, 2: 0}
    assert found.moved == {2}


def test_a_device_with_another_serial_number_takes_the_place_of_the_exchanged_one() -> None:
    one, two, three, four = (numbered(A, n) for n in (1, 2, 3, 4))
    found = pair_devices(line(one, two, three), line(one, four, three))
    assert dict(found.pairs) == {0: 0, 1: 1, 2: 2}
    assert not found.moved


def test_another_serial_number_at_another_place_is_another_device() -> None:
    found = pair_devices(line(numbered(A, 1), B), line(B, numbered(A, 2)))
    assert (found.pairs, found.missing, found.added) == (((1, 0),), (0,), (1,))


def test_serial_numbers_are_ignored_if_a_clone_has_none() -> None:
    old, new = line(numbered(A, 1), numbered(A, 2)), line(A, A, serials=False)
    assert paired(old, new) == {0: 0, 1: 1}


@given(st.data())
def test_every_device_is_in_exactly_one_place(data: st.DataObject) -> None:
    some = st.lists(st.sampled_from((A, B, numbered(A, 1), numbered(A, 2), None)), max_size=8)
    old, new = line(*data.draw(some)), line(*data.draw(some))
    found = pair_devices(old, new)
    assert sorted([*(a for a, _ in found.pairs), *found.missing]) == list(range(len(old.devices)))
    assert sorted([*(b for _, b in found.pairs), *found.added]) == list(range(len(new.devices)))
    fixed = sorted(pair for pair in found.pairs if pair[0] not in found.moved)
    assert [b for _, b in fixed] == sorted(b for _, b in fixed)


def test_a_long_segment_is_paired_without_an_alignment() -> None:
    old, new = line(A, *(B,) * 2100, C), line(B, *(A,) * 2100, C)
    assert len(pair_devices(old, new).pairs) == 2102
