"""Laws in a loop with several networks: one law per network, each in its own cycle."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

import catenary as cat
from catenary.errors import LawError
from catenary.realtime import VirtualClock
from catenary.virtual import Coupler, Segment, Servo

pytest.importorskip("numba", reason="laws are compiled by Numba: pip install 'catenary[law]'")
COUNTS = 2**20
UPPER_AXES, LOWER_AXES = 3, 2


@contextmanager
def opened(clock: Any = None, **more: Any) -> Iterator[tuple[cat.Loop, cat.Drives, cat.Drives]]:
    """Open a loop over two networks with 3 and 2 axes."""
    with VirtualClock() as shared:
        segments = make_segments(clock or shared)
        with opened_on(segments, **more) as opened_loop:
            yield opened_loop


def make_segments(clock: Any) -> list[Segment]:
    return [
        Segment([Coupler(), *(Servo() for _ in range(axes))], clock=clock)
        for axes in (UPPER_AXES, LOWER_AXES)
    ]


@contextmanager
def opened_on(
    segments: list[Segment], **more: Any
) -> Iterator[tuple[cat.Loop, cat.Drives, cat.Drives]]:
    with cat.MainDevice(segments[0]) as first, cat.MainDevice(segments[1]) as second:
        upper, lower = (
            cat.Drives(main.scan().drives, counts_per_turn=COUNTS, velocity_limit=100.0)
            for main in (first, second)
        )
        with cat.Loop(upper, lower, **{"period": 1e-3, **more}) as loop:
            yield loop, upper, lower


@contextmanager
def one_is_enough() -> Iterator[tuple[Segment, cat.Loop, cat.Drives, cat.Drives]]:
    """Open a loop that continues without one network; also yield the first segment."""
    with VirtualClock() as clock:
        segments = make_segments(clock)
        with opened_on(segments, scheduling=cat.Scheduling(quorum=1)) as (loop, upper, lower):
            yield segments[0], loop, upper, lower


@cat.law
def follow(actual, target, memory, parameters):
    for i in range(actual.n):
        target.position[i] += parameters[0]
    memory[0] += 1.0


@cat.law
def finish(actual, target, memory, time):
    memory[0] = actual.n
    return time > 0.05


@cat.law
def spoil(actual, target, memory, time):
    if time > 0.02:
        target.position[0] = np.nan


@cat.law
def answered(memory, ok):
    memory[0] += 1.0
    if not ok:
        memory[1] += 1.0


@cat.law
def spoil_unanswered(target, memory, ok):
    if not ok:
        memory[0] += 1.0
    if memory[0] > 200.0:
        target.position[0] = np.nan


@cat.law
def lines(actual, target, memory, time):
    if time > 0.02:
        memory[actual.n + 7] = 1.0


@cat.law
def deviation(actual, memory):
    memory[0] = actual["following_error"][0]


def iterate(loop: cat.Loop, seconds: float) -> None:
    """Run the loop for a time, without targets of Python."""
    begun = None
    for cycle in loop:
        begun = cycle.time if begun is None else begun
        if cycle.time - begun > seconds:
            return


def test_each_network_runs_its_own_law_at_the_same_time() -> None:
    with opened(laws=[follow]) as (loop, upper, lower):
        homes = upper.actual.position.copy(), lower.actual.position.copy()
        above = loop.start(follow, memory=[0.0], parameters=[1e-4], network=0)
        below = loop.start(follow, memory=[0.0], parameters=[-2e-4], network=1)
        iterate(loop, 0.5)
        assert above.running
        assert below.running
        assert above.steps == pytest.approx(500, abs=3)
        assert abs(above.steps - below.steps) <= 1
        assert upper.actual.position == pytest.approx(homes[0] + 0.05, abs=2e-3)
        assert lower.actual.position == pytest.approx(homes[1] - 0.1, abs=2e-3)
        assert all(network.timing.counters["lost"] == 0 for network in loop.networks)
        assert all(network.timing.counters["late"] == 0 for network in loop.networks)


def test_python_sets_the_other_network_while_one_has_a_law() -> None:
    with opened() as (loop, upper, lower):
        homes = upper.actual.position.copy(), lower.actual.position.copy()
        run = loop.start(follow, memory=[0.0], parameters=[1e-4], network=1)
        for cycle in loop:
            upper.target.position[:] = homes[0] + 0.2 * cycle.time
            if cycle.number == 100:
                run.parameters = [0.0]
            if cycle.time > 0.5:
                break
        assert upper.actual.position == pytest.approx(homes[0] + 0.1, abs=2e-3)
        assert lower.actual.position == pytest.approx(homes[1] + 0.01, abs=2e-3)
        assert run.memory[0] == run.steps


@pytest.mark.parametrize("compiled", [True, False])
def test_run_returns_the_memory_of_the_law_of_one_network(compiled: bool) -> None:
    with opened() as (loop, upper, lower):
        for network, axes in enumerate((UPPER_AXES, LOWER_AXES)):
            memory = loop.run(finish, memory=[0.0], network=network, compiled=compiled)
            assert memory.tolist() == [axes]
        iterate(loop, 0.05)
        assert upper.enabled.all()
        assert lower.enabled.all()


def test_the_other_network_holds_while_a_law_runs_to_its_end() -> None:
    with opened() as (loop, _, lower):
        home = lower.actual.position.copy()
        other = loop.start(follow, memory=[0.0], parameters=[1e-4], network=1)
        loop.run(finish, memory=[0.0], network=0)
        assert other.running
        assert other.steps == pytest.approx(51, abs=3)
        assert lower.target.position == pytest.approx(home + 1e-4 * other.steps, abs=1e-3)


def test_a_law_that_ends_leaves_its_network_to_python() -> None:
    with opened() as (loop, upper, lower):
        ended = loop.start(finish, memory=[0.0], network=0)
        goes_on = loop.start(follow, memory=[0.0], parameters=[1e-4], network=1)
        for cycle in loop:
            if not ended.running:
                upper.target.position[:] += 1e-4
            if cycle.time > 0.5:
                break
        assert goes_on.running
        assert upper.actual.position == pytest.approx(0.045, abs=5e-3)
        assert lower.actual.position == pytest.approx(0.05, abs=5e-3)


def test_a_law_that_is_stopped_does_not_end_the_other() -> None:
    with opened() as (loop, _, _):
        runs = [
            loop.start(follow, memory=[0.0], parameters=[0.0], network=network)
            for network in range(2)
        ]
        iterate(loop, 0.02)
        runs[0].stop()
        iterate(loop, 0.02)
        assert [run.running for run in runs] == [False, True]


@pytest.mark.parametrize("failing", [0, 1])
@pytest.mark.parametrize(("law", "said"), [(spoil, "NaN or infinity"), (lines, "exception")])
def test_a_failed_law_ends_the_loop_and_stops_both_networks(
    law: Callable, said: str, failing: int
) -> None:
    with opened() as (loop, upper, lower):
        loop.start(follow, memory=[0.0], parameters=[1e-4], network=1 - failing)
        loop.start(law, memory=[0.0], network=failing)
        with pytest.raises(LawError, match=said):
            iterate(loop, 1.0)
        iterate(loop, 0.3)
        assert not upper.enabled.any()
        assert not lower.enabled.any()


@pytest.mark.parametrize("call", ["start", "run"])
def test_a_quorum_does_not_excuse_a_failed_law(call: str) -> None:
    def spoil_one(loop: cat.Loop) -> None:
        if call == "run":
            loop.run(spoil, memory=[0.0], network=1)
        loop.start(spoil, memory=[0.0], network=1)
        iterate(loop, 1.0)

    with (
        one_is_enough() as (_, loop, _, _),
        pytest.raises(LawError, match="NaN"),
    ):
        spoil_one(loop)


def test_with_a_quorum_the_law_of_a_failed_network_continues() -> None:
    """It gets the last inputs and `ok` False. Its axes are enabled again only by a request."""
    with one_is_enough() as (segment, loop, upper, lower):
        runs = [
            loop.start(answered, memory=[0.0, 0.0], network=0),
            loop.start(follow, memory=[0.0], parameters=[1e-4], network=1),
        ]
        for cycle in loop:
            assert cycle.ok
            if cycle.number == 100:
                segment.unplug()
            if cycle.number == 500:
                assert not cycle.networks[0].ok
                segment.plug()
            if cycle.number == 800:
                break
        assert all(run.running for run in runs)
        assert runs[0].memory[0] > 700
        assert 200 < runs[0].memory[1] < 500
        assert not upper.enabled.any()
        assert lower.enabled.all()


def test_a_law_that_fails_in_a_failed_network_ends_the_loop() -> None:
    with one_is_enough() as (segment, loop, _, lower):
        loop.start(spoil_unanswered, memory=[0.0], network=0)
        iterate(loop, 0.1)
        segment.unplug()
        with pytest.raises(LawError, match="NaN"):
            iterate(loop, 1.0)
        iterate(loop, 0.3)
        assert not lower.enabled.any()
        segment.plug()


def test_a_loop_with_several_networks_needs_the_number_of_one() -> None:
    with opened() as (loop, _, _):
        for start in (loop.start, loop.run):
            with pytest.raises(ValueError, match="network=0 to network=1"):
                start(follow, memory=[0.0], parameters=[0.0])
            for wrong in (2, -1):
                with pytest.raises(ValueError, match=f"network={wrong}"):
                    start(follow, memory=[0.0], parameters=[0.0], network=wrong)
        with pytest.raises(ValueError, match="network=0 to network=1"):
            loop.stream()


def test_laws_may_be_given_for_each_network() -> None:
    with opened(laws=[[follow], [finish, follow]]) as (loop, _, _):
        for network in range(2):
            loop.start(follow, memory=[0.0], parameters=[0.0], network=network)
        iterate(loop, 0.01)


def test_a_law_that_does_not_fit_one_network_is_refused_with_its_number() -> None:
    with pytest.raises(LawError, match="following_error") as raised, opened(laws=[deviation]):
        pass
    assert any("network 0" in note for note in raised.value.__notes__)
    with pytest.raises(ValueError, match="laws: 3 lists for 2 networks"), opened(laws=[[], [], []]):
        pass
    with pytest.raises(TypeError, match="either laws or one list"), opened(laws=[follow, [follow]]):
        pass


def test_each_network_has_its_own_stream() -> None:
    with opened() as (loop, upper, lower):
        homes = upper.actual.position.copy(), lower.actual.position.copy()
        streams = [loop.stream(capacity=200, network=network) for network in range(2)]
        ramp = np.linspace(0.0, 0.01, 100)[:, None]
        for sign, home, stream in zip((1, -1), homes, streams, strict=True):
            assert stream.write(position=home + sign * ramp) == 100
        for cycle in loop:
            if cycle.number > 100:
                break
        for stream in streams:
            assert stream.taken == 100
            stream.close()
        iterate(loop, 0.05)
        assert upper.actual.position == pytest.approx(homes[0] + 0.01, abs=1e-3)
        assert lower.actual.position == pytest.approx(homes[1] - 0.01, abs=1e-3)


def test_each_law_runs_in_its_own_thread() -> None:
    """In real time. Only counts are checked, because the machine may be busy."""
    patient = cat.StopPolicy(lost_limit=1_000_000, late_limit=0, raise_faults=False)
    with opened(clock="monotonic", period=2e-3, stop=patient, watchdog=0) as (loop, _, _):
        runs = [
            loop.start(follow, [0.0], [1e-6], network=network, budget=0) for network in range(2)
        ]
        iterate(loop, 0.2)
        assert all(run.steps > 10 for run in runs)
        loop.run(finish, memory=[0.0], network=0, budget=0)
        assert runs[1].running


def test_a_law_that_fails_next_to_a_run_ends_it() -> None:
    with opened() as (loop, _, _):
        loop.start(spoil, memory=[0.0], network=1)
        with pytest.raises(LawError, match="law spoil left NaN"):
            loop.run(follow, memory=[0.0], parameters=[0.0], network=0)


def test_a_failure_counts_in_a_cycle_that_is_not_seen() -> None:
    """In real time, several cycles can pass between two steps of `run`."""
    with opened() as (loop, _, _):
        run = loop.start(spoil, memory=[0.0], network=1)
        engine = loop.networks[1].session.engine
        engine.run(30)
        assert run.failed
        with pytest.raises(LawError, match="law spoil left NaN"):
            loop.run(finish, memory=[0.0], network=0)


def test_laws_run_while_the_loop_is_in_the_background() -> None:
    with opened() as (loop, upper, lower):
        loop.run_in_background()
        runs = [
            loop.start(follow, memory=[0.0], parameters=[1e-5], network=network)
            for network in range(2)
        ]
        end = time.monotonic() + 20.0
        while min(run.steps for run in runs) < 50 and time.monotonic() < end:
            time.sleep(0.01)
        assert all(run.running for run in runs)
        assert min(run.steps for run in runs) >= 50
        with loop.update():
            assert upper.enabled.all()
            assert lower.enabled.all()


@cat.law
def compute_long(actual, target, memory, parameters):
    for _ in range(int(parameters[0])):
        memory[0] = memory[0] * 1.0000001 + 1.0


@cat.law
def never_return(actual, target, memory, time):
    while time > 0.05:
        memory[0] += 1.0


@pytest.mark.parametrize(
    ("law", "more", "said"),
    [
        (compute_long, {"parameters": [1e6], "budget": 1e-6}, "exceeded its budget"),
        (never_return, {"budget": 0}, "did not return"),
    ],
)
def test_a_slow_law_ends_the_loop_in_real_time(law: Callable, more: dict, said: str) -> None:
    patient = cat.StopPolicy(lost_limit=1_000_000, late_limit=0, raise_faults=False)
    with opened(clock="monotonic", period=10e-3, stop=patient, watchdog=0) as (loop, _, _):
        loop.start(follow, [0.0], [1e-6], network=0, budget=0)
        run = loop.start(law, [0.0], network=1, **more)
        with pytest.raises(LawError, match=said):
            iterate(loop, 20.0)
        assert run.failed
