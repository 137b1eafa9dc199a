"""`python -m benchmarks table tasks`: three busy tasks, 3, 5 and 10 ms every 10, 20 and 40 ms.

The tasks run in C and in Python, without and with stress-ng, next to the bounds of a response-time
analysis. A job occupies the processor with two parts:

- Its release: timer interrupt, wake-up and switch. They are not charged to a thread. The bound is
  the largest start jitter of the first task, which is never preempted.
- The processor time of its thread from one start to the next, which includes its end and waiting.

The analysis assumes fixed priorities. It does not hold for threads that share the GIL.
"""

from __future__ import annotations

import subprocess
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import asdict, dataclass
from pathlib import Path
from shutil import which
from typing import Literal

import numpy as np

from benchmarks.compiler import compile_peer, has_programs
from benchmarks.tables.published import TASKS, TASKS_CONDITIONS, Times, spread_of
from benchmarks.tables.sheet import Options, Sheet, grid, slashed
from catenary.bench.loop import show_progress
from catenary.bench.segment import processors
from catenary.errors import CatenaryError
from catenary.realtime import (
    Demand,
    Running,
    Statistics,
    Task,
    Tasks,
    Value,
    analyse,
    session,
)
from catenary.realtime.child import start_program

SECONDS = 10.0
NAMES = ("tau1", "tau2", "tau3")
PERIODS, EXECUTIONS, PRIORITIES = (10e-3, 20e-3, 40e-3), (3e-3, 5e-3, 10e-3), (30, 20, 10)
FIGURES = ("period", "jitter", "response")
C, PROCESSES, THREADS = "C", "Python, processes", "Python, threads"
IDLE, STRESS = "idle", "stress"
STRESSORS = ("--cpu", "0", "--cpu-load", "100", "--vm", "1", "--vm-bytes", "70%", "--quiet")
HEADER = ("mean/max/min/sd [ms]", "", "period", "response", "bound", "within", "jobs missed")


@dataclass(frozen=True, slots=True)
class Found:
    """Results of one task in one variant. Figures are mean, max, min, sd and p50 [ms]."""

    name: str
    jobs: int
    missed: int  # number of jobs that ended after the period
    figures_ms: Mapping[str, Mapping[str, float]]
    execution_ms: float  # longest processor time from one start to the next

    def times(self) -> Times:
        return Times(*(spread_of(self.figures_ms[name]) for name in ("period", "response")))


def measure(options: Options) -> Sheet:
    seconds = options.seconds or SECONDS
    ways, left_out = [C, PROCESSES, THREADS], []
    if not has_programs():
        ways.remove(C)
        left_out.append("C: no C compiler (sudo apt install gcc libc6-dev)")
    loads = [IDLE, STRESS]
    if which("stress-ng") is None:
        loads.remove(STRESS)
        left_out.append("under stress: stress-ng is not installed (sudo apt install stress-ng)")
    found = run_all(loads, ways, seconds)
    return Sheet(
        title=f"Three spinning tasks; {TASKS_CONDITIONS}",
        conditions=f"ours: on CPU {processors().masters or 0}, SCHED_FIFO if permitted, "
        f"{seconds:g} s of each; stress-ng {' '.join(STRESSORS[:-1])}",
        text="\n\n".join(as_table(load, found) for load in (IDLE, STRESS)),
        figures={
            "published": {
                " ".join(which): [t._asdict() for t in each] for which, each in TASKS.items()
            },
            "seconds": seconds,
            "nominal_bounds_ms": bounds(EXECUTIONS),
            "ways": [
                {
                    "load": load,
                    "way": way,
                    "tasks": [asdict(each) for each in tasks],
                    "bounds_ms": measured_bounds(tasks),
                }
                for (load, way), tasks in found.items()
            ],
        },
        left_out=left_out,
    )


def run_all(
    loads: Sequence[str], ways: Sequence[str], seconds: float
) -> dict[tuple[str, str], list[Found]]:
    found = {}
    for load in loads:
        with stressed() if load == STRESS else nullcontext():
            for number, way in enumerate(ways):
                show_progress(f"{way}, {load}", number + 1, len(ways))
                found[load, way] = run(way, seconds)
    return found


@contextmanager
def stressed() -> Iterator[None]:
    """Run stress-ng during the block, with ordinary scheduling."""
    with start_program(["stress-ng", *STRESSORS]):
        yield


def run(way: str, seconds: float) -> list[Found]:
    if way == C:
        return run_c(seconds)
    return run_python("processes" if way == PROCESSES else "threads", seconds)


def run_c(seconds: float) -> list[Found]:
    with tempfile.TemporaryDirectory(prefix="catenary-bench-") as name:
        program, file = compile_peer("three_tasks", Path(name)), Path(name, "samples")
        cpu = processors().masters
        words = [str(-1 if cpu is None else cpu), str(seconds), str(file)]
        for period, execution, priority in zip(PERIODS, EXECUTIONS, PRIORITIES, strict=True):
            words += [str(round(period * 1e9)), str(round(execution * 1e9)), str(priority)]
        done = subprocess.run(
            [program, *words],
            capture_output=True,
            text=True,
            timeout=60 + 10 * seconds,
            check=False,
        )
        if done.returncode:
            raise CatenaryError(f"the three tasks in C failed: {done.stderr.strip()}")
        return read_samples(np.fromfile(file, np.int64))


def read_samples(numbers: np.ndarray) -> list[Found]:
    """Return the results of all tasks from the output of the C program.

    `numbers` holds, for each task, the number of jobs, and for each job the figures and the
    processor time [ns].
    """
    found = []
    width = len(FIGURES) + 1
    for name, period in zip(NAMES, PERIODS, strict=True):
        jobs, numbers = int(numbers[0]), numbers[1:]
        samples = numbers[: jobs * width].reshape(jobs, width) * 1e-6
        numbers = numbers[jobs * width :]
        columns = dict(zip(FIGURES, samples.T[:-1], strict=True))
        columns["period"] = columns["period"][1:] if jobs > 1 else columns["period"]
        missed = int(np.count_nonzero(columns["response"] > period * 1e3))
        of_ms = {figure: figures(values) for figure, values in columns.items()}
        found.append(Found(name, jobs, missed, of_ms, round(float(samples[:, -1].max()), 6)))
    return found


def figures(values: np.ndarray) -> dict[str, float]:
    found = {"mean": values.mean(), "max": values.max(), "min": values.min(), "sd": values.std()}
    found["p50"] = np.median(values)
    return {name: round(float(value), 6) for name, value in found.items()}


def run_python(way: Literal["processes", "threads"], seconds: float) -> list[Found]:
    cpu = processors().masters
    most = [Value("f8") for _ in NAMES]
    tasks = Tasks(
        *(
            Task(spin, (execution, its), name=name, period=period, priority=priority, cpu=cpu)
            for name, period, execution, priority, its in zip(
                NAMES, PERIODS, EXECUTIONS, PRIORITIES, most, strict=True
            )
        ),
        workers=way,
        session=session(best_effort=True),
        best_effort=True,
    )
    with tasks:
        tasks.join(seconds)
    return [
        of_statistics(tasks[name].statistics, float(its.read()))
        for name, its in zip(NAMES, most, strict=True)
    ]


def spin(task: Running, seconds: float, most: Value) -> None:
    """Spend processor time in every job.

    Args:
        task: The running task.
        seconds: Processor time of each job [s].
        most: Set to the longest processor time from one start to the next [s].
    """
    before, longest = None, 0.0
    for _job in task:
        start = time.thread_time()
        if before is not None and start - before > longest:
            longest = start - before
            most.write(longest)
        before = start
        while time.thread_time() < start + seconds:
            sum(range(100))


def of_statistics(found: Statistics, most: float) -> Found:
    of_ms = {
        figure: {
            each: round(getattr(getattr(found, figure), each) * 1e3, 6)
            for each in ("mean", "max", "min", "sd", "p50")
        }
        for figure in FIGURES
    }
    longest = max(most, found.execution.max) * 1e3
    return Found(found.name, found.jobs, found.misses, of_ms, round(longest, 6))


# The analysis


def bounds(executions: Sequence[float]) -> list[float | None]:
    """Return the bounds of the responses [ms], from the analysis; None for an unbounded one."""
    verdict = analyse(
        [
            Demand(name=name, period=period, execution=execution, priority=priority)
            for name, period, execution, priority in zip(
                NAMES, PERIODS, executions, PRIORITIES, strict=True
            )
        ]
    )
    by_name = {each.name: each.response for each in verdict.responses}
    return [None if (found := by_name[name]) is None else found * 1e3 for name in NAMES]


def measured_bounds(tasks: Sequence[Found]) -> list[float | None]:
    release = tasks[0].figures_ms["jitter"]["max"]
    return bounds([(each.execution_ms + release) * 1e-3 for each in tasks])


# Text output


def as_table(load: str, found: Mapping[tuple[str, str], Sequence[Found]]) -> str:
    rows = []
    nominal = bounds(EXECUTIONS)
    for (published, language), tasks in TASKS.items():
        if published == load:
            rows += [
                [*row(f"theirs: {language}" if k == 0 else "", NAMES[k], times, nominal[k]), "", ""]
                for k, times in enumerate(tasks)
            ]
    for (measured, way), ours in found.items():
        if measured == load:
            limits = measured_bounds(ours)
            rows += [
                [
                    *row(way if k == 0 else "", each.name, each.times(), limits[k]),
                    within(each, limits[k]),
                    f"{each.missed} of {each.jobs}",
                ]
                for k, each in enumerate(ours)
            ]
    return f"{load}\n{grid(HEADER, rows)}"


def row(way: str, name: str, times: Times, bound: float | None) -> list[str]:
    texts = [slashed(each, 3) for each in times]
    return [way, name, *texts, "none" if bound is None else f"{bound:.3f}"]


def within(found: Found, bound: float | None) -> str:
    return "no" if bound is None or found.times().response.max > bound else "yes"
