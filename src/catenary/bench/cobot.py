"""What the cobot of `examples/cobot` came to: the published table with ours beside it, the verdict
of the analysis, how well it tracked."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from catenary import record
from catenary.bench.published import (
    COBOT,
    COBOT_UTILISATION,
    TaskTimes,
    as_table,
    of_loop,
    of_task,
)
from catenary.realtime import Demand, Tasks, Verdict

MAIN = "main control"
MOVES = 1e-7  # [rad] of the reference in one cycle


@dataclass(frozen=True)
class Outcome:
    """One run: its recording, timing of its loop, its stops (cycle, [s], reason), how many times
    faster than real time its loop was, its tasks."""

    path: Path
    timing: Mapping[str, Mapping[str, float]]
    stopped: Sequence[tuple[int, float, str]]
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


def report(outcome: Outcome, without: Outcome, folder: Path, *, plots: bool = True) -> None:
    """Prints it all, beside the run `without` compensation; writes `cobot.json` and the plots."""
    times, verdict = outcome.times(), outcome.verdict()
    found = {
        "rms_deg": outcome.tracking(),
        "rms_deg_without": without.tracking(),
        "tasks": [{"name": name, **each._asdict()} for name, each in times.items()],
        "utilisation": verdict.utilisation,
        "schedulable": verdict.schedulable,
        "stops": list(outcome.stopped),
        "times_real_time": outcome.speed,
    }
    print(f"{as_table(times, COBOT)}\n\n{verdict}")
    print(f"published: utilisation {COBOT_UTILISATION:.1%}, schedulable\n")
    print(f"tracking: {found['rms_deg']:.3f} deg rms", end="; ")
    print(f"without compensation {found['rms_deg_without']:.3f} deg")
    print(f"{outcome.speed:.1f} times real time")
    for number, seconds, reason in outcome.stopped:
        print(f"stopped in cycle {number}, at {seconds:.3f} s: {reason}")
    (folder / "cobot.json").write_text(json.dumps(found, indent=1) + "\n")
    for path in (outcome.path, without.path) if plots else ():
        plot = path.with_suffix(".png")
        record.plot(record.read(path), plot, reference="target_position", unit="deg")
        print(f"wrote {plot}")
