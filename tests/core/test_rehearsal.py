"""In the lead the way of a cycle is gone once without effect: nothing of it reaches the devices."""

from __future__ import annotations

import math

import pytest

from catenary.core import AXIS_DROPPED, AXIS_FOLLOWED, GOAL_ENABLED, Engine
from catenary.plan.cycle import AxisLimits
from tests.core.rig import CST, MS, Bench, TickingLink, axis, make_plan
from tests.core.test_law import Frame, make_law

LEAD = 200_000  # [ns]
CYCLES = 30
LIMITS = AxisLimits(position_min=-0.05, position_max=0.05, velocity=20.0, torque=2.0)


def running(lead_ns: int, *, mode: int = 8) -> Bench:
    """Inline on a link with a clock of its own, asked to enable."""
    axes = [axis(k, mode=mode, limits=LIMITS, torque_slope=100.0) for k in range(2)]
    plan = make_plan(axes, order="inline", priority=None, lead_ns=lead_ns)
    b = Bench(plan, link_type=TickingLink)
    b.ask(GOAL_ENABLED)
    b.engine.run(10)
    return b


def frames_of(lead_ns: int) -> tuple[list[bytes], Engine]:
    """What is sent while targets come, run into limits, are no numbers, and stay away."""
    b = running(lead_ns)
    before = len(b.link.sent)
    for k in range(CYCLES):
        b.target_position[:] = 0.1 * math.sin(0.2 * k)
        if k == 12:
            b.target_position[1] = math.nan
        if k == 20:
            b.goal[:] = 0
            b.request[:] += 1
        b.engine.next()
    rehearsed = [count for count in b.link.rehearsals if count >= before]
    assert len(rehearsed) >= CYCLES - 1 if lead_ns else not rehearsed
    sent = b.link.sent[before:]
    b.engine.stop()
    return sent, b.engine


def test_the_same_frames_are_sent_with_a_lead_and_without() -> None:
    with_lead, one = frames_of(LEAD)
    without, other = frames_of(0)
    assert len(set(without)) > CYCLES // 2  # they do differ from one another
    assert with_lead == without
    counted = ("lost", "uncommitted")
    assert [one.counters[name] for name in counted] == [other.counters[name] for name in counted]


@pytest.mark.parametrize("lead_ns", [0, LEAD])
def test_a_law_that_counts_its_steps_in_its_memory_counts_cycles(lead_ns: int) -> None:
    b = running(lead_ns, mode=CST)
    steps = 0

    def count(frame: Frame) -> int:
        nonlocal steps
        steps += 1
        frame.memory[0] += 1.0
        frame.target["torque"][0] = 0.001 * frame.memory[0]
        return 0

    b.segment.delay = MS - LEAD // 2  # some frames come late: it computes at the instant
    law = make_law(b, count, memory=[0.0])
    b.engine.start_law(law)
    b.steps(10)
    counted = law.figures["steps"]
    assert list(law.memory) == [counted]
    assert 8 <= counted <= 10
    assert (steps > counted) == bool(lead_ns)  # rehearsed as well
    b.engine.stop()


def test_a_law_too_long_for_the_lead_is_not_rehearsed() -> None:
    b = running(LEAD, mode=CST)
    b.segment.delay = MS - LEAD // 2  # some frames come late: it computes at the instant
    steps = 0

    def slow(_: Frame) -> int:
        nonlocal steps
        steps += 1
        b.link.time += MS // 5
        return 0

    law = make_law(b, slow)
    b.engine.start_law(law)
    b.steps(10)
    counted = law.figures["steps"]
    assert 8 <= counted <= steps <= counted + 1  # before the first step nobody knows
    b.engine.stop()


@pytest.mark.parametrize("lead_ns", [0, LEAD])
@pytest.mark.parametrize("lost", ["the device", "the frame"])
def test_what_stays_away_is_missed_once_a_cycle(lost: str, lead_ns: int) -> None:
    b = running(lead_ns)
    if lost == "the device":
        b.segment.silent.add(0)
    else:
        b.segment.spoil = lambda back: []
    b.steps(2)
    assert b.axis_flags[0] & AXIS_FOLLOWED  # two in a row, of a limit of three: bridged
    b.steps(1)
    assert b.axis_flags[0] & (AXIS_FOLLOWED | AXIS_DROPPED) == AXIS_DROPPED
    b.engine.stop()


@pytest.mark.parametrize("delay", [MS // 10, MS - LEAD // 2], ids=["before", "within"])
def test_inputs_are_those_of_the_cycle_whether_they_come_before_the_lead_or_within(
    delay: int,
) -> None:
    seen = {}
    for lead_ns in (0, LEAD):
        b = running(lead_ns, mode=CST)
        b.segment.delay = delay
        b.steps(2)
        positions = []
        for k in range(CYCLES):
            b.drives[0].position = 10 * k * k
            b.drives[0].velocity = k
            b.steps(1)
            positions.append((b.actual_position[0], b.actual_velocity[0], b.statusword[0]))
        assert b.engine.counters["lost"] == 0
        seen[lead_ns] = positions
        b.engine.stop()
    assert len(set(seen[0])) == CYCLES
    assert seen[LEAD] == seen[0]
