"""`python -m benchmarks soak`: random faults of all kinds on a running loop, in virtual time."""

from __future__ import annotations

import time
import traceback
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path

from benchmarks.soak.minute import Figures, Minute
from benchmarks.soak.setting import Setting, setting_of, settings
from benchmarks.soak.witness import Violation
from catenary.bench.loop import write
from catenary.bench.report import machine

ALL_SETTINGS = settings()
MINUTE = 60.0  # [s] of virtual time on one segment
SHOWN = 3  # incidents before a violation


@dataclass(slots=True)
class Found:
    """One violation, and the command that repeats it."""

    minute: int  # of the soak, from 1
    seed: int  # of this minute
    seconds: float
    setting: Setting
    violation: Violation
    incidents: list[str]

    @property
    def command(self) -> str:
        """Command that repeats this minute alone."""
        minutes = f"--minutes {self.seconds / MINUTE:g} --seed {self.seed}"
        return f"python -m benchmarks soak {minutes} {self.setting.options}"

    def __str__(self) -> str:
        where = f"  minute {self.minute}, seed {self.seed} ({self.setting}), at"
        return "\n".join([f"{where} {self.violation}", *self.incidents, f"    {self.command}"])


@dataclass(slots=True)
class Soaked:
    """Results of a soak test."""

    figures: Figures = field(default_factory=Figures)
    minutes: Counter[str] = field(default_factory=Counter)  # by setting
    violations: list[Found] = field(default_factory=list)
    digests: list[str] = field(default_factory=list)

    def add(self, minute: Minute, seed: int, seconds: float) -> None:
        """Add the results of one minute, or of a part of one.

        Args:
            minute: The minute.
            seed: Its seed.
            seconds: Its duration [s].
        """
        self.figures.add(minute.figures)
        self.digests.append(minute.digest)
        self.minutes[str(minute.setting)] += 1
        number = len(self.digests)
        for violation in minute.violations:
            before = [each for each in minute.incidents if each[0] <= violation.time][-SHOWN:]
            lines = [f"    {when:9.4f} s  {incident}" for when, incident in before]
            found = Found(number, seed, seconds, minute.setting, violation, lines)
            self.violations.append(found)


def measure(
    *,
    minutes: float,
    seed: int,
    choices: Sequence[Setting] = ALL_SETTINGS,
    file: Path | None = None,
) -> bool:
    """Print the results and return True if all invariants held.

    Args:
        minutes: Virtual time [min]. Minute k has the seed `seed` + k and can be repeated alone.
        seed: Seed of the first minute.
        choices: Settings that the minutes use in turn, by their seeds.
        file: File for the figures, as JSON.
    """
    start = time.perf_counter()
    soaked = soak(minutes * MINUTE, seed, choices)
    took = time.perf_counter() - start
    speed = minutes * MINUTE / took
    print(
        f"{machine()}\n{minutes:g} minutes of virtual time, seed {seed}, in {took:.0f} s: "
        f"{speed:.1f} times real time"
    )
    print(as_text(soaked))
    write(
        file,
        {
            "machine": machine(),
            "minutes": minutes,
            "seed": seed,
            "seconds": round(took, 1),
            "times_real_time": round(speed, 2),
            "settings": soaked.minutes,
            **{each.name: getattr(soaked.figures, each.name) for each in fields(Figures)},
            "digests": soaked.digests,
            "violations": [str(found) for found in soaked.violations],
        },
    )
    return not soaked.violations


def soak(seconds: float, seed: int, choices: Sequence[Setting] = ALL_SETTINGS) -> Soaked:
    """Run minute by minute."""
    soaked = Soaked()
    left = seconds
    while left > 1e-6:
        part = min(left, MINUTE)
        soaked.add(soaked_minute(seed, part, setting_of(seed, choices)), seed, part)
        left -= part
        seed += 1
    return soaked


def soaked_minute(seed: int, seconds: float, setting: Setting) -> Minute:
    """Run one minute. An error that is not a CatenaryError is a violation."""
    minute = Minute(seed, seconds, setting)
    try:
        minute.run()
    except Exception:
        minute.witness.violate("errors are CatenaryErrors", traceback.format_exc())
    return minute


def as_text(soaked: Soaked) -> str:
    """Return the figures and all violations as text."""
    figures = soaked.figures
    lines = [
        f"{figures.cycles} cycles in {figures.loops} loops, {figures.not_ok} not ok; "
        f"{figures.objects} objects read",
        f"minutes: {_counted(soaked.minutes)}",
        f"{figures.incidents} incidents; devices back within {figures.longest_return:.3f} s, "
        f"clocks within {figures.longest_lock:.3f} s",
        f"faults: {_counted(figures.faults)}",
        f"frames lost: {_counted(figures.losses)}",
        f"loops ended: {_counted(figures.ended)}",
        f"{len(soaked.violations)} violations",
    ]
    return "\n".join([*lines, *map(str, soaked.violations)])


def _counted(counter: dict[str, int]) -> str:
    return ", ".join(f"{number} {name}" for name, number in sorted(counter.items())) or "none"
