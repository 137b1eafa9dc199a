"""Validation of tasks: every error names the task and the permitted values."""

from __future__ import annotations

import math
import os

import pytest

from catenary.realtime import Signal, Task, Tasks
from tests.realtime.bodies import idle


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"period": 0.0}, "period of 0.0 s is not positive"),
        ({"period": -1e-3}, "is not positive"),
        ({"period": math.nan}, "is not positive"),
        ({"period": math.inf}, "is not positive"),
        ({"period": 1e-6}, "period of 1 us is too short.*at least 20 us"),
        ({"period": 1e7}, "give it in seconds"),
        ({"deadline": 0.0}, "deadline of 0.0 s is not positive"),
        ({"priority": 0}, r"priority 0 is not within 1\.\.99"),
        ({"priority": 100}, r"priority 100 is not within 1\.\.99"),
        ({"cpu": -1}, "CPU -1 does not exist"),
        ({"cpu": 5000}, "CPU 5000 does not exist"),
        ({"stack_size": 1000}, "invalid stack size of 1000 bytes"),
        ({"stack_size": 65537}, "a multiple of 4096, at least 32768"),
        ({"on_miss": "ignore"}, 'on_miss must be "count", "skip", "stop" or a function'),
        ({"on_failure": "ignore"}, 'on_failure must be "stop", "restart" or "continue"'),
    ],
)
def test_refuses(options, words):
    with pytest.raises(ValueError, match=f"task 'arm'.*{words}"):
        Task(idle, **({"period": 1e-3, "name": "arm"} | options))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Task(3, period=1e-3), "not callable"),
        (lambda: Task(idle, 3.0, period=1e-3), r"a tuple such as \(x,\)"),
        (lambda: Task(idle, period="1 ms"), "a number of seconds"),
        (lambda: Task(idle, period=True), "a number of seconds"),
    ],
)
def test_refuses_other_types(make, words):
    with pytest.raises(TypeError, match=words):
        make()


def test_the_default_name_is_the_name_of_the_function():
    assert Task(idle, period=1e-3).name == "idle"
    assert Task(idle, period=1e-3) == Task(idle, period=1e-3)


def test_refuses_invalid_sets_of_tasks():
    one, other = Task(idle, period=1e-3), Task(idle, period=2e-3)
    alarm = Signal()
    with pytest.raises(ValueError, match="no tasks"):
        Tasks()
    with pytest.raises(ValueError, match="two tasks have the name 'idle'"):
        Tasks(one, other)
    with pytest.raises(TypeError, match="is not a Task"):
        Tasks(idle)
    with pytest.raises(ValueError, match='must be "processes" or "threads"'):
        Tasks(one, workers="fibers")
    with pytest.raises(ValueError, match="task 'idle': CPU 1000 does not exist or is not allowed"):
        Tasks(Task(idle, period=1e-3, cpu=1000))
    with pytest.raises(ValueError, match="the same trigger"):
        Tasks(
            Task(idle, name="a", period=1e-3, trigger=alarm),
            Task(idle, name="b", period=1e-3, trigger=alarm),
        )


def test_an_isolated_cpu_is_permitted():
    """With isolcpus, a CPU is not in the default set, but sched_setaffinity permits it."""
    ours = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(ours)})
    try:
        assert len(Tasks(Task(idle, period=1e-3, cpu=max(ours)))) == 1
        assert os.sched_getaffinity(0) == {min(ours)}
    finally:
        os.sched_setaffinity(0, ours)


def test_a_function_that_cannot_be_imported_is_refused():
    tasks = Tasks(Task(lambda task: None, name="arm", period=1e-3), workers="processes")
    with pytest.raises(TypeError, match=r"'arm': its process cannot import .*top level"):
        tasks.start()


def test_errors_before_the_start():
    tasks = Tasks(Task(idle, period=1e-3))
    with pytest.raises(RuntimeError, match="have not been started"):
        tasks.join()
    with pytest.raises(KeyError, match="started tasks: none"):
        tasks["idle"]
    with pytest.raises(RuntimeError, match="no task was started with this signal"):
        Signal().set()
