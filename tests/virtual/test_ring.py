"""Ring with two links: closed, cut once and cut twice."""

from __future__ import annotations

import random

import pytest

from catenary.link import Ring
from catenary.virtual import Coupler, Segment, Servo
from catenary.virtual._segment_link import SegmentLink
from catenary.virtual.faults import Fault, cut, join, power_cycle
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import Frame, decode_frame, encode_frame

MILLISECOND = 1_000_000
COUNT = 6
BRD = encode_frame([Datagram(EcatCommand.BRD, 0x0130 << 16, bytes(2))])
LOCAL = 0x02  # bit of the source address that a processing unit sets


class Ends:
    """Both links to a ring."""

    def __init__(self, *faults: Fault, detection: float = 15e-6) -> None:
        devices = [Coupler() for _ in range(COUNT)]
        self.segment = Segment(devices, ring=True, faults=faults, link_loss_detection=detection)
        self.links = (self.segment.open_link(), self.segment.second.open_link())

    def exchange(self) -> tuple[Frame | None, Frame | None]:
        """Send one frame into each end. Return the frames received within 0.5 ms."""
        for link in self.links:
            link.send(BRD)
        end = self.links[0].now() + MILLISECOND // 2
        self.links[0].wait_until(end, False)
        return tuple(self._received(link) for link in self.links)  # type: ignore[return-value]

    @staticmethod
    def _received(link: SegmentLink) -> Frame | None:
        frame = link.receive()
        assert link.receive() is None
        return None if frame is None else decode_frame(frame)

    def counters(self) -> tuple[int | None, int | None]:
        first, second = self.exchange()
        return _counter(first), _counter(second)

    def let_pass(self, milliseconds: float) -> None:
        link = self.links[0]
        link.wait_until(link.now() + round(milliseconds * MILLISECOND), False)


def _counter(frame: Frame | None) -> int | None:
    return None if frame is None else frame.datagrams[0].working_counter


def test_closed_ring_processes_only_frames_from_the_first_end() -> None:
    ring = Ends()
    assert ring.segment.wires.processed(0) == list(range(COUNT))
    assert ring.segment.wires.processed(1) == []
    # a frame from either end leaves at the other end
    assert ring.counters() == (0, COUNT)


def test_unprocessed_frame_is_not_changed() -> None:
    ring = Ends()
    ring.links[1].send(BRD)
    assert ring.links[0].wait_until(MILLISECOND, True)
    assert ring.links[0].receive() == BRD
    ring.links[0].send(BRD)
    assert ring.links[1].wait_until(2 * MILLISECOND, True)
    frame = ring.links[1].receive()
    assert frame is not None
    assert frame[6] & LOCAL


@pytest.mark.parametrize("at", range(1, COUNT))
def test_each_end_reaches_its_part_of_a_cut_ring(at: int) -> None:
    ring = Ends(cut(between=(at - 1, at)))
    ring.let_pass(1)
    assert ring.segment.wires.processed(0) == list(range(at))
    assert ring.segment.wires.processed(1) == list(range(at, COUNT))
    first, second = ring.exchange()
    assert (_counter(first), _counter(second)) == (at, COUNT - at)
    assert first is not None
    assert second is not None
    assert not first.datagrams[0].circulating
    assert second.datagrams[0].circulating  # it passed a port 0 that was closed automatically


@pytest.mark.parametrize(
    ("between", "expected"), [(("main", 0), (None, COUNT)), ((COUNT - 1, "main"), (COUNT, None))]
)
def test_cables_of_the_main_device_can_be_cut(
    between: tuple[int | str, int | str], expected: tuple[int | None, int | None]
) -> None:
    ring = Ends(cut(between=between))  # type: ignore[arg-type]
    ring.let_pass(1)
    assert ring.counters() == expected


def test_devices_between_two_cuts_are_unreachable() -> None:
    ring = Ends(cut(between=(1, 2)), cut(between=(3, 4)))
    ring.let_pass(1)
    assert ring.counters() == (2, 2)
    assert ring.segment.wires.processed(1) == [4, 5]


def test_unpowered_device_cuts_the_ring_on_both_sides() -> None:
    ring = Ends(power_cycle(2, at=0.001, for_=0.005))
    ring.let_pass(2)
    assert ring.counters() == (2, 3)
    ring.let_pass(5)
    assert ring.counters() == (0, COUNT)
    assert ring.segment[2].state == 1


def test_both_frames_are_lost_until_a_cut_is_detected() -> None:
    ring = Ends(detection=3e-3)
    ring.segment.inject(cut(between=(2, 3)))
    found = [ring.counters() for _ in range(8)]  # one frame per half millisecond
    assert found == [(None, None)] * 6 + [(3, 3)] * 2
    assert {loss.cause for loss in ring.segment.take_losses()} == {"no light"}


def test_frame_at_a_second_closed_port_0_is_destroyed() -> None:
    ring = Ends()
    marked = bytearray(BRD)
    marked[16 + 7] |= 0x40  # already marked as circulating
    ring.segment.inject(cut(between=(2, 3)))
    ring.let_pass(1)
    ring.links[1].send(bytes(marked))
    assert not ring.links[1].wait_until(ring.links[1].now() + MILLISECOND, True)
    assert [loss.cause for loss in ring.segment.take_losses()] == ["circulating"]
    ring.links[0].send(bytes(marked))  # at this end no port 0 is closed
    assert ring.links[0].wait_until(ring.links[0].now() + MILLISECOND, True)


def test_station_addresses_are_valid_on_both_sides_of_a_cut() -> None:
    ring = Ends()
    for k in range(COUNT):
        data = (0x1000 + k).to_bytes(2, "little")
        ring.links[0].send(
            encode_frame([Datagram(EcatCommand.APWR, -k & 0xFFFF | 0x10 << 16, data)])
        )
    ring.let_pass(1)
    while ring.links[1].receive():
        pass
    ring.segment.inject(cut(between=(3, 4)))
    ring.let_pass(1)
    read = encode_frame([Datagram(EcatCommand.FPRD, 0x1005 | 0x10 << 16, bytes(2))])
    for link in ring.links:
        link.send(read)
    ring.let_pass(1)
    frames = [link.receive() for link in ring.links]
    assert [
        None if f is None else decode_frame(f).datagrams[0].working_counter for f in frames
    ] == [
        0,
        1,
    ]


@pytest.mark.parametrize("detection", [15e-6, 3e-3])
def test_thousand_cuts_lose_a_bounded_number_of_frames(detection: float) -> None:
    """Each cycle sends both frames. A cycle is lost unless together they reach all devices."""
    dice = random.Random(4)
    ring = Ends(detection=detection)
    lost = allowed = 0
    period = MILLISECOND // 2
    for _ in range(1000):
        at = dice.randrange(COUNT + 1)
        between = ("main" if at == 0 else at - 1, "main" if at == COUNT else at)
        ring.let_pass(dice.random() * 0.5)
        ring.segment.inject(cut(between=between))  # type: ignore[arg-type]
        cycles = [ring.counters() for _ in range(dice.randrange(1, 12))]
        ring.segment.inject(join(between=between))  # type: ignore[arg-type]
        cycles += [ring.counters() for _ in range(3)]
        lost += sum((first or 0) + (second or 0) != COUNT for first, second in cycles)
        allowed += -(-round(detection * 1e9) // period)
    assert 0 < lost <= allowed


def test_line_has_no_second_end() -> None:
    with pytest.raises(ValueError, match="only a ring"):
        Segment([Coupler()]).second.open_link()


def test_both_links_are_exclusive() -> None:
    ring = Ends()
    with pytest.raises(ValueError, match="open link"):
        ring.segment.second.open_link()
    ring.links[1].close()
    ring.segment.second.open_link().close()


def test_ring_without_a_second_link_is_a_line() -> None:
    segment = Segment([Coupler(), Coupler()], ring=True)
    with segment.first.open_link() as link:
        link.send(BRD)
        assert link.wait_until(MILLISECOND, True)
        frame = link.receive()
        assert frame is not None
        assert decode_frame(frame).datagrams[0].working_counter == 2
        with segment.second.open_link():
            link.send(BRD)
            assert not link.wait_until(link.now() + MILLISECOND, True)  # it leaves there
        link.send(BRD)
        assert link.wait_until(link.now() + MILLISECOND, True)


def test_ring_can_start_with_a_cut() -> None:
    segment = Segment([Servo(), Servo()], ring=True, faults=[cut(between=(0, 1))])
    with segment.first.open_link() as link, segment.second.open_link():
        link.wait_until(MILLISECOND, False)
        assert (segment.wires.processed(0), segment.wires.processed(1)) == ([0], [1])


def test_links_report_the_arrival_time_of_the_next_frame() -> None:
    """`due` of native/link.h lets the ring of the MainDevice wake when a frame arrives."""
    segment = Segment([Coupler() for _ in range(COUNT)], ring=True)
    with Ring(segment.first, segment.second).open_link() as link:
        link.send(BRD)
        assert link.wait_until(link.now() + MILLISECOND, True)
        assert link.now() < 50_000
        frame = link.receive()
        assert frame is not None
        assert decode_frame(frame).datagrams[0].working_counter == COUNT
