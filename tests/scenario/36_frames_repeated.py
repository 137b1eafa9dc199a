"""A loop in the wiring or a second sender repeats every cyclic frame 128 cycles later.
An event reports the suspicion within two seconds. With exact matching, no repeated frame is
accepted as a current one, also in a ring and with a divider.
"""

from __future__ import annotations

import ctypes
from collections import deque

import numpy as np
import pytest

import catenary as cat
from catenary.bus.event_types import DuplicateFrames
from catenary.link import Link
from catenary.virtual import Coupler, Segment, Servo
from tests.link_table import (
    NOW,
    RECEIVE,
    SEND,
    VIRTUAL_TIME,
    WAIT_UNTIL,
    Table,
    capsule_of,
    table_in,
)
from tests.loop_options import grouped

INDICES = 128


class RepeatingLink:
    """Owns the last frames of a link.

    While `repeats` is True, each received cyclic frame follows the earlier one with its index.
    """

    name = "repeating"

    def __init__(self, link: Link) -> None:
        self.link = link
        self.repeats = False
        self.history: deque[bytes] = deque(maxlen=INDICES)
        self.waiting: deque[bytes] = deque()
        self.lent = ctypes.create_string_buffer(1514)
        self.table = Table(
            1,
            VIRTUAL_TIME,
            None,
            SEND(self.send_frame),
            RECEIVE(self.receive_frame),
            NOW(lambda _: link.now()),
            WAIT_UNTIL(self.wait),
        )
        self.capsule_name = b"catenary.link"
        self.capsule = capsule_of(self.table, self.capsule_name)
        self.send, self.receive, self.now = link.send, link.receive, link.now
        self.wait_until = link.wait_until

    def send_frame(self, _, frame, length) -> int:
        self.link.send(bytes(frame[:length]))
        return 0

    def receive_frame(self, _, frame) -> int:
        if not self.waiting:
            self.take()
        if not self.waiting:
            return 0
        oldest = self.waiting.popleft()
        ctypes.memmove(self.lent, oldest, len(oldest))
        frame[0] = ctypes.cast(self.lent, ctypes.POINTER(ctypes.c_uint8))
        return len(oldest)

    def take(self) -> None:
        received = self.link.receive()
        if received is None:
            return
        if received[17] < INDICES:
            if self.repeats and len(self.history) == INDICES:
                self.waiting.append(self.history[0])
            self.history.append(received)
        self.waiting.append(received)

    def wait(self, _, deadline, wake_on_frame) -> int:
        return (
            1 if wake_on_frame and self.waiting else self.link.wait_until(deadline, wake_on_frame)
        )

    def open_link(self) -> RepeatingLink:
        return self

    def close(self) -> None:
        self.link.close()


def false_steps(segment: Segment, links: list[RepeatingLink], **options: bool) -> tuple[int, list]:
    """Move for 3 s while frames are repeated.

    Returns the cycles in which the actual position was implausibly far from the target, and the
    events.
    """
    false = 0
    with cat.MainDevice(*links) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20)
        with cat.Loop(arm, **grouped(options)) as loop:
            home = arm.actual.position.copy()
            for cycle in loop:
                arm.target.position[:] = home + 0.5 * cycle.time
                for link in links:
                    link.repeats = cycle.number > 500
                behind = np.abs(arm.actual.position - home - 0.5 * cycle.time)
                false += bool(cycle.number > 200 and behind.max() > 0.03)
                if cycle.number == 3000:
                    break
        return false, [e for e in main.events if isinstance(e, DuplicateFrames)]


def segment_of(*, ring: bool = False) -> Segment:
    return Segment([Coupler(), Servo(serial=1), Servo(serial=2)], ring=ring)


def test_repeated_frames_are_reported_as_an_event() -> None:
    segment = segment_of()
    false, told = false_steps(segment, [RepeatingLink(segment.open_link())])
    assert false > 2000
    [event] = told
    assert event.count >= 400
    assert "loop in the wiring" in event.message


def test_exact_matching_accepts_no_repeated_frame() -> None:
    segment = segment_of()
    links = [RepeatingLink(segment.open_link())]
    false, told = false_steps(segment, links, exact_matching=True)
    assert false == 0
    assert len(told) == 1


@pytest.mark.parametrize("exact", [False, True])
def test_repeated_frames_in_a_ring(exact: bool) -> None:
    segment = segment_of(ring=True)
    links = [RepeatingLink(end.open_link()) for end in (segment.first, segment.second)]
    for link in links:
        link.table.flags = 1 | 16  # virtual time; the ring requests the next arrival
        link.table.due = NOW(lambda _, link=link: due_of(link))
    false, told = false_steps(segment, links, exact_matching=exact)
    assert (false == 0) == exact
    assert len(told) == 1


def due_of(link: RepeatingLink) -> int:
    table = table_in(link.link.capsule)
    return table.now(table.self) if link.waiting else table.due(table.self)


def test_the_plan_prints_the_cost_of_exact_matching() -> None:
    with cat.MainDevice(segment_of()) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20)
        with cat.Loop(arm, scheduling=cat.Scheduling(exact_matching=True)) as loop:
            text = str(loop.plan)
    assert "exact matching: a cycle number in each frame; 16 bytes and 1.28 us of wire" in text
    assert "NOP  4 bytes" in text
