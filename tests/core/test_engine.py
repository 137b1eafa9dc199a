"""The engine on the machine's own clock: native thread, signals, scheduling. Nothing timed is
asserted; a virtual segment in this process answers."""

import os
import signal
import threading
from collections.abc import Iterator
from dataclasses import replace

import pytest

from catenary.core import CYCLE_NONE, CYCLE_OK, CYCLE_STOPPED, Engine
from catenary.plan.cycle import CyclePlan
from catenary.virtual import Coupler, Segment
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import decode_frame, encode_frame
from tests.core.rig import Bench, al_status, axis, frame_plan, make_plan

EXECUTION_MODES = ("threaded", "inline")


def plan(execution: str, **more: object) -> CyclePlan:
    """A BRD of the AL status alone: two couplers answer it."""
    frames = (frame_plan([al_status(2)]),)
    made = make_plan([], units=0, execution=execution, frames=frames, priority=None)
    return replace(made, **more)


@pytest.fixture
def link() -> Iterator[object]:
    with Segment([Coupler(), Coupler()], clock="monotonic").open_link() as link:
        yield link


@pytest.fixture(params=EXECUTION_MODES)
def engine(request: pytest.FixtureRequest, link) -> Iterator[Engine]:
    engine = Engine(plan(request.param), link.capsule)
    engine.start()
    yield engine
    engine.stop()


def test_cycles_run_and_figures_are_kept(engine: Engine, request: pytest.FixtureRequest) -> None:
    assert engine.run(20) & CYCLE_OK
    numbers = []
    for _ in range(20):
        assert not engine.next() & (CYCLE_NONE | CYCLE_STOPPED)
        numbers.append(engine.number)
    assert numbers == sorted(set(numbers))
    assert engine.al_counter == 2
    engine.stop()
    counters = engine.counters
    assert counters["cycles"] >= 40
    finished = counters["cycles"] - ("inline" in request.node.name)  # its last one waits for a body
    assert engine.histograms()["period"]["count"] == finished - 1
    assert engine.scheduling.startswith("SCHED_")


def test_a_native_thread_does_not_need_python(link) -> None:
    engine = Engine(plan("threaded"), link.capsule)
    engine.start()
    engine.run(1)
    before = engine.counters["cycles"]
    while engine.counters["cycles"] < before + 20:  # this thread does nothing for it
        pass
    engine.stop()
    assert engine.counters["cycles"] - engine.counters["lost"] >= 20


def test_a_signal_handler_runs_at_once_and_its_exception_is_raised(engine: Engine) -> None:
    def handler(number: int, frame: object) -> None:
        raise InterruptedError("a handler's")

    before = signal.signal(signal.SIGALRM, handler)
    try:
        for step in (lambda: engine.run(10**9), lambda: [engine.next() for _ in range(10**9)]):
            signal.setitimer(signal.ITIMER_REAL, 0.02)
            with pytest.raises(InterruptedError, match="a handler's"):
                step()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert engine.run(2) & CYCLE_OK


def test_the_acyclic_queue_and_its_waiting_thread(engine: Engine) -> None:
    frame = encode_frame([Datagram(EcatCommand.BRD, 0x0130 << 16, bytes(2), index=0x91)])
    answers = []

    def serve() -> None:
        for _ in range(5):
            engine.acyclic_push(frame)
            while not engine.acyclic_wait(1_000_000_000):
                pass
            answers.append(engine.acyclic_pop())

    service = threading.Thread(target=serve)
    service.start()
    while service.is_alive():
        engine.next()
    service.join()
    assert [decode_frame(a).datagrams[0].working_counter for a in answers] == [2] * 5
    assert engine.counters["alien"] == engine.counters["stale"] == 0


def test_on_a_real_clock_time_that_is_spent_is_computed_away(engine: Engine) -> None:
    before = engine.now()
    engine.spend(2_000_000)
    assert engine.now() - before >= 2_000_000
    with pytest.raises(ValueError, match="duration_ns"):
        engine.spend(-1)


def test_stop_and_start_again(engine: Engine) -> None:
    for _ in range(3):
        engine.run(3)
        engine.stop()
        done = engine.counters["cycles"]
        assert engine.number <= done
        engine.start()
        assert engine.number <= done
        assert engine.run(1) & CYCLE_OK
        assert engine.number > done


@pytest.mark.parametrize("execution", EXECUTION_MODES)
def test_refused_scheduling_is_reported(execution: str, link) -> None:
    policy, cpus = os.sched_getscheduler(0), os.sched_getaffinity(0)
    engine = Engine(plan(execution, cpu=1023, priority=1), link.capsule)
    engine.start()
    engine.run(2)
    text = engine.scheduling
    engine.stop()
    assert text.startswith(("SCHED_FIFO 1", "SCHED_OTHER: not permitted (EPERM)"))
    assert "CPU 1023: refused (EINVAL)" in text
    assert text.endswith(" MB locked") or "touched only" in text
    assert (os.sched_getscheduler(0), os.sched_getaffinity(0)) == (policy, cpus)


def test_the_thread_of_a_failed_link_ends_and_reports_the_error() -> None:
    b = Bench(plan("threaded", sync_units=()))
    b.engine.stop()
    b.link.table.flags = 0  # no virtual time: a native thread, waiting by a Python callback
    b.link.table.wait_until = type(b.link.table.wait_until)(lambda *_: -100)
    engine = Engine(b.plan, b.link.capsule)
    engine.start()
    with pytest.raises(OSError, match="link") as caught:
        engine.next()
    assert caught.value.errno == 100
    engine.stop()


def test_a_missing_cycle_is_reported_after_the_timeout() -> None:
    b = Bench(plan("threaded", sync_units=()))
    b.engine.stop()
    b.link.table.flags = 0
    gate = threading.Event()

    def blocked(_, deadline, wake_on_frame) -> int:
        gate.wait()
        return -100

    b.link.table.wait_until = type(b.link.table.wait_until)(blocked)
    # the engine's clock must pass, though the link's waits do not
    b.link.table.now = type(b.link.table.now)(lambda _: count_up(b))
    engine = Engine(b.plan, b.link.capsule)
    engine.start()
    assert engine.next(timeout_ns=5_000_000) & CYCLE_NONE
    gate.set()
    engine.stop()


def count_up(b: Bench) -> int:
    b.link.time += 1_000_000
    return b.link.time


def test_a_forgotten_engine_ends_its_thread(link) -> None:
    engine = Engine(plan("threaded"), link.capsule)
    before = set(os.listdir("/proc/self/task"))
    engine.start()
    [thread] = set(os.listdir("/proc/self/task")) - before
    del engine
    for _ in range(10_000):  # a thread is joined a little before the kernel forgets it
        if not os.path.exists(f"/proc/self/task/{thread}"):
            return
        threading.Event().wait(0.001)
    raise AssertionError(f"the thread {thread} goes on")


def test_axes_without_a_unit_are_refused(link) -> None:
    with pytest.raises(ValueError, match="no sync unit 0"):
        Engine(plan("threaded", axes=(axis(0),)), link.capsule)
