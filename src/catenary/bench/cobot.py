"""What the cobot of `examples/cobot` came to: the published table with ours beside it, the verdict
of the analysis, how well it tracked."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from catenary import record
from catenary.bench.tables.published import COBOT, COBOT_UTILISATION
from catenary.bench.task_times import TaskTimes, as_table, of_loop, of_task
from catenary.drive import Stop
from catenary.realtime import Demand, Tasks, Verdict
from catenary.record.timeline import braking
from catenary.wire.cia402 import STATE_CODING, State

MAIN = "main control"
STOP = "stop: "  # how the markers of stops begin; the reason follows
MOVES = 1e-7  # [rad] of the reference in one cycle


@dataclass(frozen=True)
class Outcome:
    """One run: its recording, timing of its loop, its stops, how many times faster than real time
    its loop was, its tasks."""

    path: Path
    timing: Mapping[str, Mapping[str, float]]
    stopped: Sequence[Stop]
    speed: float
    tasks: Tasks

    def times(self) -> dict[str, TaskTimes]:
        """Of the tasks and the loop, in the order of the published table."""
        ours = {each.name: of_task(each.statistics) for each in self.tasks}
        ours[MAIN] = of_loop(self.timing)
        return {name: ours[name] for name in COBOT}

    def verdict(self, period: float = 1e-3, priority: int = 90) -> Verdict:
        """Of the tasks and the loop, by the longest execution times measured."""
        return self.tasks.verdict(
            Demand(
                name=MAIN,
                period=period,
                execution=self.timing["in_controller"]["max"] * 1e-6,
                priority=priority,
                cpu=next(iter(self.tasks)).task.cpu,
            )
        )

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
    mask, value = STATE_CODING[State.OPERATION_ENABLED]
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


def report(outcome: Outcome, without: Outcome, folder: Path, *, plots: bool = True) -> None:
    """Prints it all, beside the run `without` gravity fed forward; writes `cobot.json`, plots."""
    times, verdict = outcome.times(), outcome.verdict()
    answers = reactions(record.read(outcome.path))
    found = {
        "rms_deg": outcome.tracking(),
        "rms_deg_without": without.tracking(),
        "tasks": [{"name": name, **each._asdict()} for name, each in times.items()],
        "utilisation": verdict.utilisation,
        "schedulable": verdict.schedulable,
        "stops": [asdict(each) for each in outcome.stopped],
        "reactions": [asdict(each) for each in answers],
        "times_real_time": outcome.speed,
    }
    print(f"{as_table(times, COBOT)}\n\n{verdict}")
    print(f"published: utilisation {COBOT_UTILISATION:.1%}, schedulable\n")
    print(f"tracking: {found['rms_deg']:.3f} deg rms", end="; ")
    print(f"without gravity compensation {found['rms_deg_without']:.3f} deg")
    print(f"{outcome.speed:.1f} times real time")
    for each, answer in zip(outcome.stopped, answers, strict=True):
        print(f"stopped in cycle {each.number}, at {each.time:.3f} s: {each.reason}; ", end="")
        print(f"quick stop on the wire {answer.cycles} cycle after its cause, ", end="")
        print(f"{answer.seconds * 1e3:.3f} ms")
    (folder / "cobot.json").write_text(json.dumps(found, indent=1) + "\n")
    for path in (outcome.path, without.path) if plots else ():
        plot = path.with_suffix(".png")
        record.plot(record.read(path), plot, reference="target_position", unit="deg")
        print(f"wrote {plot}")
