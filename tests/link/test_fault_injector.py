"""Faults: the frames they affect, their effect, and repetition by a seed."""

from __future__ import annotations

import pytest

from catenary.errors import LinkError
from catenary.link import Fault, FaultInjector
from tests.link.python_link import PythonLink, frame

LATENCY = 1000


def numbered(count: int) -> list[bytes]:
    return [frame(bytes([number]) * 40) for number in range(count)]


def exchange(link: FaultInjector, frames: list[bytes], period: int = 10_000) -> list[list[bytes]]:
    """Sends one frame a period; the frames that came back in each."""
    rounds = []
    for sent in frames:
        end = link.now() + period
        link.send(sent)
        back = []
        while link.wait_until(end, True):
            received = link.receive()
            assert received is not None
            back.append(received)
        rounds.append(back)
    return rounds


def test_without_faults_all_frames_return():
    frames = numbered(5)
    assert exchange(FaultInjector(PythonLink()), frames) == [[sent] for sent in frames]


def test_loses_the_frames_named():
    frames = numbered(6)
    link = FaultInjector(PythonLink(), Fault(kind="lose", frames=range(1, 6, 2)))
    assert [len(back) for back in exchange(link, frames)] == [1, 0, 1, 0, 1, 0]
    assert link.injected["lose"] == 3


def test_a_frame_lost_when_sent_never_reaches_the_link():
    inner = PythonLink()
    frames = numbered(3)
    link = FaultInjector(inner, Fault(kind="lose", direction="sent", frames=range(1, 2)))
    exchange(link, frames)
    assert inner.sent == [frames[0], frames[2]]


def test_a_lost_frame_does_not_wake():
    link = FaultInjector(PythonLink(), Fault(kind="lose"))
    link.send(frame(bytes(4)))
    assert link.wait_until(50_000, True) is False
    assert link.now() == 50_000


class Flood(PythonLink):
    """Every wait ends 1 us later with another frame."""

    def table_wait_until(self, _, deadline, wake_on_frame) -> int:
        self.time += 1000
        self.under_way.append((self.time, frame(bytes(4))))
        return 1 if self.time < 1_000_000 else -1


def test_a_flood_of_lost_frames_does_not_outlast_the_deadline():
    link = FaultInjector(Flood(), Fault(kind="lose"))
    assert link.wait_until(50_000, True) is False
    assert link.now() == 51_000


def test_duplicates():
    link = FaultInjector(PythonLink(), Fault(kind="duplicate", frames=range(1, 2)))
    frames = numbered(3)
    assert exchange(link, frames) == [[frames[0]], [frames[1]] * 2, [frames[2]]]


def test_a_sent_frame_that_is_duplicated_is_sent_twice():
    inner = PythonLink()
    link = FaultInjector(inner, Fault(kind="duplicate", direction="sent"))
    link.send(frame(bytes(4)))
    assert inner.sent == [frame(bytes(4))] * 2


def test_a_delayed_frame_arrives_after_the_next():
    frames = numbered(3)
    late = Fault(kind="delay", frames=range(0, 1), delay=15e-6)
    rounds = exchange(FaultInjector(PythonLink(), late), frames)
    assert rounds == [[], [frames[1], frames[0]], [frames[2]]]


def test_waiting_wakes_when_the_delayed_frame_is_due():
    late = Fault(kind="delay", delay=20e-6)
    link = FaultInjector(PythonLink(latency_ns=LATENCY), late)
    link.send(frame(bytes(4)))
    assert link.wait_until(100_000, True) is True
    assert link.now() == LATENCY + 20_000


def test_a_frame_delayed_when_sent_leaves_later():
    inner = PythonLink()
    link = FaultInjector(inner, Fault(kind="delay", direction="sent", delay=20e-6))
    link.send(frame(bytes(4)))
    assert inner.sent == []
    assert link.wait_until(100_000, False) is False
    assert inner.sent == [frame(bytes(4))]


def test_corrupts_one_bit_of_the_ethercat_part():
    sent = frame(bytes(40)) + bytes(20)
    link = FaultInjector(PythonLink(), Fault(kind="corrupt"), seed=3)
    for [received] in exchange(link, [sent] * 200):
        flipped = [
            (i, a ^ b) for i, (a, b) in enumerate(zip(sent, received, strict=True)) if a != b
        ]
        [(place, bits)] = flipped
        assert 14 <= place < 14 + 2 + 52
        assert bits.bit_count() == 1


def test_corrupts_the_byte_named():
    sent = frame(bytes(40))
    [[received]] = exchange(FaultInjector(PythonLink(), Fault(kind="corrupt", offset=30)), [sent])
    assert received == sent[:30] + b"\xff" + sent[31:]


def test_counts_cyclic_frames_apart():
    frames = [frame(b"\1" * 40, index=0x80), frame(bytes(40)), frame(b"\2" * 40, index=0xFF)]
    link = FaultInjector(PythonLink(), Fault(kind="lose", traffic="cyclic", frames=range(1, 2)))
    rounds = exchange(link, frames * 2)
    assert [len(back) for back in rounds] == [1, 1, 1, 1, 0, 1]
    assert link.seen(traffic="cyclic") == 2
    assert link.seen(traffic="acyclic") == 4
    assert link.seen("sent") == 6


def test_a_seed_repeats_and_another_differs():
    def lost(seed: int) -> list[int]:
        link = FaultInjector(PythonLink(), Fault(kind="lose", probability=0.3), seed=seed)
        return [len(back) for back in exchange(link, numbered(100))]

    assert lost(1) == lost(1) != lost(2)
    assert 50 < sum(lost(1)) < 90


def test_faults_may_change_while_running():
    link = FaultInjector(PythonLink())
    exchange(link, numbered(4))
    link.inject(Fault(kind="lose", frames=range(link.seen() + 1, link.seen() + 2)))
    assert [len(back) for back in exchange(link, numbered(3))] == [1, 0, 1]
    link.inject()
    assert [len(back) for back in exchange(link, numbered(2))] == [1, 1]


def test_a_store_that_is_full_loses_and_counts():
    link = FaultInjector(PythonLink(), Fault(kind="delay", direction="sent", delay=1.0))
    for sent in numbered(70):
        link.send(sent)
    assert link.injected["lose"] == 6


def test_closing_closes_the_link_inside():
    inner = PythonLink()
    with FaultInjector(inner) as link:
        assert link.name == "python"
    assert inner.closed
    with pytest.raises(LinkError, match="closed"):
        link.send(frame(bytes(4)))


@pytest.mark.parametrize(
    "options",
    [
        {"kind": "drop"},
        {"kind": "lose", "direction": "up"},
        {"kind": "lose", "traffic": "mailbox"},
        {"kind": "lose", "probability": 1.5},
        {"kind": "lose", "delay": 1.0},
        {"kind": "delay"},
        {"kind": "lose", "offset": 3},
        {"kind": "corrupt", "offset": -1},
        {"kind": "lose", "frames": range(5, 0, -1)},
    ],
)
def test_refuses_an_impossible_fault(options):
    with pytest.raises(
        ValueError,
        match=r"must be one of|is outside|only kind|must not start|cannot have|do not count",
    ):
        Fault(**options)
