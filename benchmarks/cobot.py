"""What the cobot of `examples/cobot` came to: the published table with ours beside it, the verdict
of the analysis, how well it tracked."""

from __future__ import annotations

import contextlib
import json
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.processor import processor_clock
from benchmarks.tables.published import COBOT, COBOT_UTILISATION
from benchmarks.task_times import FIGURES, TaskTimes, as_table, of_loop, of_task
from catenary import record
from catenary.demo import wire
from catenary.drive import Stop
from catenary.realtime import Demand, Tasks, Verdict, analyse
from catenary.realtime.statistics import measured_demand
from catenary.record.timeline import braking
from catenary.wire.cia402 import STATE_CODING, AxisState

MAIN, PRIORITY = "main control", 90
DEVICES = "virtual devices"
STOP = "stop: "  # how the markers of stops begin; the reason follows
MOVES = 1e-7  # [rad] of the reference in one cycle


class Measured:
    """Owns what the main control measures of itself: how many times faster than real time it was
    (`speed`); on the machine's clock also `executions`, the longest processor times from one look
    to the next [s], of its thread and of the process that plays the devices, where there is one."""

    def __init__(self, *, virtual: bool) -> None:
        devices = None if virtual else child_that_runs(wire.__name__)
        self._clocks = {} if virtual else {MAIN: time.CLOCK_THREAD_CPUTIME_ID}
        if devices is not None:
            self._clocks[DEVICES] = processor_clock(devices)
        self._before: dict[str, float] = {}
        self.executions: dict[str, float] = {}
        self._began = time.perf_counter()
        self.speed = 0.0

    def look(self, cycle_time: float) -> None:
        """Once a cycle, at its end; `cycle_time` [s] of the loop."""
        self.speed = cycle_time / (time.perf_counter() - self._began)
        for name, clock in self._clocks.items():
            now = time.clock_gettime(clock)
            spent = now - self._before.get(name, now)
            if spent > self.executions.get(name, -1.0):
                self.executions[name] = spent
            self._before[name] = now


def child_that_runs(module: str) -> int | None:
    """The process id."""
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # it has ended meanwhile
            parent = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
            words = (folder / "cmdline").read_bytes().split(b"\0")
            if parent == os.getpid() and module.encode() in words:
                return int(folder.name)
    return None


@dataclass(frozen=True)
class Outcome:
    """One run: its recording, timing of its loop, its stops, what it measured, its tasks."""

    path: Path
    timing: Mapping[str, Mapping[str, float]]
    stopped: Sequence[Stop]
    measured: Measured
    tasks: Tasks

    def times(self) -> dict[str, TaskTimes]:
        """Of the tasks and the loop, in the order of the published table."""
        ours = {each.name: of_task(each.statistics) for each in self.tasks}
        ours[MAIN] = of_loop(self.timing)
        return {name: ours[name] for name in COBOT}

    def verdict(self) -> Verdict:
        """Of the tasks and the loop, by the longest execution times measured. On the machine's
        clock with the devices, where they are played here, and a release for every job: timer
        interrupt, wake-up, switch, at most as long as the first task was ever late to start."""
        first, executions = next(iter(self.tasks)), self.measured.executions
        main = executions.get(MAIN, self.timing["in_controller"]["max"])
        others = [(MAIN, main, PRIORITY)]
        if DEVICES in executions:
            others.append((DEVICES, executions[DEVICES], wire.PRIORITY))
        release = first.statistics.jitter.max if executions else 0.0
        demands = [
            *(measured_demand(each.task, each.statistics) for each in self.tasks),
            *(
                Demand(
                    name=name,
                    period=first.task.period,
                    execution=execution,
                    priority=priority,
                    cpu=first.task.cpu,
                )
                for name, execution, priority in others
            ),
        ]
        return analyse([replace(each, execution=each.execution + release) for each in demands])

    def tracking(self) -> float:
        """[deg] rms of reference less actual, of all joints, while the reference moves."""
        recording = record.read(self.path)
        wanted, actual = recording["target_position"], recording["position"]
        moving = abs(np.diff(wanted, axis=0, prepend=wanted[:1])).max(axis=1) > MOVES
        moving &= recording["enabled"].all(axis=1)
        return float(np.degrees(np.sqrt(np.mean((wanted - actual)[moving] ** 2))))


@dataclass(frozen=True)
class Reaction:
    """To a cause that stops the arm: until the frame with quick stop for every axis that is
    enabled. `cycles`: 0, the frame of the cycle that ran; 1, of the first that began after it."""

    reason: str
    cycles: int
    seconds: float  # from the cause to the instant of that cycle's frame


def reactions(recording: record.Recording) -> list[Reaction]:
    """Of every stop that a marker tells of, by the controlwords that were sent. ValueError: no
    quick stop followed."""
    mask, value = STATE_CODING[AxisState.OPERATION_ENABLED]
    moving = (recording["statusword"] & mask) == value
    stopping = (braking(recording) | ~moving).all(axis=1)
    instants = recording["scheduled_ns"].astype(np.int64)
    found = []
    for event in recording.events:
        if event.kind != "Marker" or not event.message.startswith(STOP):
            continue
        cause = round(event.time * 1e9)
        begun = int(np.searchsorted(instants, cause))  # the first cycle that began after it
        running = max(begun - 1, 0)
        if not stopping[running:].any():
            raise ValueError(f"{event.message} at {event.time:.3f} s: no quick stop was sent")
        sent = running + int(stopping[running:].argmax())
        row = recording.rows[sent]
        frame = int(instants[sent] + row["lateness_ns"] + row["receive_ns"] + row["process_ns"])
        found.append(
            Reaction(event.message.removeprefix(STOP), sent - begun + 1, (frame - cause) * 1e-9)
        )
    return found


def report(
    folder: Path, outcome: Outcome, without: Outcome | None = None, *, plots: bool = True
) -> None:
    """Prints it all, beside the run `without` gravity fed forward; writes `cobot.json`, plots."""
    times, verdict = outcome.times(), outcome.verdict()
    answers = reactions(record.read(outcome.path))
    bounds = {each.name: each.response for each in verdict.responses}
    found = {
        "rms_deg": outcome.tracking(),
        "rms_deg_without": without.tracking() if without else None,
        "tasks": [{"name": name, **each._asdict()} for name, each in times.items()],
        "bounds_us": {name: bound and bound * 1e6 for name, bound in bounds.items()},
        "executions_us": {each.name: each.execution * 1e6 for each in verdict.responses},
        "beyond": beyond(times, bounds),
        "utilisation": verdict.utilisation,
        "schedulable": verdict.schedulable,
        "stops": [asdict(each) for each in outcome.stopped],
        "reactions": [asdict(each) for each in answers],
        "times_real_time": outcome.measured.speed,
    }
    print(f"{as_table(times, COBOT)}\n\n{verdict}")
    print(f"published: utilisation {COBOT_UTILISATION:.1%}, schedulable\n")
    print(f"responses beyond the analysis: {', '.join(beyond(times, bounds)) or 'none'}")
    print(f"tracking: {found['rms_deg']:.3f} deg rms")
    if without:
        print(f"without gravity compensation {found['rms_deg_without']:.3f} deg")
    print(f"{outcome.measured.speed:.1f} times real time")
    for each, answer in zip(outcome.stopped, answers, strict=True):
        print(f"stopped in cycle {each.number}, at {each.time:.3f} s: {each.reason}; ", end="")
        print(f"quick stop on the wire {answer.cycles} cycle after its cause, ", end="")
        print(f"{answer.seconds * 1e3:.3f} ms")
    (folder / "cobot.json").write_text(json.dumps(found, indent=1) + "\n")
    for one in filter(None, (outcome, without)) if plots else ():
        plot = one.path.with_suffix(".png")
        record.plot(record.read(one.path), plot, reference="target_position", unit="deg")
        print(f"wrote {plot}")


def beyond(times: Mapping[str, TaskTimes], bounds: Mapping[str, float | None]) -> list[str]:
    """Those whose longest response is longer than the analysis says."""
    found = []
    for name, each in times.items():
        bound, longest = bounds[name], each.response[FIGURES.index("max")]  # [s], [us]
        if bound is None or longest > bound * 1e6:
            found.append(name)
    return found
