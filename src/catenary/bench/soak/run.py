"""`catenary bench soak`: faults of all kinds by chance, in virtual time, against a running loop."""

from __future__ import annotations

import time
import traceback
from dataclasses import dataclass, field, fields
from pathlib import Path

from catenary.bench.loop import write
from catenary.bench.report import machine
from catenary.bench.soak.minute import Figures, Minute
from catenary.bench.soak.witness import Violation

MINUTE = 60.0  # [s] of virtual time on one segment
SHOWN = 3  # incidents before a violation


@dataclass(slots=True)
class Found:
    """One violation and how to see it again."""

    seed: int
    seconds: float
    violation: Violation
    incidents: list[str]

    def __str__(self) -> str:
        minutes = self.seconds / MINUTE
        again = f"    catenary bench soak --minutes {minutes:g} --seed {self.seed}"
        return "\n".join([f"  {self.violation}", *self.incidents, again])


@dataclass(slots=True)
class Soaked:
    """What came of it."""

    figures: Figures = field(default_factory=Figures)
    violations: list[Found] = field(default_factory=list)
    digests: list[str] = field(default_factory=list)

    def add(self, minute: Minute, seed: int, seconds: float) -> None:
        self.figures.add(minute.figures)
        self.digests.append(minute.digest)
        for violation in minute.violations:
            before = [each for each in minute.incidents if each[0] <= violation.time][-SHOWN:]
            told = [f"    {when:9.4f} s  {incident}" for when, incident in before]
            self.violations.append(Found(seed, seconds, violation, told))


def measure(*, minutes: float, seed: int, file: Path | None) -> bool:
    """Prints what happened; whether all held. Minute k is that of seed + k: each can be seen again
    by itself."""
    start = time.perf_counter()
    soaked = soak(minutes * MINUTE, seed)
    took = time.perf_counter() - start
    speed = minutes * MINUTE / took
    print(f"{machine()}\n{minutes:g} minutes of virtual time, seed {seed}, {speed:.1f} times real")
    print(as_text(soaked))
    write(
        file,
        {
            "machine": machine(),
            "minutes": minutes,
            "seed": seed,
            "times_real_time": round(speed, 2),
            **{each.name: getattr(soaked.figures, each.name) for each in fields(Figures)},
            "digests": soaked.digests,
            "violations": [str(found) for found in soaked.violations],
        },
    )
    return not soaked.violations


def soak(seconds: float, seed: int) -> Soaked:
    """Minute by minute."""
    soaked = Soaked()
    left = seconds
    while left > 1e-6:
        part = min(left, MINUTE)
        soaked.add(soaked_minute(seed, part), seed, part)
        left -= part
        seed += 1
    return soaked


def soaked_minute(seed: int, seconds: float) -> Minute:
    """What is no CatenaryError is a mistake of ours, and a violation."""
    minute = Minute(seed, seconds)
    try:
        minute.run()
    except Exception:
        minute.witness.tell("errors are CatenaryErrors", traceback.format_exc())
    return minute


def as_text(soaked: Soaked) -> str:
    figures = soaked.figures
    lines = [
        f"{figures.cycles} cycles in {figures.loops} loops, {figures.not_ok} not ok; "
        f"{figures.objects} objects read",
        f"{figures.incidents} incidents, all well again within {figures.longest_return:.3f} s",
        f"faults: {_counted(figures.faults)}",
        f"frames lost: {_counted(figures.losses)}",
        f"loops ended: {_counted(figures.ended)}",
        f"{len(soaked.violations)} violations",
    ]
    return "\n".join([*lines, *map(str, soaked.violations)])


def _counted(counter: dict[str, int]) -> str:
    return ", ".join(f"{number} {name}" for name, number in sorted(counter.items())) or "none"
