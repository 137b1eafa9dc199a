"""The soak of everything: the loop, its activities and companions, and the results."""

from __future__ import annotations

import math
import os
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import catenary as cat
from benchmarks.soak.cell import Part
from benchmarks.together.activities import Cuts, Done, Files, Objects, ethernet
from benchmarks.together.cell import COUNTS_PER_TURN, DRIVES, LAMPS, make_segment, served
from benchmarks.together.companions import companions
from benchmarks.together.resources import Resources
from catenary.bench.loop import write
from catenary.bench.report import machine
from catenary.bus.event_types import DeviceHeld
from catenary.link import LinkSource
from catenary.realtime.child import Child
from catenary.virtual import Segment

PERIOD = 1e-3  # [s]
SAMPLE = 1.0  # [s] of this machine's time between two samples
END_SECONDS = 60.0  # of the loop's time for the last transfer
CHECK = 50  # cycles between two looks at the clock
RECOVER = 500  # cycles between two requests to restore devices and to enable axes
# Under load, late and lost cycles are counted. They do not end the loop.
PATIENT = cat.StopPolicy(
    lost_limit=10_000, late_limit=10.0, raise_faults=False, on_axis_stopped="event"
)
DISTURBED = ("not ok", "AxisStopped events", "StateLost events", "DeviceHeld events")
LOCKED = 0.9  # least part of the checks in which the clocks are locked
REQUIRED = ("cycles", "objects", "file bytes", "pings", "recordings")


@dataclass(slots=True)
class Soaked:
    """Results of a soak."""

    done: Done = field(default_factory=Done)
    resources: Resources = field(default_factory=Resources)
    counters: dict[str, int] = field(default_factory=dict)  # of the loop
    missing: list[str] = field(default_factory=list)  # parts that this machine does not permit
    error: str = ""  # that ended the loop
    seconds: float = 0.0  # of this machine's time
    loop_seconds: float = 0.0

    def violations(self, *, wire: bool) -> list[str]:
        """Return one line for each fault, growth and idle part.

        With `wire`, requests can fail under load. They are counted only.
        """
        idle = [f"{name}: none" for name in REQUIRED if not self.done.counts[name]]
        ended = [f"the loop ended: {self.error}"] if self.error else []
        failures = [] if wire else [*self._disturbances(), *self.done.failures]
        return [*ended, *idle, *failures, *self.resources.judge()]

    def _disturbances(self) -> list[str]:
        """Return one line for each effect that the cuts of a ring must not have."""
        counts = self.done.counts
        found = [f"{counts[name]} {name}" for name in DISTURBED if counts[name]]
        if counts["clock checks locked"] < LOCKED * counts["clock checks"]:
            found.append(f"clocks locked in {counts['clock checks locked']} checks only")
        return found


def measure(*, minutes: float, wire: bool, seed: int, file: Path | None) -> bool:
    """Run the soak and print its results. Return False after a violation.

    Args:
        minutes: Duration [min], in virtual time unless `wire`.
        wire: True for network interfaces, real time and load.
        seed: Seed of the places of the cuts.
        file: File for the figures, as JSON.
    """
    soaked = soak(minutes * 60.0, wire=wire, seed=seed)
    violations = soaked.violations(wire=wire)
    print(as_text(soaked, wire=wire, violations=violations))
    write(file, as_json(soaked, wire=wire, violations=violations))
    return not violations


def soak(seconds: float, *, wire: bool, seed: int) -> Soaked:
    """Run everything together for `seconds` of the loop's time.

    The loop runs in a thread. This thread starts the other processes, and samples the resources.
    """
    soaked = Soaked()
    start = time.monotonic()
    with ExitStack() as stack:
        sources, segment, server = stack.enter_context(segment_of(wire=wire))
        main = stack.enter_context(cat.MainDevice(*sources))
        main.scan()
        name = f"soak-{os.getpid()}"
        share = stack.enter_context(cat.Share(name, jog=True))
        loop, arm = stack.enter_context(opened(main, share))
        cycles = Cycles(soaked, main, loop, arm, Cuts(segment, soaked.done, seed), seconds)
        with cycles:
            others, soaked.missing = stack.enter_context(companions(name, load=wire))
            watch(soaked.resources, others, server)
            cycles.begin()
            while not cycles.ended.wait(SAMPLE):
                soaked.resources.take(time.monotonic() - start)
                read_output(others, soaked.done)
        soaked.counters = loop.timing.counters
    soaked.seconds = time.monotonic() - start
    return soaked


@contextmanager
def segment_of(
    *, wire: bool
) -> Iterator[tuple[tuple[str | LinkSource, str | LinkSource], Segment | None, Child | None]]:
    """Yield the two ends of the ring, and its segment or the process that serves it."""
    if not wire:
        segment = make_segment("virtual")
        yield (segment.first, segment.second), segment, None
        return
    with served() as (interfaces, server):
        yield interfaces, None, server


@contextmanager
def opened(main: cat.MainDevice, share: cat.Share) -> Iterator[tuple[cat.Loop, cat.Drives]]:
    """Open the loop, with distributed clocks. Yield it with its drives."""
    arm = cat.Drives(
        [main.subs[position] for position in DRIVES],
        counts_per_turn=COUNTS_PER_TURN,
        velocity_limit=2.0,
        required=False,  # under load, a drive can miss SYNC0 and leave OP
        dc=True,
    )
    lamps = cat.Outputs(main.subs[LAMPS], required=False)
    with cat.Loop(arm, lamps, period=PERIOD, sink=share, stop=PATIENT) as loop:
        yield loop, arm


def watch(resources: Resources, others: dict[str, Child], server: Child | None) -> None:
    resources.watch("loop", os.getpid())
    for name, child in others.items():
        resources.watch(name, child.pid)
    if server is not None:
        resources.watch("segment", server.pid)


class Cycles:
    """Owner of the thread that iterates the loop, and of the activities next to it.

    Args:
        soaked: Results.
        main: MainDevice of the loop.
        loop: The open loop.
        arm: Its drives.
        cuts: Cuts of the ring.
        seconds: Duration [s] of the loop's time.
    """

    def __init__(
        self,
        soaked: Soaked,
        main: cat.MainDevice,
        loop: cat.Loop,
        arm: cat.Drives,
        cuts: Cuts,
        seconds: float,
    ) -> None:
        self.ended = threading.Event()
        self._began, self._stop = threading.Event(), threading.Event()
        self._soaked, self._main, self._loop, self._arm = soaked, main, loop, arm
        self._cuts, self._seconds = cuts, seconds
        self._thread = threading.Thread(target=self._run, name="soak cycles", daemon=True)

    def begin(self) -> None:
        """Count the duration from now on: all other processes have started."""
        self._began.set()

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        try:
            with ethernet(self._main, self._soaked.done):
                self._iterate(Files(self._main, self._soaked.done))
        except Exception as error:  # the result of the soak
            self._soaked.error = f"{type(error).__name__}: {error}"
        finally:
            self.ended.set()

    def _iterate(self, files: Files) -> None:
        done, objects = self._soaked.done, Objects(self._main, self._soaked.done)
        part, end = Part(self._arm, "csp"), math.inf
        for cycle in self._loop:
            part.step(cycle.time)
            if cycle.number % RECOVER == 0:
                self._recover(part)
            objects.step(cycle.number)
            self._cuts.step(cycle.time)
            done.add("cycles")
            done.add("not ok", not cycle.ok)
            if cycle.number % CHECK == 0:
                done.add("clock checks locked", self._loop.clocks.locked)
                done.add("clock checks")
            self._soaked.loop_seconds = cycle.time
            if end == math.inf and self._began.is_set():
                end = cycle.time + self._seconds
            if cycle.time >= end or self._stop.is_set():
                files.stop()  # the transfer needs further cycles
                end = min(end, cycle.time)
                if not files.running or cycle.time > end + END_SECONDS:
                    return

    def _recover(self, part: Part) -> None:
        """Restore devices that returned, and enable axes that were stopped."""
        for event in self._main.events:
            self._soaked.done.add(f"{type(event).__name__} events")
            if isinstance(event, DeviceHeld) and event.sub is not None:
                self._loop.restore(event.sub)
        if idle := part.idle:
            self._arm.enable(idle)


def read_output(others: dict[str, Child], done: Done) -> None:
    """Empty the pipes of all processes. Count the recordings that the recorder has printed."""
    for name, child in others.items():
        while (line := child.read_line(0.0)) is not None:
            if name == "recorder":
                cycles, lost = map(int, line.split())
                done.add("recordings")
                done.add("recorded cycles", cycles)
                done.add("lost in recordings", lost)


def as_text(soaked: Soaked, *, wire: bool, violations: Sequence[str]) -> str:
    """Return the counts, the resources of each process, and the violations as text."""
    where = "network interfaces, under load" if wire else "virtual time"
    lines = [
        machine(),
        f"{soaked.loop_seconds:.0f} s of the loop in {soaked.seconds:.0f} s: {where}",
        ", ".join(f"{number} {name}" for name, number in sorted(soaked.done.counts.items())),
        ", ".join(f"{number} {name}" for name, number in sorted(soaked.counters.items())),
        *(f"not run: {reason}" for reason in soaked.missing),
        f"{'process':22}{'memory [MB]':>24}{'descriptors':>16}{'threads':>12}",
    ]
    for name, samples in soaked.resources.samples.items():
        if samples:
            first, last = samples[len(samples) // 3], samples[-1]
            memory = f"{first.memory_kb / 1024:.1f} to {last.memory_kb / 1024:.1f}"
            descriptors = f"{first.descriptors} to {last.descriptors}"
            threads = f"{first.threads} to {last.threads}"
            lines.append(f"{name:22}{memory:>24}{descriptors:>16}{threads:>12}")
    lines += [f"failed under load: {text}" for text in soaked.done.failures if wire]
    return "\n".join([*lines, f"{len(violations)} violations", *violations])


def as_json(soaked: Soaked, *, wire: bool, violations: Sequence[str]) -> dict[str, object]:
    return {
        "machine": machine(),
        "wire": wire,
        "seconds": round(soaked.seconds, 1),
        "loop_seconds": round(soaked.loop_seconds, 1),
        "counts": dict(soaked.done.counts),
        "counters": soaked.counters,
        "missing": soaked.missing,
        "resources": soaked.resources.samples,  # [s], [kB], descriptors, threads
        "failures": soaked.done.failures,
        "violations": list(violations),
    }
