"""Ethernet frames in fragments: division, reassembly, and fragments that are wrong."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.wire.eoe import HEADER_SIZE, Fragment
from catenary.wire.eoe_frames import (
    FRAGMENT_TIMEOUT_NS,
    MAX_FRAME,
    MIN_FRAME,
    Drop,
    FrameAssembler,
    fragment_room,
    fragments_of,
)

ROOM = 122  # of a mailbox of 128 bytes


def frame_of(size: int) -> bytes:
    return bytes(k * 7 + k // 251 & 0xFF for k in range(size))


def assembled(assembler: FrameAssembler, fragments: list[Fragment]) -> list[bytes]:
    found = [assembler.add(each, 0) for each in fragments]
    return [frame for frame in found if frame is not None]


@given(st.integers(MIN_FRAME, MAX_FRAME), st.integers(36, 1486), st.integers(0, 15))
def test_every_frame_survives_division(size: int, room: int, number: int) -> None:
    fragments = fragments_of(frame_of(size), number, room)
    assert all(len(each.encode()) <= room for each in fragments)
    assert all(len(each.data) % 32 == 0 for each in fragments[:-1])
    assert {each.frame for each in fragments} == {number}
    assembler = FrameAssembler()
    assert assembled(assembler, fragments) == [frame_of(size)]
    assert not assembler.drops


def test_the_fields_of_the_fragments() -> None:
    # Sizes as SOEM (ecx_EOEsend) and the SSC (SendFragment) state them for 250 bytes.
    fields = [
        (each.number, each.blocks, len(each.data), each.last)
        for each in fragments_of(frame_of(250), 3, ROOM)
    ]
    assert fields == [(0, 8, 96, False), (1, 3, 96, False), (2, 6, 58, True)]


def test_a_last_fragment_may_fill_the_message() -> None:
    assert fragment_room(ROOM) == 96
    [only] = fragments_of(frame_of(ROOM - HEADER_SIZE), 0, ROOM)
    assert only.last


@pytest.mark.parametrize(("size", "room"), [(MAX_FRAME + 1, ROOM), (60, 35)])
def test_what_does_not_fit_is_refused(size: int, room: int) -> None:
    with pytest.raises(ValueError, match="bytes, not"):
        fragments_of(frame_of(size), 0, room)


def parts() -> list[Fragment]:
    return fragments_of(frame_of(250), 3, ROOM)


WRONG: dict[str, tuple[list[Fragment], Drop]] = {
    "no start": (parts()[1:], Drop.ORDER),
    "one missing": ([parts()[0], parts()[2]], Drop.ORDER),
    "reordered": ([parts()[0], parts()[2], parts()[1]], Drop.ORDER),
    "other frame": ([parts()[0], replace(parts()[1], frame=4)], Drop.ORDER),
    "wrong offset": ([parts()[0], replace(parts()[1], blocks=2)], Drop.ORDER),
    "announced too short": ([replace(parts()[0], blocks=2)], Drop.TOO_LONG),
    "longer than announced": (
        [replace(parts()[0], blocks=4), replace(parts()[1], data=bytes(64))],
        Drop.TOO_LONG,
    ),
    "longer than a frame": (fragments_of(frame_of(MAX_FRAME), 0, 1486)[:1], Drop.TOO_LONG),
    "too short": ([Fragment(0, 1, 0, bytes(MIN_FRAME - 1))], Drop.TOO_SHORT),
    "empty": ([Fragment(0, 0, 0, b"")], Drop.TOO_SHORT),
}


@pytest.mark.parametrize(("fragments", "reason"), WRONG.values(), ids=WRONG.keys())
def test_wrong_fragments_are_dropped_and_the_next_frame_arrives(
    fragments: list[Fragment], reason: Drop
) -> None:
    assembler = FrameAssembler()
    if reason is Drop.TOO_LONG and len(fragments[0].data) > 1000:
        fragments = [fragments[0], replace(fragments[0], number=1, blocks=46, data=bytes(64))]
    assert assembled(assembler, fragments) == []
    assert assembler.drops[reason] >= 1
    assert assembled(assembler, parts()) == [frame_of(250)]


def test_duplicates_do_not_harm_the_frame() -> None:
    assembler = FrameAssembler()
    first, second, third = parts()
    assert assembled(assembler, [first, first, second, second, third]) == [frame_of(250)]
    assert assembler.drops == {Drop.DUPLICATE: 2}


def test_a_new_frame_ends_an_incomplete_one() -> None:
    assembler = FrameAssembler()
    fragments = parts()[:2] + fragments_of(frame_of(100), 4, ROOM)
    assert assembled(assembler, fragments) == [frame_of(100)]
    assert assembler.drops == {Drop.INCOMPLETE: 1}


def test_a_late_fragment_is_dropped() -> None:
    assembler = FrameAssembler()
    first, second, _ = parts()
    assembler.add(first, 0)
    assert assembler.add(second, FRAGMENT_TIMEOUT_NS + 1) is None
    assert assembler.drops == {Drop.TIMEOUT: 1, Drop.ORDER: 1}


def test_endless_fragments_are_bounded() -> None:
    assembler = FrameAssembler()
    for number in range(1000):
        data = bytes(64)
        assert assembler.add(Fragment(number % 64, 63, 0, data, last=False), number) is None
        assert len(assembler._data) <= MAX_FRAME
    assert assembler.drops[Drop.TOO_LONG] + assembler.drops[Drop.ORDER] > 900


def test_a_time_stamp_is_not_part_of_the_frame() -> None:
    last = parts()[2]
    assert assembled(FrameAssembler(), [*parts()[:2], replace(last, time_stamp=5)]) == [
        frame_of(250)
    ]


def test_a_size_rounded_up_twice_is_accepted() -> None:
    # IgH (ec_eoe_send) announces one block more if the size is a multiple of 32.
    [only] = fragments_of(frame_of(64), 0, ROOM)
    assert assembled(FrameAssembler(), [replace(only, blocks=3)]) == [frame_of(64)]
