"""`python -m benchmarks table interrupt`: reaction time of a waiting task to an event.

An eventfd and a timer stand in for the published GPIO interrupt, as the wake-up by a driver. The
value of an event is its time, which the waiting process reads. If two events arrive before it runs,
their values add up. Such events are omitted and counted.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from benchmarks.compiler import compile_peer, has_programs
from benchmarks.tables.sheet import Options, Sheet, grid
from catenary.bench.loop import show_progress
from catenary.bench.segment import processors
from catenary.bench.statistics import summarise
from catenary.errors import CatenaryError
from catenary.realtime import Running, Signal, Task, Tasks, session
from catenary.realtime.child import start_python
from catenary.realtime.system.scheduling import request_scheduling

SECONDS, PERIOD = 2.0, 1e-3
PRIORITY, BELOW = 80, 10  # of the waiting thread; the source of events is lower by BELOW
C, PYTHON, TASK = "C", "Python", "Python, sporadic task"
EVENT, TIMER, SIGNAL = "eventfd", "timerfd", "realtime.Signal"
PUBLISHED = "theirs waits for a GPIO; its figures are not available"
TFD_TIMER_ABSTIME = 1  # sys/timerfd.h
LAST = 2**62  # last event of the source; ends the wait for events that were added up
COLUMNS = ("mean", "max", "min", "sd", "p50", "p99")


@dataclass(frozen=True, slots=True)
class Found:
    events: int
    left_out: int
    reaction_us: dict[str, float]


def measure(options: Options) -> Sheet:
    seconds = options.seconds or SECONDS
    count = max(round(seconds / PERIOD), 2)
    ways = [(C, EVENT), (PYTHON, EVENT), (TASK, SIGNAL), (C, TIMER), (PYTHON, TIMER)]
    left_out = []
    if not has_programs():
        ways = [way for way in ways if way[0] != C]
        left_out.append("C: no C compiler (sudo apt install gcc libc6-dev)")
    found = {}
    for number, (who, event) in enumerate(ways):
        show_progress(f"{who}, {event}", number + 1, len(ways))
        found[who, event] = run(who, event, count)
    rows = [row(who, event, each) for (who, event), each in found.items()]
    return Sheet(
        title=f"Reaction of a waiting task to an event; {PUBLISHED}",
        conditions=f"ours: {count} events, one every {PERIOD * 1e3:g} ms; the waiting thread has "
        f"SCHED_FIFO {PRIORITY} if permitted, on the processor of the event source",
        text=grid(("from event to running [us]", "", *COLUMNS, "events"), rows),
        figures={
            "published": PUBLISHED,
            "period": PERIOD,
            "ways": [
                {
                    "who": who,  # words: ok
                    "event": event,
                    "events": each.events,
                    "left_out": each.left_out,
                    "reaction_us": each.reaction_us,
                }
                for (who, event), each in found.items()
            ],
        },
        left_out=left_out,
    )


def run(who: str, event: str, count: int) -> Found:
    if who == TASK:
        return run_task(count)
    with tempfile.TemporaryDirectory(prefix="catenary-bench-") as name:
        file = Path(name, "samples")
        if who == C:
            run_c(event, count, compile_peer("reaction", Path(name)), file)
        else:
            run_python(event, count, file)
        return of_samples(np.fromfile(file, np.int64))


def of_samples(reactions_ns: npt.NDArray[np.int64]) -> Found:
    """Return the figures of the reaction times; -1 marks an unknown one."""
    good = reactions_ns[reactions_ns >= 0]
    if not len(good):
        raise CatenaryError(
            "no event arrived alone: this machine is too busy to measure a reaction"
        )
    return Found(
        len(good), len(reactions_ns) - len(good), summarise(np.asarray(good * 1e-3, np.float64))
    )


def run_c(event: str, count: int, program: Path, file: Path) -> None:
    cpu = processors().masters
    words = [event, str(-1 if cpu is None else cpu), str(PRIORITY), str(count)]
    done = subprocess.run(
        [program, *words, str(round(PERIOD * 1e9)), str(file)],
        capture_output=True,
        text=True,
        timeout=60 + 10 * count * PERIOD,
        check=False,
    )
    if done.returncode:
        raise CatenaryError(f"the C program failed: {done.stderr.strip()}")
    raw = np.fromfile(file, np.int64)
    np.where((raw >= 0) & (raw < 10**12), raw, -1).tofile(file)


def run_python(event: str, count: int, file: Path) -> None:
    with start_python(["-m", __name__, event, str(count), str(file)]) as worker:
        output = worker.read_line(60 + 10 * count * PERIOD)
    if output != "done":
        raise CatenaryError(f"the waiting process failed: {output or 'no output'}")


def run_task(count: int) -> Found:
    """Measure a task of `catenary.realtime` that sleeps until a signal is set.

    The reaction time is its jitter: the time from the signal to its start.
    """
    signal, cpu = Signal(), processors().masters
    waiting = Task(
        nothing, name="waiting", period=PERIOD / 4, priority=PRIORITY, cpu=cpu, trigger=signal
    )
    making = Task(
        make_signals, (signal,), name="making", period=PERIOD, priority=PRIORITY - BELOW, cpu=cpu
    )
    with Tasks(waiting, making, session=session(best_effort=True), best_effort=True) as tasks:
        tasks.join(count * PERIOD)
        jitter = tasks["waiting"].statistics.jitter
    figures = {name: round(getattr(jitter, name) * 1e6, 3) for name in (*COLUMNS, "p999")}
    return Found(jitter.count, 0, figures)


def nothing(task: Running) -> None:
    for _job in task:
        pass


def make_signals(task: Running, signal: Signal) -> None:
    for _job in task:
        signal.set()


def row(who: str, event: str, found: Found) -> list[str]:
    figures = [f"{found.reaction_us[name]:.1f}" for name in COLUMNS]
    return [who, event, *figures, str(found.events)]


# The waiting process, and the source of its events


def main(arguments: Sequence[str]) -> None:
    event, count = arguments[0], int(arguments[1])
    if event == "make":
        return make_events(int(arguments[2]), count)
    request_scheduling(priority=PRIORITY, cpu=processors().masters)
    samples = wait_for_timer(count) if event == TIMER else wait_for_events(count)
    samples.tofile(arguments[2])
    print("done", flush=True)


def wait_for_events(count: int) -> npt.NDArray[np.int64]:
    reactions = np.full(count, -1, np.int64)
    event = os.eventfd(0, 0)  # inheritable
    command = [sys.executable, "-m", __spec__.name, "make", str(count), str(event)]
    with subprocess.Popen(command, pass_fds=[event]) as maker:
        for number in range(count):
            value = os.eventfd_read(event)
            now = time.monotonic_ns()
            if value <= now:  # one event; the sum of two is in the future
                reactions[number] = now - value
            if value >= LAST:
                break
        maker.kill()
    return reactions


def make_events(event: int, count: int) -> None:
    request_scheduling(priority=PRIORITY - BELOW, cpu=processors().masters)
    instant = time.monotonic()
    for _ in range(count):
        instant += PERIOD
        time.sleep(max(instant - time.monotonic(), 0.0))
        os.eventfd_write(event, time.monotonic_ns())
    time.sleep(PERIOD)
    os.eventfd_write(event, LAST)


class Timespec(ctypes.Structure):
    _fields_ = (("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long))


def wait_for_timer(count: int) -> npt.NDArray[np.int64]:
    """Return the reaction times to a timer [ns], by ctypes: `os.timerfd_create` needs 3.13."""
    libc = ctypes.CDLL(None, use_errno=True)
    period = round(PERIOD * 1e9)
    reactions = np.full(count, -1, np.int64)
    timer = libc.timerfd_create(time.CLOCK_MONOTONIC, 0)
    expiry = time.monotonic_ns()
    setting = (Timespec * 2)(Timespec(*divmod(period, 10**9)), at(expiry + period))
    if timer < 0 or libc.timerfd_settime(timer, TFD_TIMER_ABSTIME, setting, None):
        raise OSError(ctypes.get_errno(), "timerfd")
    for number in range(count):
        expired = int.from_bytes(os.read(timer, 8), sys.byteorder)
        now = time.monotonic_ns()
        expiry += expired * period
        reactions[number] = now - expiry
    os.close(timer)
    return reactions


def at(instant_ns: int) -> Timespec:
    return Timespec(*divmod(instant_ns, 10**9))


if __name__ == "__main__":
    main(sys.argv[1:])
