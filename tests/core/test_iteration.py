"""Iteration and its Cycle; busy-wait before the cycle start."""

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

BUSY_WAIT = 60_000  # [ns]


def started(link: TickingLink, **more: object) -> Engine:
    engine = Engine(make_plan([axis(0)], execution="inline", priority=None, **more), link.capsule)
    engine.start()
    return engine


def ticking() -> TickingLink:
    return TickingLink(Segment([ScriptedDrive()]).answer)


def test_the_first_step_commits_nothing_and_time_counts_from_it() -> None:
    b = bench(axis(0), execution="inline")
    b.steps(3)
    iteration = Iteration(b.engine, lambda flags: None, trouble=0, al_status=b.engine.al_status)
    cycle = next(iteration)
    assert (cycle.number, cycle.time, cycle.ok, cycle.late) == (0, 0.0, True, False)
    assert next(iteration) is cycle
    assert cycle.number == 1
    assert cycle.time == pytest.approx(PERIOD * 1e-9)
    assert iter(iteration) is iteration


def test_the_first_iteration_is_the_zero_of_times() -> None:
    b = bench(axis(0), execution="inline")
    b.steps(3)
    assert b.engine.zero_ns == 0
    next(Iteration(b.engine, lambda flags: None, trouble=0, al_status=b.engine.al_status))
    assert b.engine.zero_ns == b.engine.origin + 3 * PERIOD
    next(Iteration(b.engine, lambda flags: None, trouble=0, al_status=b.engine.al_status))
    assert b.engine.zero_ns == b.engine.origin + 3 * PERIOD


def test_trouble_and_a_wrong_al_state_are_judged() -> None:
    b = bench(axis(0), execution="inline")
    b.steps(1)
    judged: list[int] = []
    right = b.engine.al_status
    next(Iteration(b.engine, judged.append, trouble=CYCLE_WORKING_COUNTER, al_status=right))
    assert judged == []
    next(Iteration(b.engine, judged.append, trouble=CYCLE_OK, al_status=right))
    next(Iteration(b.engine, judged.append, trouble=0, al_status=right + 1))
    assert len(judged) == 2


def test_what_the_judge_raises_ends_the_iteration() -> None:
    b = bench(axis(0), execution="inline")

    def judge(flags: int) -> None:
        raise LookupError("judged")

    with pytest.raises(LookupError, match="judged"):
        next(Iteration(b.engine, judge, trouble=CYCLE_OK, al_status=-1))


def test_a_busy_wait_begins_before_the_cycle_start_and_ends_at_it() -> None:
    link = ticking()
    engine = started(link, busy_wait_ns=BUSY_WAIT)
    engine.next()
    engine.next()
    starts = [link.waits[-2] + BUSY_WAIT, link.waits[-1] + BUSY_WAIT]
    assert starts[1] - starts[0] == PERIOD
    lateness = engine.histograms()["lateness"]
    assert 0 <= lateness["max"] <= 2 * TICK * 1e-9
    engine.stop()


def test_virtual_time_has_no_busy_wait() -> None:
    b = bench(axis(0), execution="inline", busy_wait_ns=BUSY_WAIT)
    b.steps(2)
    assert b.link.waits == [PERIOD, 2 * PERIOD]


@pytest.mark.parametrize("busy_wait", [-1, PERIOD, MS * 1000])
def test_a_busy_wait_as_long_as_the_period_is_refused(busy_wait: int) -> None:
    with pytest.raises(ValueError, match="busy_wait_ns"):
        started(ticking(), busy_wait_ns=busy_wait)


class Mover:
    """Notes when it is stepped; leaves the list after two steps."""

    def __init__(self, movers: list["Mover"]) -> None:
        self.movers = movers
        self.times: list[float] = []

    def step(self, now: float) -> None:
        self.times.append(now)
        if len(self.times) == 2:
            self.movers.remove(self)


def test_movers_are_stepped_before_every_commit_with_the_time_of_the_cycle() -> None:
    b = bench(axis(0))
    movers: list[Mover] = []
    iteration = Iteration(
        b.engine, lambda flags: None, trouble=0, al_status=b.engine.al_status, movers=movers
    )
    next(iteration)
    first, second = Mover(movers), Mover(movers)
    movers += [first, second]
    for _ in range(4):
        next(iteration)
    assert first.times == second.times == pytest.approx([0.0, PERIOD * 1e-9])
