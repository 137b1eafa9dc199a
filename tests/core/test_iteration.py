"""Iteration and its Cycle; the lead of an inline cycle."""

import pytest

from catenary.core import CYCLE_OK, CYCLE_WORKING_COUNTER, Engine, Iteration
from tests.core.rig import (
    MS,
    PERIOD,
    TICK,
    ScriptedDrive,
    Segment,
    TickingLink,
    axis,
    bench,
    make_plan,
)

LEAD = 60_000  # [ns]


def started(link: TickingLink, **more: object) -> Engine:
    engine = Engine(make_plan([axis(0)], order="inline", priority=None, **more), link.capsule)
    engine.start()
    return engine


def ticking() -> TickingLink:
    return TickingLink(Segment([ScriptedDrive()]).answer)


def test_the_first_step_commits_nothing_and_time_counts_from_it() -> None:
    b = bench(axis(0), order="inline")
    b.steps(3)
    iteration = Iteration(b.engine, lambda flags: None, trouble=0, al_status=b.engine.al_status)
    cycle = next(iteration)
    assert (cycle.number, cycle.time, cycle.ok, cycle.late) == (0, 0.0, True, False)
    assert next(iteration) is cycle
    assert cycle.number == 1
    assert cycle.time == pytest.approx(PERIOD * 1e-9)
    assert iter(iteration) is iteration


def test_trouble_and_a_wrong_al_state_are_judged() -> None:
    b = bench(axis(0), order="inline")
    b.steps(1)
    judged: list[int] = []
    right = b.engine.al_status
    next(Iteration(b.engine, judged.append, trouble=CYCLE_WORKING_COUNTER, al_status=right))
    assert judged == []
    next(Iteration(b.engine, judged.append, trouble=CYCLE_OK, al_status=right))
    next(Iteration(b.engine, judged.append, trouble=0, al_status=right + 1))
    assert len(judged) == 2


def test_what_the_judge_raises_ends_the_iteration() -> None:
    b = bench(axis(0), order="inline")

    def judge(flags: int) -> None:
        raise LookupError("judged")

    with pytest.raises(LookupError, match="judged"):
        next(Iteration(b.engine, judge, trouble=CYCLE_OK, al_status=-1))


def test_in_the_lead_the_thread_is_awake_and_rehearses_before_the_instant() -> None:
    link = ticking()
    engine = started(link, lead_ns=LEAD)
    rehearsed: list[int] = []
    engine.set_rehearsal(lambda: rehearsed.append(link.time))
    engine.next()
    engine.next()
    instants = [link.waits[-2] + LEAD, link.waits[-1] + LEAD]
    assert instants[1] - instants[0] == PERIOD  # it sleeps until the lead begins
    assert all(0 < at - seen < LEAD for at, seen in zip(instants, rehearsed, strict=True))
    lateness = engine.histograms()["lateness"]
    assert 0 <= lateness["max"] <= 2 * TICK * 1e-3
    engine.stop()


def test_woken_late_it_does_not_rehearse() -> None:
    link = ticking()
    engine = started(link, lead_ns=LEAD)
    rehearsed: list[int] = []
    engine.set_rehearsal(lambda: rehearsed.append(link.time))
    wait = link.table_wait_until

    def oversleep(_, deadline: int, wake_on_frame: int) -> int:
        return wait(_, deadline + LEAD - 10 * TICK, wake_on_frame)

    link.table.wait_until = type(link.table.wait_until)(oversleep)
    engine.next()
    engine.next()  # figures come with the outputs
    assert rehearsed == []
    assert engine.histograms()["lateness"]["max"] <= 2 * TICK * 1e-3
    engine.stop()


def test_what_the_rehearsal_raises_comes_out_and_the_engine_goes_on() -> None:
    engine = started(ticking(), lead_ns=LEAD)

    def interrupted() -> None:
        raise KeyboardInterrupt

    engine.set_rehearsal(interrupted)
    with pytest.raises(KeyboardInterrupt):
        engine.next()
    engine.set_rehearsal(None)
    assert engine.next() & CYCLE_OK
    engine.stop()


def test_virtual_time_has_no_lead() -> None:
    b = bench(axis(0), order="inline", lead_ns=LEAD)
    b.steps(2)
    assert b.link.waits == [PERIOD, 2 * PERIOD]


@pytest.mark.parametrize("lead", [-1, PERIOD, MS * 1000])
def test_a_lead_as_long_as_the_period_is_refused(lead: int) -> None:
    with pytest.raises(ValueError, match="lead_ns"):
        started(ticking(), lead_ns=lead)
