"""Loops that start their cycles with those of a loop in another process.

The tests run in real time, so they count cycles and do not assert times. The period is long: a busy
machine rarely exceeds the margin of a quarter of it.
"""

from __future__ import annotations

import os
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

import catenary as cat
from catenary.bench.segment import served
from catenary.errors import ConfigurationError, ShareError
from catenary.realtime import VirtualClock
from catenary.share import TriggerReceiver, TriggerSender
from catenary.share.trigger import open_memory
from catenary.virtual import Coupler, Segment, Servo
from tests.share.names import own_name

PERIOD = 10e-3
PATIENCE = 1500  # cycles until an expected change
PATIENT = cat.StopPolicy(lost_limit=1_000_000, late_limit=0, raise_faults=False)
SENDER = """
import sys
import catenary as cat
from catenary.virtual import Coupler, Segment, Servo

target = sys.argv[3] or Segment([Coupler(), Servo()], clock="monotonic")
with cat.MainDevice(target) as main:
    arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
    trigger = cat.share.TriggerSender(sys.argv[1])
    stop = cat.StopPolicy(lost_limit=1_000_000, late_limit=0, raise_faults=False)
    with cat.Loop(arm, period=float(sys.argv[2]), trigger=trigger, stop=stop, watchdog=0) as loop:
        print("ready", flush=True)
        for cycle in loop:
            pass
"""


@pytest.fixture
def name() -> Iterator[str]:
    with own_name("trigger") as made:
        yield made


@contextmanager
def opened(
    trigger: Any, *, period: float = PERIOD, target: Any = None, **more: Any
) -> Iterator[cat.Loop]:
    """Open a loop with a trigger, over `target` or a segment in this process."""
    target = target or Segment([Coupler(), Servo()], clock="monotonic")
    with cat.MainDevice(target) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        options = {"stop": PATIENT, "watchdog": 0, **more}
        with cat.Loop(arm, period=period, trigger=trigger, **options) as loop:
            yield loop


@contextmanager
def sending(name: str, **more: Any) -> Iterator[cat.Loop]:
    with opened(TriggerSender(name), **more) as loop:
        loop.run_in_background()
        yield loop


@contextmanager
def sending_process(name: str, interface: str = "") -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-c", SENDER, name, str(PERIOD), interface]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            yield process
        finally:
            process.kill()


def run_until(loop: cat.Loop, reached: Callable[[], bool]) -> None:
    for _ in range(PATIENCE):
        if reached():
            return
        next(loop)
    raise AssertionError(f"not reached in {PATIENCE} cycles; {loop.timing.counters}")


def follows(loop: cat.Loop) -> bool:
    return loop.networks[0].trigger.following


def missed(loop: cat.Loop) -> int:
    return loop.networks[0].trigger.missed


def next_change(loop: cat.Loop) -> cat.events.TriggerChanged:
    """Run the loop until the next change, and return its event."""
    for _ in range(PATIENCE):
        for event in loop.networks[0].main.events:
            if isinstance(event, cat.events.TriggerChanged):
                return event
        next(loop)
    raise AssertionError(f"no event in {PATIENCE} cycles")


@pytest.mark.parametrize("busy_wait", [0.0, 1e-3])
def test_the_cycle_starts_are_those_of_the_sender(name: str, busy_wait: float) -> None:
    scheduling = cat.Scheduling(busy_wait=busy_wait)
    with (
        sending(name) as first,
        opened(TriggerReceiver(name), scheduling=scheduling) as second,
    ):
        run_until(second, lambda: follows(second))
        before, since = missed(second), second.log["number"][-1]
        for _ in range(100):
            next(second)
        log = second.log
        starts = log["scheduled_ns"][log["number"] > since]
        shared = np.isin(starts, first.log["scheduled_ns"]).sum()
        assert shared >= 100 - (missed(second) - before) - 2
        assert shared > 20
        assert missed(first) == 0


@pytest.mark.usefixtures("veth")
def test_two_processes_on_wires(name: str) -> None:
    """The first process is killed, and started again on its network."""
    with (
        served(2) as upper,
        served(1) as lower,
        opened(TriggerReceiver(name), target=lower.interface) as loop,
    ):
        for _ in range(2):
            with sending_process(name, upper.interface) as process:
                run_until(loop, lambda: follows(loop))
                os.kill(process.pid, signal.SIGKILL)
                process.wait()
            before = missed(loop)
            for _ in range(20):
                next(loop)
            assert not follows(loop)
            assert missed(loop) >= before + 19
        assert loop.timing.counters["cycles"] > 40


def test_a_receiver_sleeps_until_the_trigger(name: str) -> None:
    """Other programs cannot increase the processor time of this process."""
    with sending_process(name), opened(TriggerReceiver(name)) as loop:
        run_until(loop, lambda: follows(loop))
        before, since = time.process_time(), missed(loop)
        for _ in range(50):
            next(loop)
        assert time.process_time() - before < 0.5 * 50 * PERIOD
        assert missed(loop) - since < 25


def test_it_runs_by_the_clock_without_a_sender_and_follows_a_later_one(name: str) -> None:
    with opened(TriggerReceiver(name)) as loop:
        for _ in range(20):
            next(loop)
        assert not follows(loop)
        assert missed(loop) >= 19
        for _ in range(2):  # the second sender begins with another grid of cycle starts
            with sending(name):
                run_until(loop, lambda: follows(loop))
            before = missed(loop)
            run_until(loop, lambda: not follows(loop))
            for _ in range(20):
                next(loop)
            assert missed(loop) >= before + 19


def test_a_killed_sender_and_its_restart(name: str) -> None:
    with opened(TriggerReceiver(name)) as loop:
        assert not next_change(loop).following
        for _ in range(2):
            with sending_process(name) as process:
                run_until(loop, lambda: follows(loop))
                os.kill(process.pid, signal.SIGKILL)
                process.wait()
            before = missed(loop)
            for _ in range(20):
                next(loop)
            assert not follows(loop)
            assert missed(loop) >= before + 19


def test_changes_are_reported(name: str) -> None:
    with opened(TriggerReceiver(name)) as loop:
        assert "no loop has sent it yet" in next_change(loop).message
        with sending(name):
            assert next_change(loop).following
        lost = next_change(loop)
        assert not lost.following
        assert "no trigger arrives" in lost.message
        assert lost.missed > 0


def test_a_sender_with_another_period_is_not_followed(name: str) -> None:
    with sending(name, period=2 * PERIOD), opened(TriggerReceiver(name)) as loop:
        for _ in range(60):
            next(loop)
        assert missed(loop) >= 59
        assert "period of 20000 us, this loop of 10000 us" in next_change(loop).message


@pytest.mark.parametrize(
    "scheduled", [0, 1, -1, 2**63 - 1, -(2**63)], ids=["zero", "past", "negative", "last", "first"]
)
def test_implausible_cycle_starts_are_ignored(name: str, scheduled: int) -> None:
    memory = open_memory(name).memory
    with opened(TriggerReceiver(name)) as loop:
        for tick in range(1, 40):
            memory[8:24] = struct.pack("<qQ", scheduled, round(PERIOD * 1e9))
            memory[0:4] = struct.pack("<I", tick)
            next(loop)
        assert not follows(loop)
        assert missed(loop) >= 38


def test_the_sender_does_not_wait_for_receivers(name: str) -> None:
    """A receiver that has died leaves `waiting` set."""
    memory = open_memory(name).memory
    memory[4:8] = struct.pack("<I", 1)
    with opened(TriggerSender(name)) as loop:
        for _ in range(20):
            next(loop)
        assert struct.unpack_from("<I", memory, 4) == (0,)
        assert struct.unpack_from("<I", memory, 0)[0] >= 20


def test_a_loop_without_a_trigger_has_no_state_of_it() -> None:
    with opened(None) as loop, pytest.raises(RuntimeError, match="no trigger in this loop"):
        print(loop.networks[0].trigger)


def test_one_loop_sends_a_trigger(name: str) -> None:
    with sending(name), pytest.raises(ShareError, match="another loop already sends"):
        opened(TriggerSender(name)).__enter__()
    with opened(TriggerSender(name)) as loop:
        next(loop)


def test_a_forked_child_does_not_keep_the_trigger(name: str) -> None:
    end, other = os.pipe()
    with opened(TriggerSender(name)):
        child = os.fork()
        if child == 0:
            os.close(other)
            os.read(end, 1)
            os._exit(0)
        with pytest.raises(ShareError, match="another loop already sends"):
            TriggerSender(name).open()
    with opened(TriggerSender(name)) as loop:
        next(loop)
    os.close(other)
    os.close(end)
    assert os.waitpid(child, 0)[1] == 0


@pytest.mark.parametrize("wrong", ["body", TriggerSender])
def test_what_is_not_a_trigger_is_refused(wrong: Any) -> None:
    with pytest.raises(TypeError, match=r"trigger=.*: use cat.share.TriggerSender\(\"name\"\)"):
        opened(wrong).__enter__()


def test_a_loop_that_cannot_be_opened_releases_the_trigger(name: str) -> None:
    with VirtualClock() as clock:
        segment = Segment([Coupler(), Servo()], clock=clock)
        with cat.MainDevice(segment) as main:
            arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
            with pytest.raises(ValueError, match="real time") as caught:
                cat.Loop(arm, trigger=TriggerSender(name)).open()
            assert not hasattr(caught.value, "__notes__")  # such as a failure while leaving
    with opened(TriggerSender(name)) as loop:
        next(loop)


@pytest.mark.parametrize("sends", [False, True])
def test_it_needs_a_thread_and_one_network(name: str, sends: bool) -> None:
    trigger = TriggerSender(name) if sends else TriggerReceiver(name)
    with (
        cat.MainDevice(Segment([Servo()])) as first,
        cat.MainDevice(Segment([Servo()])) as second,
    ):
        upper, lower = (
            cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
            for main in (first, second)
        )
        with pytest.raises(ValueError, match="threaded"):
            cat.Loop(upper, execution="inline", trigger=trigger)
        with pytest.raises(ValueError, match="one network"):
            cat.Loop(upper, lower, trigger=trigger)


def test_a_receiver_follows_no_other_clock(name: str) -> None:
    with cat.MainDevice(Segment([Coupler(), Servo()], clock="monotonic")) as main:
        drives = main.scan().drives
        arm = cat.Drives(drives, counts_per_turn=2**20, velocity_limit=100.0)
        external = cat.ClockOptions(external="CLOCK_TAI")
        with pytest.raises(ValueError, match="cannot follow a trigger and a clock"):
            cat.Loop(arm, clocks=external, trigger=TriggerReceiver(name))
        arm = cat.Drives(drives, counts_per_turn=2**20, velocity_limit=100.0, dc=True)
        with pytest.raises(ConfigurationError, match="distributed clocks"):
            cat.Loop(arm, trigger=TriggerReceiver(name)).open()


@pytest.mark.parametrize("kind", [TriggerSender, TriggerReceiver])
def test_invalid_names_and_files(kind: type, name: str) -> None:
    with pytest.raises(ValueError, match="invalid name"):
        kind("../body")
    path = open_memory(name).path
    path.write_bytes(b"12")
    with pytest.raises(ShareError, match="2 bytes, expected 64"):
        kind(name).open()
