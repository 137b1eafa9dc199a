"""Response-time analysis: published examples, limits, and comparison with the simulation."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.realtime import Demand, Task, Tasks, VirtualClock, analyse
from tests.realtime.bodies import spend

MS = 1e-3


def responses(*demands: Demand) -> list[float | None]:
    """Return the responses [ms] in the given order."""
    found = {response.name: response.response for response in analyse(demands).responses}
    times = [found[demand.name] for demand in demands]
    return [None if time is None else round(time / MS, 6) for time in times]


def demand(name: str, period: float, execution: float, **more: float) -> Demand:
    """Return a demand with times in [ms]."""
    given = {
        key: value if key in ("priority", "cpu") else value * MS for key, value in more.items()
    }
    return Demand(name=name, period=period * MS, execution=execution * MS, **given)


def test_the_published_example():
    """Python real-time tasks on RT-Preempt: shared/facts/reference_tables.md, section 3."""
    verdict = analyse(
        [
            demand("tau1", 10, 3, priority=3),
            demand("tau2", 20, 5, priority=2),
            demand("tau3", 40, 10, priority=1),
        ]
    )
    assert [one.response for one in verdict.responses] == [3 * MS, 8 * MS, 29 * MS]
    assert verdict.schedulable
    assert verdict.utilisation == pytest.approx(0.8)
    assert verdict.hyperperiod == 40 * MS


def test_a_deadline_longer_than_the_period():
    """Lehoczky 1990: 26/70 and 62/100; the third job of the busy period responds last: 118."""
    assert responses(
        demand("a", 70, 26, priority=2), demand("b", 100, 62, priority=1, deadline=120)
    ) == [26, 118]


def test_blocking_is_added_once():
    assert responses(
        demand("a", 10, 3, priority=2, blocking=2), demand("b", 20, 5, priority=1)
    ) == [5, 8]


def test_jitter_of_a_higher_priority():
    """Two jobs of `a` are released at 4 (late) and 5, in a window of 6."""
    assert responses(demand("a", 5, 1, priority=2, jitter=4), demand("b", 20, 2, priority=1)) == [
        5,
        4,
    ]


def test_own_jitter_is_part_of_the_response():
    assert responses(demand("a", 10, 3, jitter=1.5)) == [4.5]


def test_a_deadline_shorter_than_the_period():
    late = analyse([demand("a", 10, 3, priority=2), demand("b", 20, 5, priority=1, deadline=7.999)])
    assert [one.in_time for one in late.responses] == [True, False]
    assert not late.schedulable


def test_a_response_equal_to_the_deadline_is_in_time():
    assert analyse([demand("a", 10, 3, priority=2), demand("b", 20, 5, priority=1, deadline=8)])


def test_equal_priorities_delay_each_other():
    assert responses(demand("a", 10, 3, priority=1), demand("b", 10, 4, priority=1)) == [7, 7]


def test_full_load_has_a_bound():
    assert responses(demand("a", 2, 1, priority=2), demand("b", 4, 2, priority=1)) == [1, 4]


def test_full_load_with_blocking_has_a_bound():
    assert responses(
        demand("a", 2, 1, priority=2), demand("b", 4, 2, priority=1, blocking=1, deadline=9)
    ) == [1, 6]


def test_overload_has_no_bound():
    assert responses(demand("a", 2, 1, priority=2), demand("b", 4, 2.001, priority=1)) == [1, None]


def test_default_priorities_are_deadline_monotonic():
    verdict = analyse([demand("slow", 20, 1), demand("a", 50, 1, deadline=5), demand("b", 10, 1)])
    assert [(one.name, one.priority) for one in verdict.responses] == [
        ("a", 3),
        ("b", 2),
        ("slow", 1),
    ]


def test_processors_are_independent():
    assert responses(
        demand("a", 10, 6, priority=2, cpu=0),
        demand("b", 10, 6, priority=1, cpu=1),
        demand("c", 100, 6, priority=1, cpu=0),
    ) == [6, 6, 18]


@pytest.mark.parametrize(
    ("demands", "words"),
    [
        ([], "no tasks"),
        ([demand("a", 1, 0.1), demand("a", 2, 0.1)], "two tasks have the name 'a'"),
        ([demand("a", 1, 0.1, priority=1), demand("b", 2, 0.1)], "'b' has no priority"),
        ([demand("a", 1, 0.1, cpu=1), demand("b", 2, 0.1)], "'b' has no cpu"),
    ],
)
def test_refuses(demands, words):
    with pytest.raises(ValueError, match=words):
        analyse(demands)


@pytest.mark.parametrize(
    "wrong",
    [
        {"period": 0.0},
        {"period": -1.0},
        {"period": math.nan},
        {"period": 1e300},
        {"deadline": 0.0},
        {"execution": -1.0},
        {"execution": math.inf},
        {"blocking": -1.0},
        {"jitter": -1.0},
    ],
)
def test_refuses_invalid_times(wrong):
    with pytest.raises(ValueError, match=f"task 'a': .*{next(iter(wrong))}"):
        Demand(**({"name": "a", "period": 1.0, "execution": 0.1} | wrong))


def test_a_hyperperiod_beyond_the_range_of_a_float_is_infinite():
    odd = [Demand(name=str(n), period=1 + n * 1e-9, execution=1e-3) for n in range(1, 90)]
    verdict = analyse(odd)
    assert verdict.hyperperiod == math.inf
    assert verdict.schedulable


def test_verdict_as_text():
    text = str(analyse([demand("a", 2, 1, priority=2), demand("b", 4, 3, priority=1)]))
    assert text.splitlines()[1].split() == ["a", "2", "2.000", "1.000", "2.000", "1.000"]
    assert text.splitlines()[2].split()[-2:] == ["unbounded", "MISSED"]
    assert text.splitlines()[3] == "NOT schedulable: utilisation 125.0%, hyperperiod 4 ms"


@st.composite
def task_sets(draw: st.DrawFn) -> list[Demand]:
    """Generate task sets with a load below 1 and deadlines up to twice the period."""
    periods = draw(st.lists(st.sampled_from([4, 5, 6, 8, 10, 12, 20]), min_size=1, max_size=4))
    demands = []
    for number, period in enumerate(periods):
        share = draw(st.floats(0.02, 1.0)) / len(periods)
        execution = max(
            math.floor(period * share * 1e3) / 1e3, 0.001
        )  # rounded down, so that the load is at most 1
        priority = draw(st.integers(1, 4))
        demands.append(
            demand(str(number), period, execution, priority=priority, deadline=2 * period)
        )
    return demands


def simulate(demands: list[Demand], seconds: float) -> dict[str, float]:
    """Return the longest simulated responses of tasks released together on one processor."""
    tasks = [
        Task(
            spend,
            (one.execution,),
            name=one.name,
            period=one.period,
            priority=one.priority,
            deadline=one.deadline,
        )
        for one in demands
    ]
    with VirtualClock() as clock, Tasks(*tasks, workers="threads", clock=clock) as running:
        running.join(seconds)
        return {handle.name: handle.statistics.response.max for handle in running}


@given(task_sets())
@settings(max_examples=25)
def test_the_analysis_bounds_the_simulation(demands):
    verdict = analyse(demands)
    simulated = simulate(demands, 2 * verdict.hyperperiod)
    for one in verdict.responses:
        assert one.response is not None
        assert simulated[one.name] <= one.response + 1e-12


@given(task_sets())
@settings(max_examples=25)
def test_a_common_release_is_the_worst_case(demands):
    """If priorities differ, the critical instant is the first release, Liu and Layland 1973."""
    apart = [
        Demand(
            name=one.name,
            period=one.period,
            execution=one.execution,
            deadline=one.deadline,
            priority=10 + number,
        )
        for number, one in enumerate(demands)
    ]
    verdict = analyse(apart)
    simulated = simulate(apart, 2 * verdict.hyperperiod)
    for one in verdict.responses:
        assert simulated[one.name] == pytest.approx(one.response, abs=1e-9)
