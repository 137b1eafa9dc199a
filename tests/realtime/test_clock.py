"""Virtual time: fixed priorities, preemption and lockstep of threads and processes."""

from __future__ import annotations

import ctypes
import multiprocessing
import signal
import threading
from collections.abc import Callable

import pytest

from catenary.realtime import Participant, Queue, Signal, Task, Tasks, VirtualClock
from tests.realtime.bodies import note, set_then_spend, spend, spend_and_note

MS = 1_000_000


def records(queue: Queue) -> list[list[int]]:
    found = []
    while (record := queue.take()) is not None:
        found.append([int(value) for value in record])
    return found


def run_threads(clock: VirtualClock, until: int, *bodies: tuple[Participant, Callable]) -> None:
    """Run bodies in lockstep. The thread of the clock waits until `until`."""
    threads = [threading.Thread(target=leaving, args=body) for body in bodies]
    for thread in threads:
        thread.start()
    clock.wait_until(until)
    clock.home.step_aside()
    for thread in threads:
        thread.join(10.0)
        assert not thread.is_alive()


def leaving(participant: Participant, body: Callable[[Participant], None]) -> None:
    body(participant)
    participant.leave()


def test_time_advances_only_while_all_wait():
    with VirtualClock() as clock:
        assert clock.now_ns == 0
        assert clock.wait_until(5 * MS)
        assert clock.now_ns == 5 * MS
        clock.spend(0.25)
        assert clock.now_ns == 255 * MS


def test_a_passed_deadline_returns_immediately():
    with VirtualClock() as clock:
        clock.wait_until(5 * MS)
        assert clock.wait_until(MS)
        assert clock.now_ns == 5 * MS


def test_a_wake_before_the_wait_is_not_lost():
    with VirtualClock() as clock:
        clock.home.wake()
        assert not clock.wait_until(5 * MS)
        assert clock.now_ns == 0
        assert clock.wait_until(5 * MS)


class SignalledError(Exception):
    """Raised by the handler of a signal."""


def raise_signalled(number, frame):
    raise SignalledError


def test_a_signal_to_another_thread_is_handled():
    """The signal arrives at another thread, so that it does not interrupt the sleep."""

    def send() -> None:
        pause.wait(0.05)  # the wait has usually begun; the test passes in either case
        signal.pthread_kill(threading.get_ident(), signal.SIGUSR1)

    pause, rescued = threading.Event(), threading.Event()
    before = signal.signal(signal.SIGUSR1, raise_signalled)
    with VirtualClock() as clock:
        absent = clock.participate()  # time stands still
        rescue = threading.Timer(20.0, lambda: (rescued.set(), absent.leave()))
        threads = [rescue, threading.Thread(target=send)]
        for thread in threads:
            thread.start()
        with pytest.raises(SignalledError):
            clock.wait_until(MS)
        rescue.cancel()
        for thread in threads:
            thread.join()
    signal.signal(signal.SIGUSR1, before)
    assert not rescued.is_set()


def test_execution_time_continues_after_signals():
    """The handler runs while time stands still, and lets it advance at its third call."""
    calls = []

    def count(number, frame):
        calls.append(clock.now_ns)
        if len(calls) == 3:
            signal.setitimer(signal.ITIMER_REAL, 0)
            absent.leave()

    before = signal.signal(signal.SIGALRM, count)
    with VirtualClock() as clock:
        absent = clock.participate()  # time stands still
        rescue = threading.Timer(20.0, absent.leave)
        rescue.start()
        signal.setitimer(signal.ITIMER_REAL, 0.01, 0.01)
        clock.spend(5e-3)
        rescue.cancel()
        assert calls == [0, 0, 0]
        assert clock.now_ns == 5 * MS
    signal.signal(signal.SIGALRM, before)


def test_a_higher_priority_preempts():
    """Low spends 10 ms from 0, and high spends 3 ms from 4, so low ends at 13."""
    seen = []

    def low(participant):
        participant.wait_until(0)
        participant.spend(10e-3)
        seen.append(("low", participant.now_ns // MS))

    def high(participant):
        participant.wait_until(4 * MS)
        participant.spend(3e-3)
        seen.append(("high", participant.now_ns // MS))

    with VirtualClock() as clock:
        bodies = [
            (clock.participate(priority=1, cpu=0), low),
            (clock.participate(priority=2, cpu=0), high),
        ]
        run_threads(clock, 100 * MS, *bodies)
    assert seen == [("high", 7), ("low", 13)]


def test_equal_priorities_run_in_the_order_of_release():
    """The participant released later waits until the other one has ended (SCHED_FIFO)."""
    seen = []

    def body(name: str, start: int) -> Callable[[Participant], None]:
        def run(participant):
            participant.wait_until(start * MS)
            participant.spend(5e-3)
            seen.append((name, participant.now_ns // MS))

        return run

    with VirtualClock() as clock:
        second, first = (clock.participate(priority=5, cpu=0) for _ in range(2))
        run_threads(clock, 100 * MS, (second, body("second", 2)), (first, body("first", 1)))
    assert seen == [("first", 6), ("second", 11)]


def test_processors_run_in_parallel():
    seen = []

    def body(participant):
        participant.wait_until(0)
        participant.spend(5e-3)
        seen.append(participant.now_ns // MS)

    with VirtualClock() as clock:
        places = [clock.participate(cpu=0), clock.participate(cpu=1), clock.participate()]
        run_threads(clock, 100 * MS, *((place, body) for place in places))
    assert seen == [5, 5, 5]


def test_a_job_that_ends_when_another_is_released_is_not_preempted():
    seen = []

    def low(participant):
        participant.wait_until(0)
        participant.spend(4e-3)
        seen.append(("low", participant.now_ns // MS))

    def high(participant):
        participant.wait_until(4 * MS)
        participant.spend(3e-3)
        seen.append(("high", participant.now_ns // MS))

    with VirtualClock() as clock:
        bodies = [
            (clock.participate(priority=1, cpu=0), low),
            (clock.participate(priority=2, cpu=0), high),
        ]
        run_threads(clock, 100 * MS, *bodies)
    assert seen == [("low", 4), ("high", 7)]


def test_at_most_64_participants():
    with VirtualClock() as clock:
        places = [clock.participate() for _ in range(63)]
        with pytest.raises(ValueError, match="all 64 slots"):
            clock.participate()
        places[7].leave()
        assert clock.participate().timer.slot == places[7].timer.slot


def test_the_capsule_for_compiled_code():
    """The capsule contains the table of native/clock.h."""

    class Table(ctypes.Structure):
        _fields_ = (
            ("version", ctypes.c_uint32),
            ("flags", ctypes.c_uint32),
            ("self", ctypes.c_void_p),
            ("now", ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p)),
            ("wait_until", ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_int64)),
            ("spend", ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_int64)),
        )

    pointer = ctypes.pythonapi.PyCapsule_GetPointer
    pointer.restype, pointer.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    with VirtualClock() as clock:
        table = Table.from_address(pointer(clock.capsule, b"catenary.clock"))
        assert (table.version, table.flags) == (1, 1)
        assert table.wait_until(table.self, 3 * MS) == 0
        assert table.spend(table.self, 2 * MS) == 0
        assert table.now(table.self) == clock.now_ns == 5 * MS


def test_a_participant_can_only_be_passed_to_a_new_process():
    context = multiprocessing.get_context("spawn")
    with (
        VirtualClock() as clock,
        pytest.raises(TypeError, match="passed as an argument"),
    ):
        context.SimpleQueue().put(clock.participate())


@pytest.mark.parametrize("run", ["threads", "processes"])
def test_runs_are_deterministic(run):
    def once() -> list[list[list[int]]]:
        queues = [Queue("i8", 3, length=1000) for _ in range(3)]
        tasks = [
            Task(spend_and_note, (3e-3, queues[0]), name="a", period=10e-3, priority=3),
            Task(spend_and_note, (5e-3, queues[1]), name="b", period=17e-3, priority=2),
            Task(spend_and_note, (10e-3, queues[2]), name="c", period=41e-3, priority=1),
        ]
        with VirtualClock() as clock, Tasks(*tasks, workers=run, clock=clock) as running:
            running.join(0.7)
            running.stop()
        return [records(queue) for queue in queues]

    first = once()
    assert [len(jobs) for jobs in first] == [70, 42, 17]
    assert once() == first


def test_threads_and_processes_give_the_same_schedule():
    def responses(run) -> list[object]:
        tasks = [
            Task(spend, (2e-3,), name="a", period=7e-3, priority=3),
            Task(spend, (3e-3,), name="b", period=11e-3, priority=3),
            Task(spend, (5e-3,), name="c", period=31e-3, priority=1),
        ]
        with VirtualClock() as clock, Tasks(*tasks, workers=run, clock=clock) as running:
            running.join(1.0)
            running.stop()
            return [handle.statistics.response for handle in running]

    assert responses("threads") == responses("processes")


def test_a_signal_releases_its_task_immediately():
    """`low` sets the signal at 2 ms. The sporadic task has a higher priority and preempts it."""
    alarm, notes = Signal(), Queue("i8", 3, length=10)
    tasks = [
        Task(set_then_spend, (alarm, 4e-3), name="low", period=10e-3, priority=1),
        Task(note, (notes,), name="high", period=1e-3, priority=2, trigger=alarm),
    ]
    with VirtualClock() as clock, Tasks(*tasks, workers="threads", clock=clock) as running:
        running.join(15e-3)
    assert records(notes) == [[0, 2 * MS, 2 * MS], [1, 12 * MS, 12 * MS]]
