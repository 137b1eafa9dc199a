"""Results of the cobot of `examples/cobot`: timing next to the published table, the verdict of the
schedulability analysis, and the tracking error."""

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
STOP = "stop: "  # prefix of the markers of stops; the reason follows
MOVES = 1e-7  # [rad] smallest step of a moving reference in one cycle


class Measured:
    """Owns the measurements of the main control about itself.

    `speed` is the ratio of loop time to real time. On the machine's clock, `executions` holds the
    longest processor time per cycle [s] of its thread and of the process of the virtual devices.
    """

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
        """Measure at the end of a cycle. `cycle_time` [s] is the time of the loop."""
        self.speed = cycle_time / (time.perf_counter() - self._began)
        for name, clock in self._clocks.items():
            now = time.clock_gettime(clock)
            spent = now - self._before.get(name, now)
            if spent > self.executions.get(name, -1.0):
                self.executions[name] = spent
            self._before[name] = now


def child_that_runs(module: str) -> int | None:
    """Return the ID of the child process that runs a module; None if there is none."""
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # the process has ended
            parent = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
            words = (folder / "cmdline").read_bytes().split(b"\0")
            if parent == os.getpid() and module.encode() in words:
                return int(folder.name)
    return None


@dataclass(frozen=True)
class Outcome:
    """Results of one run: recording, timing of the loop, stops, measurements and tasks."""

    path: Path
    timing: Mapping[str, Mapping[str, float]]
    stopped: Sequence[Stop]
    measured: Measured
    tasks: Tasks

    def times(self) -> dict[str, TaskTimes]:
        """Return the times of the tasks and the loop, in the order of the published table."""
        ours = {each.name: of_task(each.statistics) for each in self.tasks}
        ours[MAIN] = of_loop(self.timing)
        return {name: ours[name] for name in COBOT}

    def verdict(self) -> Verdict:
        """Return the verdict on the tasks and the loop, by their longest execution times.

        On the machine's clock, the virtual devices count as a task, and each job has a release
        cost: timer interrupt, wake-up and switch. Its bound is the largest start jitter of the
        first task.
        """
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
        """Return the rms tracking error of all joints while the reference moves [deg]."""
        recording = record.read(self.path)
        wanted, actual = recording["target_position"], recording["position"]
        moving = abs(np.diff(wanted, axis=0, prepend=wanted[:1])).max(axis=1) > MOVES
        moving &= recording["enabled"].all(axis=1)
        return float(np.degrees(np.sqrt(np.mean((wanted - actual)[moving] ** 2))))


@dataclass(frozen=True)
class Reaction:
    """Reaction to a cause that stops the arm: a frame with a quick stop for all enabled axes.

    `cycles` is 0 for the frame of the running cycle, and 1 for the first cycle that began later.
    """

    reason: str
    cycles: int
    seconds: float  # from the cause to the sending of that frame


def reactions(recording: record.Recording) -> list[Reaction]:
    """Return the reaction to each marked stop, from the controlwords that were sent.

    Raises:
        ValueError: No quick stop followed.
    """
    mask, value = STATE_CODING[AxisState.OPERATION_ENABLED]
    moving = (recording["statusword"] & mask) == value
    stopping = (braking(recording) | ~moving).all(axis=1)
    instants = recording["scheduled_ns"].astype(np.int64)
    found = []
    for event in recording.events:
        if event.kind != "Marker" or not event.message.startswith(STOP):
            continue
        cause = round(event.time * 1e9)
        begun = int(np.searchsorted(instants, cause))  # first cycle that began later
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
    """Print the results, and write `cobot.json` and plots.

    Args:
        folder: Folder for the files.
        outcome: Results of the run.
        without: Results of a run without gravity compensation.
        plots: True to plot the recordings.
    """
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
        print(f"quick stop on the wire {answer.cycles} cycles after its cause, ", end="")
        print(f"{answer.seconds * 1e3:.3f} ms")
    (folder / "cobot.json").write_text(json.dumps(found, indent=1) + "\n")
    for one in filter(None, (outcome, without)) if plots else ():
        plot = one.path.with_suffix(".png")
        record.plot(record.read(one.path), plot, reference="target_position", unit="deg")
        print(f"wrote {plot}")


def beyond(times: Mapping[str, TaskTimes], bounds: Mapping[str, float | None]) -> list[str]:
    """Return the names whose longest response exceeds the bound of the analysis."""
    found = []
    for name, each in times.items():
        bound, longest = bounds[name], each.response[FIGURES.index("max")]  # [s], [us]
        if bound is None or longest > bound * 1e6:
            found.append(name)
    return found
