"""Memory, descriptors and threads of processes over time, and the judgement of their growth."""

from __future__ import annotations

import os
import statistics
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

WARM_UP = 1 / 3  # part of the samples: caches and buffers fill
COMPARED = 4  # of the rest, the first and the last quarter are compared
ENOUGH = 12  # samples for a judgement
GROWTH, GROWTH_KB = 0.02, 2048  # permitted growth of the memory: the larger of both
MORE = 1  # permitted further descriptors or threads


class Sample(NamedTuple):
    """Resources of one process."""

    time: float  # [s] since the start
    memory_kb: int  # resident
    descriptors: int
    threads: int
    ticks: int  # processor time, user and system


def sample(pid: int, time: float) -> Sample | None:
    """Return the present resources of a process; None if it has ended."""
    try:
        status = dict(
            line.split(":", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines()
        )
        descriptors = len(os.listdir(f"/proc/{pid}/fd"))
        times = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[11:13]
    except (FileNotFoundError, ProcessLookupError, PermissionError):
        return None
    memory = status.get("VmRSS", "0 kB").split()[0]
    ticks = sum(map(int, times))
    return Sample(time, int(memory), descriptors, int(status["Threads"]), ticks)


@dataclass(slots=True)
class Resources:
    """Owner of the samples of all processes."""

    processes: dict[str, int] = field(default_factory=dict)  # name: pid
    samples: dict[str, list[Sample]] = field(default_factory=dict)
    ended: list[str] = field(default_factory=list)

    def watch(self, name: str, pid: int) -> None:
        self.processes[name] = pid
        self.samples[name] = []

    def take(self, time: float) -> None:
        """Sample all processes. A process that has ended is recorded once."""
        for name, pid in list(self.processes.items()):
            found = sample(pid, time)
            if found is None:
                self.ended.append(f"{name} ended after {time:.0f} s")
                del self.processes[name]
            else:
                self.samples[name].append(found)

    def judge(self) -> list[str]:
        """Return one line for each process that ended, and for each growth."""
        grown = [f"{name}: {text}" for name, all_ in self.samples.items() for text in growth(all_)]
        return self.ended + grown


def growth(samples: Sequence[Sample]) -> list[str]:
    """Return what has grown after the warm-up, and whether the process did nothing.

    The medians of the first and the last quarter are compared, so that single peaks do not count.
    """
    rest = samples[round(len(samples) * WARM_UP) :]
    if len(rest) < ENOUGH:
        return [f"only {len(samples)} samples: run for longer"]
    quarter = len(rest) // COMPARED
    idle = rest[-1].ticks == rest[-quarter].ticks
    found = ["no processor time in the last quarter"] if idle else []
    for name, allowed in (("memory_kb", GROWTH_KB), ("descriptors", MORE), ("threads", MORE)):
        before, after = (
            statistics.median(getattr(each, name) for each in part)
            for part in (rest[:quarter], rest[-quarter:])
        )
        limit = max(allowed, GROWTH * before) if name == "memory_kb" else allowed
        if after - before > limit:
            found.append(f"{name} grew from {before:g} to {after:g}")
    return found
