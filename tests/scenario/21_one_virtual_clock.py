"""A loop, a law, drives and tasks (threads or processes) use one virtual clock.
All runs are bit-identical, and take a fraction of the simulated time.
"""

from __future__ import annotations

import hashlib
import math
import threading
from pathlib import Path
from typing import Literal

import pytest

import catenary as cat
from catenary.link import Recorder
from catenary.realtime import Task, Tasks, VirtualClock
from catenary.realtime.clock import Participant
from tests.realtime.bodies import spend

TASKS = (("tau1", 10e-3, 3e-3, 30), ("tau2", 20e-3, 5e-3, 20), ("tau3", 40e-3, 10e-3, 10))
Run = Literal["threads", "processes"]


@cat.law
def swing(actual, target, memory, time):
    for i in range(actual.n):
        target.position[i] = memory[0] * math.sin(3.0 * time)
    return time > 0.3


def live(path: Path, run: Run) -> tuple[str, list[float], int, object]:
    """Return a digest of the frames, the longest responses [s], the cycles and the end position."""
    with VirtualClock() as clock:
        tasks = Tasks(
            *(
                Task(spend, (execution,), name=name, period=period, priority=priority, cpu=0)
                for name, period, execution, priority in TASKS
            ),
            clock=clock,
            workers=run,
            best_effort=True,
        )
        segment = cat.Segment(
            [cat.virtual.Coupler(), *(cat.virtual.Servo() for _ in range(3))], clock=clock
        )
        with tasks, Recorder(segment, path) as link, cat.MainDevice(link) as main:
            arm = cat.Drives(
                main.scan().drives, mode="csp", counts_per_turn=2**20, velocity_limit=100.0
            )
            with cat.Loop(arm, period=1e-3) as loop:
                for cycle in loop:
                    arm.target.position[:] = 0.1 * math.sin(cycle.time)
                    cycle.spend(0.2e-3)
                    if cycle.time > 0.5:
                        break
                loop.run(swing, memory=[0.2])
                cycles = loop.timing.counters["cycles"]
                assert loop.timing.counters["lost"] == 0
                end = arm.actual.position.copy()
            tasks.stop()
            link.wait_until(clock.now_ns, False)  # the last job may have ended after the loop
            responses = [one.statistics.response.max for one in tasks]
        assert segment.now_ns == clock.now_ns
    return hashlib.sha256(path.read_bytes()).hexdigest(), responses, cycles, end.tolist()


@pytest.mark.parametrize("run", ["threads", "processes"])
def test_two_runs_are_bit_identical(tmp_path: Path, run: Run) -> None:
    pytest.importorskip("numba", reason="the law of this scenario is compiled")
    first = live(tmp_path / "first.pcapng", run)
    assert first == live(tmp_path / "second.pcapng", run)
    _digest, responses, cycles, end = first
    assert responses == pytest.approx([3e-3, 8e-3, 29e-3], abs=1e-12)
    assert cycles > 800
    assert end == pytest.approx([0.2 * math.sin(0.9)] * 3, abs=0.01)


def looping(clock: VirtualClock, place: Participant, took: list[float]) -> None:
    """Run a loop in a separate thread, with 9 ms of computation in each of three cycles."""
    try:
        with cat.MainDevice(cat.Segment([cat.virtual.Servo()], clock=place)) as main:
            arm = cat.Drives(
                main.scan().drives, mode="csp", counts_per_turn=2**20, velocity_limit=100.0
            )
            with cat.Loop(arm, period=20e-3, stop=cat.StopPolicy(late_limit=0)) as loop:
                for cycle in loop:
                    if cycle.number == 3:
                        break
                    start = clock.now_ns
                    cycle.spend(9e-3)
                    took.append((clock.now_ns - start) * 1e-9)
    finally:
        place.leave()


def test_the_body_of_a_loop_is_preempted_like_a_task() -> None:
    """The loop has priority 10 on processor 0. A task of priority 30 uses 3 ms of every 10 ms."""
    took: list[float] = []
    with VirtualClock() as clock:
        name, period, execution, priority = TASKS[0]
        task = Task(spend, (execution,), name=name, period=period, priority=priority, cpu=0)
        place = clock.participate(priority=10, cpu=0)
        thread = threading.Thread(target=looping, args=(clock, place, took))
        thread.start()
        with Tasks(task, clock=clock, workers="threads", best_effort=True) as tasks:
            tasks.join(1.0)
        thread.join()
    assert len(took) == 3
    assert all(one == pytest.approx(12e-3) or one == pytest.approx(15e-3) for one in took)


def test_an_invalid_clock_is_refused() -> None:
    with pytest.raises(ValueError, match="VirtualClock"):
        cat.Segment([cat.virtual.Servo()], clock=3)
    with pytest.raises(ValueError, match="VirtualClock"):
        cat.Segment([cat.virtual.Servo()], clock="real")
