"""Running tasks: exact results on a virtual clock, and basic behaviour on the machine's clock."""

from __future__ import annotations

import gc
import os
import resource
import signal
import threading

import pytest

from catenary.errors import RealtimeError, TaskError
from catenary.realtime import (
    Queue,
    Signal,
    Task,
    Tasks,
    Value,
    VirtualClock,
    session,
)
from tests.realtime import bodies
from tests.realtime.test_clock import MS, records

BOTH = pytest.mark.parametrize("run", ["threads", "processes"])


# exact results in virtual time


@BOTH
def test_a_period_changed_by_the_task_itself(run):
    notes = Queue("i8", 3, length=100)
    task = Task(bodies.double_the_period, (notes,), period=10e-3)
    with VirtualClock() as clock, Tasks(task, workers=run, clock=clock) as tasks:
        tasks.join(60e-3)
        tasks.stop()
        assert tasks["double_the_period"].period == 20e-3
    assert [release // MS for _, release, _ in records(notes)] == [0, 10, 30, 50]


def test_a_period_changed_from_outside():
    notes = Queue("i8", 3, length=100)
    task = Task(bodies.note, (notes,), period=10e-3)
    with VirtualClock() as clock, Tasks(task, clock=clock) as tasks:
        tasks.join(25e-3)
        tasks["note"].period = 2e-3
        tasks.join(5e-3)
        with pytest.raises(ValueError, match="not positive"):
            tasks["note"].period = 0.0
    # from the last release on: 20, then 22 and 24, which have passed at 25, then 26, 28
    assert [(release // MS, now // MS) for _, release, now in records(notes)] == [
        (0, 0),
        (10, 10),
        (20, 20),
        (22, 25),
        (24, 25),
        (26, 26),
        (28, 28),
    ]


def test_on_miss_count_continues_with_late_releases():
    notes = Queue("i8", 3, length=100)
    task = Task(bodies.overrun_once, (1, 25e-3, notes), name="a", period=10e-3)
    with VirtualClock() as clock, Tasks(task, clock=clock) as tasks:
        tasks.join(60e-3)
    assert [(number, release // MS, now // MS) for number, release, now in records(notes)] == [
        (0, 0, 0),
        (1, 10, 10),
        (2, 20, 35),
        (3, 30, 35),
        (4, 40, 40),
        (5, 50, 50),
    ]
    statistics = tasks["a"].statistics
    assert (statistics.jobs, statistics.misses, statistics.skipped) == (6, 2, 0)
    assert statistics.response.max == pytest.approx(25e-3)


def test_on_miss_skip_omits_passed_releases():
    notes = Queue("i8", 3, length=100)
    task = Task(bodies.overrun_once, (1, 25e-3, notes), name="a", period=10e-3, on_miss="skip")
    with VirtualClock() as clock, Tasks(task, clock=clock) as tasks:
        tasks.join(60e-3)
    assert [release // MS for _, release, _ in records(notes)] == [0, 10, 40, 50]
    statistics = tasks["a"].statistics
    assert (statistics.jobs, statistics.misses, statistics.skipped) == (4, 1, 2)


def test_on_miss_stop_ends_the_task_with_an_error():
    notes = Queue("i8", 3, length=100)
    task = Task(
        bodies.overrun_once,
        (1, 5e-3, notes),
        name="a",
        period=10e-3,
        deadline=4e-3,
        on_miss="stop",
    )
    with (
        VirtualClock() as clock,
        pytest.raises(TaskError, match=r"job 1, .*0\.010000 s: .*deadline of 4\.000 ms") as caught,
        Tasks(task, clock=clock) as tasks,
    ):
        tasks.join(60e-3)
    assert caught.value.task == "a"


def test_on_miss_function_receives_the_late_job():
    notes, late = Queue("i8", 3, length=100), []
    task = Task(
        bodies.overrun_once,
        (1, 25e-3, notes),
        name="a",
        period=10e-3,
        on_miss=lambda job: late.append((job.number, job.time)),
    )
    with VirtualClock() as clock, Tasks(task, clock=clock) as tasks:
        tasks.join(60e-3)
    assert late == [(1, pytest.approx(10e-3)), (2, pytest.approx(20e-3))]


def test_a_sporadic_task_keeps_its_minimum_period():
    """Three signals at the same time release one job every 3 ms."""
    alarm, notes = Signal(), Queue("i8", 3, length=100)
    tasks = [
        Task(bodies.set_at_every_job, (alarm, 3), name="cause", period=20e-3, priority=9),
        Task(bodies.note, (notes,), name="effect", period=3e-3, trigger=alarm),
    ]
    with VirtualClock() as clock, Tasks(*tasks, workers="threads", clock=clock) as running:
        running.join(30e-3)
    assert [now // MS for _, _, now in records(notes)] == [0, 3, 6, 20, 23, 26]


def test_too_many_pending_signals_are_refused_and_counted():
    alarm = Signal()
    task = Task(bodies.idle, period=1e-3, trigger=alarm)
    with VirtualClock() as clock, Tasks(task, clock=clock) as running:
        assert [alarm.set() for _ in range(70)].count(False) == 6
        running.join(1.0)
        statistics = running["idle"].statistics
    assert (statistics.jobs, statistics.signals_refused) == (64, 6)


def test_statistics_of_the_published_experiment():
    tasks = [
        Task(bodies.spend, (execution,), name=name, period=period, priority=priority)
        for name, period, execution, priority in (
            ("tau1", 10e-3, 3e-3, 3),
            ("tau2", 20e-3, 5e-3, 2),
            ("tau3", 40e-3, 10e-3, 1),
        )
    ]
    with VirtualClock() as clock, Tasks(*tasks, workers="threads", clock=clock) as running:
        running.join(0.4)
    tau3 = running["tau3"].statistics
    assert tau3.jobs == 10
    assert tau3.period.min == tau3.period.max == pytest.approx(40e-3)
    assert tau3.jitter.max == pytest.approx(8e-3)  # it is released at 0 and starts after the others
    assert tau3.response.max == tau3.response.p50 == pytest.approx(29e-3)
    assert tau3.execution.max == pytest.approx(10e-3)
    [(low, above, count)] = running["tau3"].histogram("response")
    assert low <= 29e-3 < above
    assert count == 10
    with pytest.raises(ValueError, match="unknown figure 'delay'; use one of period, jitter"):
        running["tau3"].histogram("delay")
    assert [round(one.response * 1e3) for one in running.verdict().responses] == [3, 8, 29]
    assert str(running).splitlines()[3].split()[:3] == ["tau3", "10", "0"]


def test_no_verdict_before_the_first_job():
    task = Task(bodies.idle, period=1e-3, trigger=Signal())
    with (
        VirtualClock() as clock,
        Tasks(task, clock=clock) as running,
        pytest.raises(ValueError, match="no job has ended yet"),
    ):
        running.verdict()


def test_histogram_resolution_is_half_a_percent():
    task = Task(bodies.spend, (1.234567e-3,), period=10e-3)
    with VirtualClock() as clock, Tasks(task, clock=clock) as running:
        running.join(1.0)
    figure = running["spend"].statistics.response
    assert figure.count == 100
    for value in (figure.mean, figure.min, figure.max, figure.p50, figure.p99):
        assert value == pytest.approx(1.234567e-3, rel=4e-3)
    assert figure.sd == pytest.approx(0.0, abs=1e-12)


def test_join_without_a_timeout_in_virtual_time():
    tasks = [Task(bodies.count_to, (n,), name=f"to {n}", period=1e-3) for n in (30, 500)]
    with VirtualClock() as clock, Tasks(*tasks, clock=clock) as running:
        assert running.join()
        assert clock.now_ns == 500 * MS


def test_a_virtual_clock_binds_all_tasks_to_one_processor():
    before = os.sched_getaffinity(0)
    found = Value("i8", 4)
    task = Task(bodies.report_scheduling, (found,), period=1e-3, cpu=7)  # a simulated processor
    with VirtualClock() as clock, Tasks(task, workers="processes", clock=clock) as running:
        [ours] = os.sched_getaffinity(0)
        running.join(1e-3)
        assert found.read()[3] == ours
    assert os.sched_getaffinity(0) == before


# basic behaviour on the machine's clock


@BOTH
def test_tasks_end_by_themselves(run):
    tasks = [Task(bodies.count_to, (n,), name=f"to {n}", period=1e-3) for n in (3, 5)]
    with Tasks(*tasks, workers=run) as running:
        assert running.join(30.0)
        assert not any(handle.running for handle in running)
        assert [handle.statistics.jobs for handle in running] == [4, 6]


def test_several_tasks_run_as_processes_and_one_as_a_thread():
    one, two = (Task(bodies.idle, name=name, period=1e-3) for name in "ab")
    assert Tasks(one).workers == "threads"
    assert Tasks(one, two).workers == "processes"


def test_a_signal_from_another_process():
    alarm = Signal()
    tasks = [
        Task(bodies.set_at_every_job, (alarm, 1), name="cause", period=2e-3),
        Task(bodies.count_to, (4,), name="effect", period=0.1e-3, trigger=alarm),
    ]
    with Tasks(*tasks) as running:
        while running["effect"].running:
            running.join(0.01)
        assert running["effect"].statistics.jobs == 5


@BOTH
def test_the_requested_scheduling_is_obtained(run):
    cpu = max(os.sched_getaffinity(0))
    found = Value("i8", 4)
    task = Task(bodies.report_scheduling, (found,), period=1e-3, cpu=cpu, priority=7)
    try:
        with Tasks(task, workers=run) as running:
            assert running.join(30.0)
    except RealtimeError as error:
        pytest.skip(f"needs real-time scheduling: {error.message}")
    policy, priority, process, at = (int(value) for value in found.read())
    assert (policy, priority, at) == (os.SCHED_FIFO, 7, cpu)
    assert (process == os.getpid()) == (run == "threads")


@BOTH
def test_stack_size(run):
    before = threading.stack_size(), resource.getrlimit(resource.RLIMIT_STACK)
    found = Value("i8", 2)
    task = Task(bodies.stack_deep, (found,), period=1e-3, stack_size=256 * 1024)
    with Tasks(task, workers=run) as running:
        assert running.join(30.0)
    if run == "processes":
        assert found.read()[1] == 256 * 1024
    assert (threading.stack_size(), resource.getrlimit(resource.RLIMIT_STACK)) == before


# functions in parallel with the tasks


@BOTH
def test_a_loop_in_parallel_with_tasks(run):
    """A task of higher priority uses 1 ms of every 10 ms on the same processor."""
    notes = Queue("i8", 3, length=100)
    task = Task(bodies.spend_and_note, (1e-3, notes), period=10e-3, priority=50)

    def work(place, times):
        ends = []
        for number in range(times):
            place.wait_until(number * 10 * MS)
            place.spend(2e-3)
            ends.append(place.now_ns)
        return ends

    with VirtualClock() as clock, Tasks(task, workers=run, clock=clock, best_effort=True) as tasks:
        ends = tasks.beside(work, 3, priority=40, cpu=0)
    assert [end % (10 * MS) for end in ends] == [3 * MS] * 3
    assert len(records(notes)) >= 3


def test_exceptions_of_the_function_propagate():
    def fails(place):
        raise LookupError("beside")

    task = Task(bodies.idle, period=10e-3)
    with VirtualClock() as clock, Tasks(task, clock=clock) as tasks:
        with pytest.raises(LookupError, match="beside"):
            tasks.beside(fails)
        tasks.join(20e-3)  # time advances


def test_ctrl_c_waits_for_the_function_while_time_passes():
    ends = []

    def work(place):
        place.wait_until(10 * MS)  # the other thread lets time pass
        os.kill(os.getpid(), signal.SIGINT)
        place.wait_until(5_000 * MS)
        ends.append(place.now_ns)

    task = Task(bodies.idle, period=10e-3)
    with VirtualClock() as clock, Tasks(task, clock=clock) as tasks:
        with pytest.raises(KeyboardInterrupt):
            tasks.beside(work)
        assert ends == [5_000 * MS]


def test_the_function_runs_in_this_thread_on_the_machines_clock():
    with Tasks(Task(bodies.idle, period=10e-3)) as tasks:
        assert tasks.beside(lambda place, x: (place, x, threading.get_ident()), 3) == (
            None,
            3,
            threading.get_ident(),
        )


@BOTH
def test_the_function_runs_in_the_session_on_the_machines_clock(run):
    collects = gc.isenabled()
    prepared = session(best_effort=True)
    with Tasks(Task(bodies.idle, period=10e-3), workers=run, session=prepared) as tasks:
        assert tasks.beside(lambda place: gc.isenabled()) is False
        assert gc.isenabled() == (collects and run == "processes")
    assert gc.isenabled() == collects
