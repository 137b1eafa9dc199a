"""Two links as one ring, over a line of devices written in Python that counts frames."""

from __future__ import annotations

import contextlib
import ctypes
import os
import random
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.link import Ring
from catenary.link._ring import RingLink, merge, second_copy
from catenary.link.ring_state import RingState, Shape
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import decode_frame, encode_frame
from tests.link_table import (
    FORETELLS,
    NOW,
    POLLS,
    RECEIVE,
    SEND,
    VIRTUAL_TIME,
    WAIT_UNTIL,
    Table,
    capsule_of,
    table_in,
)

HOP_NS = 1_000
NEVER = 2**63 - 1
STATIONS = (0x1001, 0x1002, 0x1003, 0x1004)


class RingOfDevices:
    """Owns the time, the cut and the frames under way of a ring whose devices answer FPRD with
    their number, BRD by counting, and FRMW by counting."""

    def __init__(self, stations: Sequence[int] = STATIONS) -> None:
        self.time = 0
        self.stations = list(stations)
        self.cut: int | None = None  # position in front of the cut; -1: the first link's cable
        self.ends = [End(self, "a"), End(self, "b")]
        self.lose: list[tuple[int, int]] = []  # (end sent on, number of its frame)
        self.extra = [0, 0]  # [ns] more on the way to each end
        self.written: dict[int, list[bytes]] = {}

    def send(self, end: int, frame: bytes) -> None:
        number = len(self.ends[end].sent)
        self.ends[end].sent.append(frame)
        if (end, number) in self.lose:
            return
        count = len(self.stations)
        if self.cut is None:
            back = self.processed(frame, self.stations) if end == 0 else frame
            self.arrive(1 - end, back, count * HOP_NS)
            return
        mine = self.stations[: self.cut + 1] if end == 0 else self.stations[self.cut + 1 :]
        if mine:
            self.arrive(end, self.processed(frame, mine), 2 * len(mine) * HOP_NS)

    def arrive(self, end: int, frame: bytes, delay: int) -> None:
        self.ends[end].under_way.append((self.time + delay + self.extra[end], frame))
        self.ends[end].under_way.sort(key=lambda each: each[0])

    def processed(self, frame: bytes, stations: Sequence[int]) -> bytes:
        decoded = decode_frame(frame)
        datagrams = [self.answer(d, stations) for d in decoded.datagrams]
        source = bytes([frame[6] | 2]) + frame[7:12]
        return encode_frame(datagrams, source=source)

    def answer(self, d: Datagram, stations: Sequence[int]) -> Datagram:
        data, counter = d.data, 0
        for station in stations:
            if d.command is EcatCommand.FPRD and d.adp == station:
                data, counter = station.to_bytes(len(data), "little"), counter + 1
            elif d.command is EcatCommand.FPWR and d.adp == station:
                self.written.setdefault(station, []).append(d.data)
                counter += 1
            elif d.command in (EcatCommand.BRD, EcatCommand.FRMW) or d.command is EcatCommand.APRD:
                counter += 1
        return Datagram(d.command, d.address, data, d.index, counter)


class End:
    """One end of the ring, as a link."""

    def __init__(self, ring: RingOfDevices, name: str) -> None:
        self.ring, self.name = ring, name
        self.sent: list[bytes] = []
        self.under_way: list[tuple[int, bytes]] = []
        self.closed = False
        self.refuses = False
        self.lent = ctypes.create_string_buffer(1514)
        self.table = Table(
            1,
            VIRTUAL_TIME | FORETELLS,
            None,
            SEND(self.table_send),
            RECEIVE(self.table_receive),
            NOW(lambda _: self.ring.time),
            WAIT_UNTIL(self.table_wait),
        )
        self.table.due = NOW(lambda _: self.under_way[0][0] if self.under_way else NEVER)
        self.capsule_name = b"catenary.link"
        self.capsule = capsule_of(self.table, self.capsule_name)

    def table_send(self, _, frame, length) -> int:
        if self.refuses:
            return -100  # ENETDOWN
        self.ring.send(self.ring.ends.index(self), bytes(frame[:length]))
        return 0

    def table_receive(self, _, frame) -> int:
        if not self.under_way or self.under_way[0][0] > self.ring.time:
            return 0
        _, back = self.under_way.pop(0)
        ctypes.memmove(self.lent, back, len(back))
        frame[0] = ctypes.cast(self.lent, ctypes.POINTER(ctypes.c_uint8))
        return len(back)

    def table_wait(self, _, deadline, wake_on_frame) -> int:
        if wake_on_frame and self.under_way and self.under_way[0][0] <= deadline:
            self.ring.time = max(self.ring.time, self.under_way[0][0])
            return 1
        self.ring.time = max(self.ring.time, deadline)
        return 0

    def close(self) -> None:
        self.closed = True


def exchange(link: RingLink, *datagrams: Datagram, within: int = 1_000_000) -> list[Datagram]:
    """What a frame brings back; empty: nothing."""
    link.send(encode_frame(datagrams))
    if not link.wait_until(link.now() + within, True):
        return []
    back = link.receive()
    assert back is not None
    assert link.receive() is None
    return list(decode_frame(back).datagrams)


def question(station: int, index: int = 1) -> Datagram:
    return Datagram(EcatCommand.FPRD, station | 0x10 << 16, bytes(2), index)


def count(index: int = 2) -> Datagram:
    return Datagram(EcatCommand.BRD, 0x130 << 16, bytes(2), index)


@pytest.fixture
def ring() -> RingOfDevices:
    return RingOfDevices()


@pytest.fixture
def link(ring: RingOfDevices) -> RingLink:
    return RingLink(*ring.ends)


def test_a_closed_ring_answers_once(ring: RingOfDevices, link: RingLink) -> None:
    [back] = exchange(link, count())
    assert back.working_counter == 4
    assert link.state == RingState(Shape.CLOSED, 4, 0)
    assert link.state.cut_behind is None
    assert ring.time == 4 * HOP_NS


@pytest.mark.parametrize("cut", [-1, 0, 1, 2, 3])
def test_a_cut_ring_answers_like_a_closed_ring(
    ring: RingOfDevices, link: RingLink, cut: int
) -> None:
    ring.cut = cut
    for _ in range(5):
        answers = [exchange(link, question(station)) for station in STATIONS]
        [counted] = exchange(link, count())
    assert [d.data for [d] in answers] == [s.to_bytes(2, "little") for s in STATIONS]
    assert [d.working_counter for [d] in answers] == [1] * 4
    assert counted.working_counter == 4
    assert link.state.cut_behind == cut
    assert (link.state.first_devices, link.state.second_devices) == (cut + 1, 3 - cut)


def test_every_cut_and_join_costs_nothing_but_what_is_under_way(
    ring: RingOfDevices, link: RingLink
) -> None:
    chance = random.Random(1)
    for number in range(1000):
        ring.cut = chance.choice([None, -1, 0, 1, 2, 3])
        [back] = exchange(link, count(number % 128))
        assert back.working_counter == 4


def test_a_lost_copy_is_waited_for_and_then_done_without(
    ring: RingOfDevices, link: RingLink
) -> None:
    """The copy that met all devices is whole without the other."""
    ring.lose = [(1, n) for n in range(3)]
    waits = []
    for index in range(4):
        before = ring.time
        [back] = exchange(link, count(index))
        assert back.working_counter == 4
        waits.append(ring.time - before)
    assert waits == [4 * HOP_NS + 100_000] * 3 + [4 * HOP_NS]
    assert link.counts["unpaired"] == 3


def test_the_untouched_copy_alone_is_no_answer(ring: RingOfDevices, link: RingLink) -> None:
    ring.lose = [(0, 0)]
    assert exchange(link, count(1)) == []
    [back] = exchange(link, count(2))
    assert back.working_counter == 4


def test_a_port_that_cannot_send_leaves_the_other(ring: RingOfDevices, link: RingLink) -> None:
    ring.ends[0].refuses = True
    ring.cut = -1
    for index in range(3):
        [back] = exchange(link, count(index))
        assert back.working_counter == 4
    assert link.state.shape is Shape.SECOND_ONLY
    assert link.counts["send_errors_first"] == 3


@pytest.mark.parametrize("side", [0, 1])
def test_a_port_without_a_link_is_reported_as_a_cut(
    ring: RingOfDevices, link: RingLink, side: int
) -> None:
    """Linux refuses frames for a port without a carrier (ENETDOWN, ENOBUFS): a closed ring whose
    cable to the MainDevice is pulled hears of it in no other way."""
    exchange(link, count(0))
    assert link.state.shape is Shape.CLOSED
    ring.ends[side].refuses = True
    ring.cut = 3 if side else -1
    for index in range(1, 5):
        [back] = exchange(link, count(index))
        assert back.working_counter == 4
    assert link.state.cut_behind == ring.cut
    assert link.state.shape is (Shape.FIRST_ONLY if side else Shape.SECOND_ONLY)
    ring.ends[side].refuses = False
    ring.cut = None
    exchange(link, count(5))
    assert link.state == RingState(Shape.CLOSED, 4, 0)


def test_no_port_is_an_error(ring: RingOfDevices, link: RingLink) -> None:
    ring.ends[0].refuses = ring.ends[1].refuses = True
    with pytest.raises(Exception, match="send"):
        link.send(encode_frame([count()]))


def test_positions_count_from_the_first_end_alone(ring: RingOfDevices, link: RingLink) -> None:
    """Behind a cut they would count from the other end and mean somebody else."""
    ring.cut = 1
    asked = Datagram(EcatCommand.APRD, 0x10 << 16, bytes(2), 5)
    time = Datagram(EcatCommand.FRMW, 0x1001 | 0x910 << 16, bytes(8), 5)
    back = exchange(link, asked, time, question(0x1004, 5))
    assert [d.command for d in back] == [EcatCommand.APRD, EcatCommand.FRMW, EcatCommand.FPRD]
    assert [d.working_counter for d in back] == [2, 2, 1]


def test_the_second_port_alone_speaks_of_positions_too(ring: RingOfDevices, link: RingLink) -> None:
    ring.cut = 1
    link.route = "second"
    [back] = exchange(link, Datagram(EcatCommand.APRD, 0x10 << 16, bytes(2), 5))
    assert back.working_counter == 2
    assert ring.ends[0].sent == []
    with pytest.raises(ValueError, match="route"):
        link.route = "neither"


def test_a_late_copy_of_an_earlier_frame_is_no_news(ring: RingOfDevices, link: RingLink) -> None:
    ring.cut = 1
    ring.extra[1] = 500_000
    [first] = exchange(link, count(1))
    assert first.working_counter == 2  # the other side is too late
    ring.extra[1] = 0
    ring.time += 1_000_000
    [second] = exchange(link, count(2))
    assert second.working_counter == 4


class Flooded(End):
    """A network interface on which somebody else's frames never end (well, after a thousand)."""

    def __init__(self, ring: RingOfDevices, name: str) -> None:
        super().__init__(ring, name)
        self.readable, writable = os.pipe()
        os.write(writable, b"frames")
        self.table.flags, self.table.fd = POLLS, self.readable
        self.calls = 0

    def table_receive(self, _, frame) -> int:
        self.calls += 1
        if self.calls == 2000:
            os.read(self.readable, 6)
        if self.calls % 2:
            return 0
        self.ring.time += 1000
        ctypes.memset(self.lent, 0, 60)
        frame[0] = ctypes.cast(self.lent, ctypes.POINTER(ctypes.c_uint8))
        return 60


def test_a_flood_of_alien_frames_does_not_outlast_the_deadline(ring: RingOfDevices) -> None:
    link = RingLink(Flooded(ring, "a"), Flooded(ring, "b"))
    assert link.wait_until(50_000, True) is False
    assert 50_000 <= ring.time < 60_000


def test_sending_leaves_the_frame_alone_that_was_received(
    ring: RingOfDevices, link: RingLink
) -> None:
    """By the table: until the next receive or wait its bytes stay."""
    capsule = link.capsule
    table = table_in(capsule)
    link.send(encode_frame([question(STATIONS[0])]))
    assert link.wait_until(link.now() + 1_000_000, True)
    lent = ctypes.POINTER(ctypes.c_uint8)()
    length = table.receive(table.self, ctypes.byref(lent))
    before = bytes(lent[:length])
    link.send(encode_frame([count()]))
    assert bytes(lent[:length]) == before


def test_closing_closes_both(ring: RingOfDevices) -> None:
    with Ring(*ring.ends, pair_wait=50e-6).open_link() as link:
        assert link.name == "a,b"
    assert [end.closed for end in ring.ends] == [True, True]
    with pytest.raises(ValueError, match="pair_wait"):
        RingLink(*ring.ends, pair_wait=-1.0)


def test_links_that_cannot_be_waited_for_together_are_refused(ring: RingOfDevices) -> None:
    ring.ends[1].table.flags = VIRTUAL_TIME
    with pytest.raises(ValueError, match="two ends of one virtual"):
        RingLink(*ring.ends)


COPIED = st.sampled_from(
    [EcatCommand.FPRD, EcatCommand.FPWR, EcatCommand.BRD, EcatCommand.LRW, EcatCommand.LWR]
)
NOT_COPIED = [
    EcatCommand.APRD,
    EcatCommand.APWR,
    EcatCommand.APRW,
    EcatCommand.FRMW,
    EcatCommand.ARMW,
]


@given(st.lists(st.tuples(COPIED, st.binary(min_size=1, max_size=40)), min_size=1, max_size=8))
def test_merging_ors_the_data_and_adds_the_counters(parts: list[tuple[EcatCommand, bytes]]) -> None:
    first = [Datagram(c, 0, data, 7, 3) for c, data in parts]
    second = [Datagram(c, 0, bytes(len(data)), 7, 2) for c, data in parts]
    back = decode_frame(merge(encode_frame(first), encode_frame(second))).datagrams
    assert [(d.data, d.working_counter) for d in back] == [(data, 5) for _, data in parts]


@given(st.binary(max_size=200), st.binary(max_size=200))
def test_no_bytes_make_merging_fail_otherwise(first: bytes, second: bytes) -> None:
    with contextlib.suppress(ValueError):  # not two copies of one frame
        assert len(merge(first, second)) == len(first)
    assert len(second_copy(first)) == len(first)


@pytest.mark.parametrize("command", NOT_COPIED)
def test_what_must_not_be_there_twice_is_not_in_the_second_copy(command: EcatCommand) -> None:
    frame = encode_frame(
        [Datagram(command, 0, bytes(4), 1), Datagram(EcatCommand.BRD, 0, bytes(2), 1)]
    )
    commands = [d.command for d in decode_frame(second_copy(frame)).datagrams]
    assert commands == [EcatCommand.NOP, EcatCommand.BRD]


def test_the_expected_time_controls_the_clocks_beyond_a_cut(
    ring: RingOfDevices, link: RingLink
) -> None:
    """The second copy asks nobody for it; what comes back is what the reference clock has said."""
    ring.cut = 1
    expected = Datagram(EcatCommand.FRMW, 0x1001 | 0x910 << 16, bytes(3) + b"\x01", 5)
    [back] = exchange(link, expected)
    assert back.working_counter == 2
    [behind] = decode_frame(ring.ends[1].sent[-1]).datagrams
    assert (behind.command, behind.adp, behind.data) == (EcatCommand.FRMW, 0xFFFF, expected.data)
    asked = [Datagram(EcatCommand.FRMW, 0x1001 | 0x910 << 16, b"\x5a\x5a", 5, 3)]
    first, other = encode_frame(asked), second_copy(encode_frame(asked))
    assert merge(first, other) == first


def test_a_time_only_in_the_second_copy_is_ignored(ring: RingOfDevices, link: RingLink) -> None:
    ring.cut = -1
    [back] = exchange(link, Datagram(EcatCommand.FRMW, 0x1001 | 0x910 << 16, b"\x01\x02", 5))
    assert (back.data, back.working_counter) == (b"\x01\x02", 0)
