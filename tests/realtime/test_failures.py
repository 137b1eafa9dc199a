"""Failures of tasks: exceptions, killed processes, tasks that do not end or cannot be started."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from catenary.errors import RealtimeError, TaskError
from catenary.realtime import (
    Queue,
    Task,
    Tasks,
    Value,
    VirtualClock,
    session,
)
from catenary.realtime.supervisor import Supervisor
from catenary.realtime.system import preparation
from tests.realtime import bodies
from tests.realtime.test_clock import MS, records

BOTH = pytest.mark.parametrize("run", ["threads", "processes"])


def wait_for(value: Value, tasks: Tasks) -> int:
    """Wait until a task has written the value."""
    while value.number == 0:
        tasks.join(0.01)
    return int(value.read())


@BOTH
def test_an_exception_stops_all_tasks(run):
    tasks = [
        Task(bodies.fail_at, (2,), name="bad", period=2e-3),
        Task(bodies.idle, name="good", period=1e-3),
    ]
    with (
        pytest.raises(
            TaskError, match=r"'bad' in job 2.*ArithmeticError: the sum.*bodies\.py:"
        ) as e,
        Tasks(*tasks, workers=run) as running,
    ):
        running.join(30.0)
    assert e.value.task == "bad"
    assert not any(handle.running for handle in running)
    assert running["good"].statistics.jobs > 0


@BOTH
def test_on_failure_continue(run):
    tasks = [
        Task(bodies.fail_at, (0,), name="bad", period=2e-3, on_failure="continue"),
        Task(bodies.count_to, (20,), name="good", period=2e-3),
    ]
    with Tasks(*tasks, workers=run) as running:
        assert running.join(30.0)
        assert [failure.task for failure in running.failures] == ["bad"]
        assert running["good"].statistics.jobs == 21


@BOTH
def test_too_many_restarts_stop_all_tasks(run):
    task = Task(bodies.fail_always, name="bad", period=1e-3, on_failure="restart")
    with pytest.raises(TaskError, match="the sum"), Tasks(task, workers=run) as running:
        running.join(30.0)
    assert len(running.failures) == 4  # the first failure and three restarts


def test_the_error_of_a_killed_task_names_the_job_and_time():
    there = Value("i8")
    tasks = [
        Task(bodies.hang_at, (3, there), name="victim", period=2e-3),
        Task(bodies.idle, name="other", period=2e-3),
    ]
    with Tasks(*tasks) as running:
        assert wait_for(there, running) == running["victim"].process
        os.kill(running["victim"].process, signal.SIGKILL)
        with pytest.raises(TaskError) as told:
            running.join(30.0)
    assert "task 'victim' (process" in str(told.value)
    assert "was killed by SIGKILL in job 3, released at 0.006000 s" in str(told.value)
    assert told.value.exit_code == -signal.SIGKILL
    assert not running["other"].running


def test_a_killed_task_restarts_and_keeps_its_statistics():
    there = Value("i8")
    task = Task(bodies.hang_at, (3, there), name="victim", period=2e-3, on_failure="restart")
    other = Task(bodies.idle, name="other", period=2e-3)
    with Tasks(task, other) as running:
        first = wait_for(there, running)
        os.kill(first, signal.SIGKILL)
        while running["victim"].statistics.jobs < 10:
            running.join(0.01)
        assert running["victim"].process != first
        assert [failure.exit_code for failure in running.failures] == [-signal.SIGKILL]
        assert running["other"].running
        statistics = running["victim"].statistics
    assert statistics.skipped > 0  # while the task did not run
    assert statistics.response.count >= statistics.jobs - 2  # the interrupted job has no end


def test_virtual_time_advances_after_a_task_is_killed():
    there, notes = Value("i8"), Queue("i8", 3, length=100)
    tasks = [
        Task(bodies.hang_at, (1, there), name="victim", period=10e-3, on_failure="continue"),
        Task(bodies.note, (notes,), name="other", period=10e-3),
    ]
    with VirtualClock() as clock, Tasks(*tasks, clock=clock) as running:

        def kill() -> None:
            while there.number == 0:
                pause.wait(0.005)
            os.kill(running["victim"].process, signal.SIGKILL)

        pause = threading.Event()
        thread = threading.Thread(target=kill)
        thread.start()
        running.join(50e-3)  # time stands still while the task hangs in its job
        thread.join()
        assert [failure.task for failure in running.failures] == ["victim"]
    assert [release // MS for _, release, _ in records(notes)] == [0, 10, 20, 30, 40]


def test_a_process_that_does_not_end_is_killed():
    there = Value("i8")
    task = Task(bodies.ignore_the_end, (there,), name="deaf", period=1e-3)
    running = Tasks(task, workers="processes")
    running.start()
    wait_for(there, running)
    with pytest.raises(TaskError, match=r"'deaf' did not end within 0\.05 s"):
        running.stop(0.05)
    assert not running["deaf"].running


def test_a_process_that_never_waits_can_clean_up_on_sigterm(tmp_path):
    there, trace = Value("i8"), tmp_path / "trace"
    task = Task(bodies.leave_a_trace, (str(trace), there), name="deaf", period=1e-3)
    running = Tasks(task, workers="processes")
    running.start()
    wait_for(there, running)
    with pytest.raises(TaskError, match="did not end"):
        running.stop(0.05)
    assert trace.read_text() == "cleaned up"


PARENT = """
import sys, time
from catenary.realtime import Task, Tasks, Value
from tests.realtime.bodies import leave_a_trace
if __name__ == "__main__":
    there = Value("i8")
    leaving = Task(leave_a_trace, (sys.argv[1], there), period=1e-3)
    with Tasks(leaving, workers="processes") as tasks:
        while there.number == 0:
            tasks.join(0.01)
        print(int(there.read()), flush=True)
        time.sleep(60.0)
"""


def test_tasks_end_with_their_parent(tmp_path):
    script, trace = tmp_path / "parent.py", tmp_path / "trace"
    script.write_text(PARENT)
    parent = subprocess.Popen(
        [sys.executable, str(script), str(trace)],
        stdout=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).resolve().parents[2])},
    )
    assert parent.stdout is not None
    watched = os.pidfd_open(int(parent.stdout.readline()))
    parent.kill()
    parent.communicate()
    assert select.select([watched], [], [], 20.0)[0] == [watched]
    os.close(watched)
    assert trace.read_text() == "cleaned up"


SPENDING = """
import sys, time
from catenary.realtime import Task, Tasks, VirtualClock
from tests.realtime.bodies import spend
if __name__ == "__main__":
    task = Task(spend, (1.0,), period=2.0)
    with VirtualClock() as clock, Tasks(task, clock=clock) as tasks:
        tasks.join(0.5)
        print(tasks["spend"].process, flush=True)
        time.sleep(60.0)
"""


def test_a_task_that_spends_virtual_time_ends_with_its_parent(tmp_path):
    """The parent has the turn when it is killed: virtual time stands still from then on."""
    script = tmp_path / "parent.py"
    script.write_text(SPENDING)
    parent = subprocess.Popen(
        [sys.executable, str(script)],
        stdout=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).resolve().parents[2])},
    )
    assert parent.stdout is not None
    process = int(parent.stdout.readline())
    watched = os.pidfd_open(process)
    parent.kill()
    parent.communicate()
    ended = select.select([watched], [], [], 20.0)[0]
    if not ended:
        signal.pidfd_send_signal(watched, signal.SIGKILL)
    os.close(watched)
    assert ended == [watched]


def test_arguments_that_cannot_be_pickled_are_an_error():
    task = Task(bodies.spend, (lambda: 1,), name="a", period=1e-3)
    with pytest.raises(TaskError, match=r"task 'a'.*could not be started"):
        Tasks(task, workers="processes").start()


def test_a_failure_that_is_recorded_late_is_an_error_of_the_start(monkeypatch):
    record = Supervisor._record_end

    def late(*arguments, **more):
        time.sleep(0.2)
        return record(*arguments, **more)

    monkeypatch.setattr(Supervisor, "_record_end", late)
    tasks = Tasks(
        Task(bodies.idle, (threading.Lock(),), name="a", period=1e-3), workers="processes"
    )
    with pytest.raises(TaskError, match=r"task 'a'.*could not be started"):
        tasks.start()


def test_a_refused_priority_is_an_error_with_a_hint(monkeypatch):
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    task = Task(bodies.count_to, (1,), name="a", period=1e-3, priority=50)
    with pytest.raises(TaskError, match=r"SCHED_FIFO 50 refused \(Operation not permitted\)") as e:
        Tasks(task).start()
    assert str(e.value).startswith("task 'a' before its first job: SCHED_FIFO 50 refused")
    assert "setcap" in e.value.hint
    assert "rtprio" in e.value.hint
    with Tasks(task, best_effort=True) as running:
        assert running.join(30.0)
        assert "SCHED_FIFO 50 refused" in running["a"].statistics.scheduling
        assert "SCHED_FIFO 50 refused" in str(running)


def test_other_tasks_continue_after_random_kills():
    """Kill a task ten times while processes pass the turn thousands of times per second."""
    tasks = [
        Task(bodies.spend, (10e-6,), name="victim", period=50e-6, on_failure="continue"),
        Task(bodies.spend, (10e-6,), name="other", period=70e-6, on_failure="continue"),
    ]
    for number in range(10):
        with VirtualClock() as clock, Tasks(*tasks, clock=clock) as running:
            victim = running["victim"].process
            death = threading.Timer(0.003 * number, os.kill, (victim, signal.SIGKILL))
            death.start()
            while running["victim"].running:
                running.join(0.1)
            death.join()
            before = running["other"].statistics.jobs
            running.join(0.1)
            assert running["other"].statistics.jobs - before == pytest.approx(0.1 / 70e-6, abs=2)


INTERRUPTED = """
import sys
from catenary.realtime import Task, Tasks, VirtualClock
from tests.realtime.bodies import idle
if __name__ == "__main__":
    clock = VirtualClock() if sys.argv[2] == "virtual" else None
    task = Task(idle, period=20e-6 if clock else 1e-3)
    try:
        with Tasks(task, workers=sys.argv[1], clock=clock) as tasks:
            print("ready", flush=True)
            tasks.join(1e5)
    except KeyboardInterrupt:
        print("stopped", tasks["idle"].running, tasks.failures, flush=True)
"""


@BOTH
@pytest.mark.parametrize("clock", ["virtual", "machine"])
def test_ctrl_c_ends_all_tasks(run, clock, tmp_path):
    script = tmp_path / "interrupted.py"
    script.write_text(INTERRUPTED)
    process = subprocess.Popen(
        [sys.executable, str(script), run, clock],
        stdout=subprocess.PIPE,
        text=True,
        process_group=0,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).resolve().parents[2])},
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    os.killpg(
        process.pid, signal.SIGINT
    )  # like a terminal, which also signals the processes of the tasks
    out, _ = process.communicate(timeout=30.0)
    assert out == "stopped False ()\n"


def test_a_thread_that_cannot_be_started_is_an_error():
    task = Task(bodies.idle, name="huge", period=1e-3, stack_size=2**46)
    with pytest.raises(TaskError, match=r"'huge'.*could not be started"):
        Tasks(task).start()


@BOTH
def test_a_restarted_task_keeps_its_slot_on_the_virtual_clock(run):
    notes = Queue("i8", 3, length=100)
    tasks = [
        Task(bodies.fail_at, (1,), name="bad", period=10e-3, priority=9, on_failure="restart"),
        Task(bodies.note, (notes,), name="good", period=10e-3),
    ]
    with VirtualClock() as clock, Tasks(*tasks, workers=run, clock=clock) as running:
        running.join(50e-3)
        running.stop()
        assert len(running.failures) == 1
        assert running["bad"].statistics.jobs == 5
    assert [release // MS for _, release, _ in records(notes)] == [0, 10, 20, 30, 40]


def test_a_refused_session_starts_no_task(monkeypatch):
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(preparation, "lock_all_memory", refuse)
    interval = sys.getswitchinterval()
    with VirtualClock() as clock:
        task = Task(bodies.idle, period=1e-3)
        with pytest.raises(RealtimeError, match=r"locked memory refused .*not permitted"):
            Tasks(task, workers="threads", clock=clock, session=session()).start()
        assert clock.wait_until(MS)  # no participant is left
    assert sys.getswitchinterval() == interval


def test_too_many_tasks_leave_the_virtual_clock_unchanged():
    tasks = [Task(bodies.idle, name=str(number), period=1e-3) for number in range(64)]
    with VirtualClock() as clock:
        with pytest.raises(ValueError, match="all 64 slots"):
            Tasks(*tasks, workers="threads", clock=clock).start()
        assert clock.wait_until(MS)
        with Tasks(*tasks[:63], workers="threads", clock=clock) as running:
            running.join(2e-3)
        assert sum(handle.statistics.jobs for handle in running) == 126


def test_a_thread_that_does_not_end_is_reported():
    event = threading.Event()
    running = Tasks(Task(bodies.wait_for_event, (event,), name="deaf", period=1e-3))
    running.start()
    with pytest.raises(TaskError, match=r"'deaf' did not end within 0\.05 s"):
        running.stop(0.05)
    assert running["deaf"].running
    event.set()
    running.stop()
    assert not running["deaf"].running


WITHOUT_GUARD = """
from catenary.realtime import Task, Tasks
from tests.realtime.bodies import idle
Tasks(Task(idle, period=1e-3), workers="processes").start()
"""


def test_a_program_without_a_main_guard_gets_a_hint(tmp_path):
    script = tmp_path / "program.py"
    script.write_text(WITHOUT_GUARD)
    done = subprocess.run(
        [sys.executable, str(script)],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).resolve().parents[2])},
    )
    assert "its process ended with exit status 1 before it could start" in done.stderr
    assert '`if __name__ == "__main__":`' in done.stderr
