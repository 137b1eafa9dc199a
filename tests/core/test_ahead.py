"""A law computes ahead of its instant where its inputs are all there: the same outputs a cycle,
only their frames are left to go at the instant, and a stop does not wait."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from catenary.core import (
    CYCLE_AHEAD,
    CYCLE_LAW_DONE,
    CYCLE_LAW_FAILED,
    GOAL_DISABLED,
    GOAL_ENABLED,
    GOAL_QUICK_STOP,
    GOAL_RESET,
    LAW_FINISHED,
    LAW_NOT_FINITE,
    RECORD_FIELDS,
)
from tests.core.rig import CSP, CST, MS, Bench, TickingLink, axis, make_plan
from tests.core.test_law import Frame, make_law

LEAD = 200_000  # [ns]
CYCLES = 20
QUICK_STOP = 0x0002  # controlwords
ENABLED = 0x000F
RESET_BIT = 0x0080
SWITCHED_ON, FAULT = 3, 7  # states


def running(lead_ns: int, *, mode: int = CSP, order: str = "inline") -> Bench:
    """On a link with a clock of its own, enabled."""
    axes = [axis(k, mode=mode, torque_slope=100.0) for k in range(2)]
    plan = make_plan(axes, order=order, priority=None, lead_ns=lead_ns)
    b = Bench(plan, link_type=TickingLink)
    b.ask(GOAL_ENABLED)
    b.engine.run(10)
    return b


def sway(frame: Frame) -> int:
    """What depends on the inputs, on time and on its memory."""
    frame.memory[0] += 1.0
    frame.target["position"][0] = 0.9 * frame.actual["position"][0] + 0.01 * frame.memory[0]
    frame.target["position"][1] = math.sin(50 * frame.time)
    return 0


def ahead(b: Bench) -> list[bool]:
    log = np.frombuffer(b.engine.log(), np.dtype(RECORD_FIELDS))
    return list(log["flags"] & CYCLE_AHEAD != 0)


def outputs(frames: list[bytes]) -> list[tuple[int, int]]:
    """Controlword and target position of drive 0: behind the BRD's 14 bytes."""
    found = []
    for frame in frames:
        data = frame[16 + 14 + 10 :]
        found.append(
            (
                int.from_bytes(data[0:2], "little"),
                int.from_bytes(data[7:11], "little", signed=True),
            )
        )
    return found


@pytest.mark.parametrize("delay", [MS // 10, MS - LEAD // 2], ids=["all there", "some late"])
def test_the_same_frames_are_sent_ahead_or_at_the_instant(delay: int) -> None:
    sent = {}
    for lead_ns in (0, LEAD):
        b = running(lead_ns)
        b.segment.delay = delay
        b.engine.start_law(make_law(b, sway, memory=[0.0]))
        b.steps(CYCLES)
        sent[lead_ns] = b.link.sent[-CYCLES:]
        early = ahead(b)[-CYCLES + 3 :]
        assert all(early) if lead_ns and delay < MS // 2 else not any(early)
        b.engine.stop()
    assert len(set(sent[0])) == CYCLES
    assert sent[LEAD] == sent[0]


@pytest.mark.parametrize("asks", ["the loop", "the application"])
def test_a_stop_between_lead_and_instant_is_in_the_frame_of_that_instant(asks: str) -> None:
    b = running(LEAD, order="threaded")  # its own thread: an application may speak at any time
    b.engine.start_law(make_law(b, sway, memory=[0.0]))
    b.steps(5)
    asked: list[int] = []

    def stop_here(sent: int) -> None:  # the last thing in the lead
        if asked:
            return
        asked.append(sent)
        if asks == "the loop":
            b.engine.quick_stop_all()
        else:
            b.ask(GOAL_QUICK_STOP)
            b.engine.commit_targets()

    b.link.on_rehearsal = stop_here
    until_sent(b, asked, 2)
    b.engine.stop()
    assert all(ahead(b)[-5:-1])
    around = b.link.sent[asked[0] - 1 : asked[0] + 1]
    assert [word for word, _ in outputs(around)] == [ENABLED, QUICK_STOP]


WHERE = pytest.mark.parametrize(
    "delay", [MS // 10, MS - LEAD // 2], ids=["ahead", "at the instant"]
)


def in_the_lead(b: Bench, when: Callable[[], bool], say: Callable[[], None]) -> list[int]:
    """`say` and commit once, behind what was computed ahead; how many frames were sent before."""
    said: list[int] = []

    def hook(sent: int) -> None:
        if not said and when():
            said.append(sent)
            say()
            b.engine.commit_targets()

    b.link.on_rehearsal = hook
    return said


def until_sent(b: Bench, said: list[int], frames: int) -> None:
    """So many frames after it was said."""
    for _ in range(100):
        if said and len(b.link.sent) >= said[0] + frames:
            return
        b.steps(1)
    raise AssertionError(f"said {said}, {len(b.link.sent)} frames sent")


def ask(b: Bench, drive: int, goal: int) -> None:
    b.goal[drive] = goal
    b.request[drive] += 1


@WHERE
def test_a_law_that_fails_stops_the_drives_before_a_new_request_is_heard(delay: int) -> None:
    b = running(LEAD, order="threaded")
    b.segment.delay = delay

    failed: list[float] = []

    def fails(frame: Frame) -> int:  # where it computes at the instant, as a rehearsal first
        frame.memory[0] += 1.0
        if frame.memory[0] < 8.0:
            return 0
        failed.append(frame.time)
        return -1

    said = in_the_lead(b, lambda: bool(failed), lambda: b.ask(GOAL_ENABLED))
    b.engine.start_law(make_law(b, fails, memory=[0.0]))
    until_sent(b, said, 4)
    b.engine.stop()
    assert QUICK_STOP in [word for word, _ in outputs(b.link.sent[said[0] - 1 : said[0] + 4])]


@WHERE
def test_the_edge_of_a_fault_reset_outlives_what_is_asked_of_others(delay: int) -> None:
    b = running(LEAD, order="threaded")
    b.segment.delay = delay
    b.engine.start_law(make_law(b, lambda _: 0))
    b.steps(5)
    b.drives[0].state = FAULT
    b.drives[0].after = lambda before: FAULT  # it stays
    b.steps(3)
    ask(b, 0, GOAL_RESET)
    b.steps(6)
    taken = len(b.link.sent)
    said = in_the_lead(b, lambda: len(b.link.sent) > taken + 2, lambda: ask(b, 1, GOAL_DISABLED))
    ask(b, 0, GOAL_RESET)
    b.engine.commit_targets()
    until_sent(b, said, 4)
    b.engine.stop()
    words = [word for word, _ in outputs(b.link.sent[taken - 1 :])]
    assert any(word & RESET_BIT == 0 for word in words)
    assert words[-1] & RESET_BIT


def test_the_torque_is_there_before_the_brake_opens() -> None:
    b = running(LEAD, mode=CST, order="threaded")

    def push(frame: Frame) -> int:
        frame.target["torque"][0] = 0.1
        return 0

    b.engine.start_law(make_law(b, push))
    b.steps(8)
    ask(b, 0, GOAL_DISABLED)
    said = in_the_lead(b, lambda: b.drives[0].state == SWITCHED_ON, lambda: ask(b, 0, GOAL_ENABLED))
    until_sent(b, said, 6)
    b.engine.stop()
    enabling = [
        int.from_bytes(frame[16 + 14 + 10 + 11 :][:2], "little", signed=True)
        for frame in b.link.sent[said[0] :]
        if outputs([frame])[0][0] & ENABLED == ENABLED
    ]
    assert enabling
    assert enabling[0] == 100  # counts of 0.001 N·m


def test_control_bits_do_not_wait_for_the_next_cycle() -> None:
    b = running(LEAD, order="threaded")
    b.engine.start_law(make_law(b, lambda _: 0))
    b.steps(5)

    def pulse() -> None:
        b.controlword_bits[0] = 0x10

    said = in_the_lead(b, lambda: True, pulse)
    until_sent(b, said, 2)
    b.engine.stop()
    around = b.link.sent[said[0] - 1 : said[0] + 1]
    assert [word for word, _ in outputs(around)] == [ENABLED, ENABLED | 0x10]


def test_a_law_that_is_slow_after_a_sleep_is_computed_ahead_all_the_same() -> None:
    b = running(LEAD)

    def long(_: Frame) -> int:
        b.link.time += 3 * LEAD // 4
        return 0

    b.engine.start_law(make_law(b, long))
    b.steps(CYCLES)
    log = np.frombuffer(b.engine.log(), np.dtype(RECORD_FIELDS))[-CYCLES + 2 :]
    assert all(log["flags"] & CYCLE_AHEAD)
    assert max(log["lateness_ns"] + log["send_ns"]) < LEAD // 2
    b.engine.stop()


def test_what_a_law_that_fails_ahead_has_written_is_not_sent() -> None:
    b = running(LEAD)

    def fails(frame: Frame) -> int:
        frame.memory[0] += 1.0
        frame.target["position"][0] = 0.001
        if frame.memory[0] == 6.0:
            frame.target["position"][0] = 0.5
            frame.target["position"][1] = math.nan
        return 0

    law = make_law(b, fails, memory=[0.0])
    b.engine.start_law(law)
    flags, before = 0, len(b.link.sent)
    while not flags & CYCLE_LAW_FAILED:
        assert len(b.link.sent) < before + 10
        flags = b.engine.next()
    assert ahead(b)[-1]
    assert (law.status, law.axis) == (LAW_NOT_FINITE, 1)
    assert [word for word, _ in outputs(b.link.sent[-2:])] == [ENABLED, QUICK_STOP]
    b.steps(3)
    assert 500 not in [position for _, position in outputs(b.link.sent[-10:])]  # counts of 0.5 rad
    b.engine.stop()


def test_the_last_targets_of_a_law_that_finishes_ahead_are_sent_at_its_instant() -> None:
    b = running(LEAD, mode=CST)

    def finishes(frame: Frame) -> int:
        frame.memory[0] += 1.0
        frame.target["torque"][:] = 0.01 * frame.memory[0]
        return int(frame.memory[0] == 6.0)

    law = make_law(b, finishes, memory=[0.0])
    b.engine.start_law(law)
    done = 0
    while not b.engine.next() & CYCLE_LAW_DONE:
        done += 1
        assert done < 10
    assert law.status == LAW_FINISHED
    assert list(law.memory) == [6.0]
    assert ahead(b)[-1]
    torque = int.from_bytes(b.link.sent[-1][16 + 14 + 10 + 11 :][:2], "little", signed=True)
    assert torque == 60  # counts of 0.001 N·m
    assert np.isclose(b.drives[0].target_torque, 60)
    b.engine.stop()
