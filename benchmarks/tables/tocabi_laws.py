"""Variants of the table `tocabi` with a law on each network, next to a 1 kHz Python task.

- `law`: a process with a loop for each network.
- `triggered`: the same, but the second loop starts its cycles with those of the first. This is the
  published design.
- `laws`: one process, with one loop over both networks.
"""

from __future__ import annotations

import contextlib
import os
import signal
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec

from benchmarks.network_law import GO, GO_TIMEOUT
from benchmarks.networks import NetworkRound
from benchmarks.processor import processor_time
from benchmarks.tasks import compute_little
from catenary.bench.job import Job
from catenary.bench.rounds import BRING_UP_SECONDS, RoundError
from catenary.bench.segment import Served, processors
from catenary.realtime import Statistics, Task, Tasks, session
from catenary.realtime.child import Child, start_python
from catenary.share.trigger import open_memory

NETWORKS = ("upper", "lower")
LAW, TRIGGERED, LAWS = "law", "triggered", "laws"
LOOKED_AT = 0.8  # fraction of the measurement in which processor shares are measured
TASK_PERIOD, TASK_PRIORITY = 1e-3, 60  # below loops and segments


@dataclass(frozen=True, slots=True)
class Places:
    """Segments and folder of a variant."""

    segments: Sequence[Served]
    folder: Path


@dataclass(slots=True)
class WayRounds:
    """Owns the results of one variant, round by round."""

    networks: list[list[NetworkRound]]
    task: list[Statistics]  # of the Python task; empty without one
    shares: list[dict[str, float]]  # processor shares by process; empty if not measured


@dataclass(frozen=True, slots=True)
class Program:
    """Process with a loop: its name, the jobs of its networks, and its trigger."""

    name: str
    jobs: Sequence[Job]
    trigger: str = ""  # "send:NAME", "await:NAME"; empty: none


def two_processes(jobs: Sequence[Job], places: Places, found: WayRounds) -> None:
    programs = [
        Program(f"{LAW}, {network}", [job]) for network, job in zip(NETWORKS, jobs, strict=True)
    ]
    run(programs, places, found)


def triggered_process(jobs: Sequence[Job], places: Places, found: WayRounds) -> None:
    name = f"bench-{os.getpid()}"
    upper, lower = jobs
    programs = [
        Program(f"{TRIGGERED}, upper", [upper], f"send:{name}"),
        Program(f"{TRIGGERED}, lower", [lower], f"await:{name}"),
    ]
    try:
        run(programs, places, found)
    finally:
        open_memory(name).path.unlink()


def one_process(
    jobs: Sequence[Job],
    places: Places,
    found: WayRounds,
    beside: Callable[[], Tasks] | None = None,
) -> None:
    run([Program(LAWS, jobs)], places, found, beside)


def run(
    programs: Sequence[Program],
    places: Places,
    found: WayRounds,
    beside: Callable[[], Tasks] | None = None,
) -> None:
    """Measure all loops while the tasks of `beside` run; None: the Python task."""
    first = programs[0].jobs[0]
    measured = first.cycles * first.period_ns * 1e-9
    with contextlib.ExitStack() as stack:
        children = [stack.enter_context(start(program)) for program in programs]
        for child in children:
            expect(child, GO_TIMEOUT, "here")
        tasks = stack.enter_context((beside or python_task)())
        go(children)
        for child in children:
            expect(child, GO_TIMEOUT, "ready")
        processes = processes_of(programs, children, places)
        before = [each.statistics for each in tasks]  # excludes the start of the loops
        go(children)
        took = shares(processes, LOOKED_AT * measured)
        outputs = [expect(child, BRING_UP_SECONDS + measured, "[") for child in children]
        after = [each.statistics for each in tasks]
    found.task += [since(*each) for each in zip(after, before, strict=True)]
    found.shares.append(took)
    rounds = [msgspec.json.decode(each, type=list[NetworkRound]) for each in outputs]
    found.networks.append([network for each in rounds for network in each])


def since(statistics: Statistics, before: Statistics) -> Statistics:
    """Return statistics with the counts since an earlier reading."""
    return replace(
        statistics,
        jobs=statistics.jobs - before.jobs,
        misses=statistics.misses - before.misses,
        skipped=statistics.skipped - before.skipped,
    )


def processes_of(
    programs: Sequence[Program], children: Sequence[Child], places: Places
) -> dict[str, int]:
    """Return the process IDs of the programs and of the segments, by name."""
    segments = zip(NETWORKS, places.segments, strict=True)
    return {
        **{each.name: child.pid for each, child in zip(programs, children, strict=True)},
        **{f"segment, {network}": segment.pid for network, segment in segments},
    }


def shares(processes: Mapping[str, int], seconds: float) -> dict[str, float]:
    """Return the share of a processor that each process uses.

    Args:
        processes: Process IDs by name.
        seconds: Duration of the measurement [s].
    """
    before = {name: processor_time(pid) for name, pid in processes.items()}
    start = time.monotonic()
    time.sleep(seconds)
    passed = time.monotonic() - start
    return {
        name: round((processor_time(pid) - before[name]) / passed, 4)
        for name, pid in processes.items()
    }


def start(program: Program) -> Child:
    """Start the process of a loop. All its threads inherit a blocked GO signal."""
    jobs = msgspec.json.encode(program.jobs).decode()
    arguments = ["-m", "benchmarks.network_law", jobs]
    if program.trigger:
        arguments.append(program.trigger)
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {GO})
    try:
        return start_python(arguments)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def python_task() -> Tasks:
    return Tasks(
        Task(
            compute_little,
            name="python",
            period=TASK_PERIOD,
            priority=TASK_PRIORITY,
            cpu=processors().masters,
        ),
        workers="processes",
        session=session(best_effort=True),
        best_effort=True,
    )


def go(children: Sequence[Child]) -> None:
    for child in children:
        os.kill(child.pid, GO)


def expect(child: Child, seconds: float, start: str) -> str:
    output = child.read_line(seconds)
    if output is None or not output.startswith(start):
        raise RoundError(f"a loop with a law failed: {output or 'no output'}")
    return output
