"""`python -m benchmarks table rdda`: a gripper with two drives at 2 kHz, idle and under load.

The loop (`benchmarks.gripper_loop`) has the process data of the publication, a law, a share, and a
client with a lease that reads and commands at 500 Hz. The load is stress-ng as in `tasks`, or, if
it is not installed, one spinning program for each processor. The published loop had a processor
for itself. Here, the segment uses one processor, and the load uses all.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import partial
from importlib.util import find_spec
from shutil import which
from subprocess import TimeoutExpired

import msgspec
import numpy as np

from benchmarks.gripper_loop import AXES, Found, Setting
from benchmarks.tables.published import (
    RDDA_CONDITIONS,
    RDDA_CYCLES,
    RDDA_EXPERIMENTS,
    RDDA_LATENCY_US,
    RDDA_PERIOD_TOLERANCE,
    RDDA_RATE,
)
from benchmarks.tables.sheet import Options, Sheet, as_failures, grid
from benchmarks.tables.tasks import stressed
from catenary.bench.loop import show_progress
from catenary.bench.rounds import BRING_UP_SECONDS, RoundError, run_with_retries
from catenary.bench.segment import PRIORITY, Served, processors, served
from catenary.bench.statistics import summarise
from catenary.errors import CatenaryError
from catenary.realtime.child import start_program, start_python

IDLE, LOADED = "idle", "loaded"
SPIN = "while True: pass"
CLIENT_SECONDS = 20.0  # for the client to detect the end of the loop
SLOW = 10  # a run may take this many times as long as its cycles
HEADER = (
    "latency and period [us]",
    "cycles",
    "latency mean",
    "p99.9",
    "max",
    "period min",
    "max",
    "within 10 %",
    "lost",
    "commands",
)


@dataclass(frozen=True, slots=True)
class Row:
    """Results under one load."""

    load: str
    cycles: int
    lost: int
    commands: int
    latency_us: dict[str, float]
    period_us: dict[str, float]
    output_delay_us: dict[str, float]
    within: float  # fraction of the periods within the published tolerance
    scheduling: str

    @property
    def reached(self) -> bool:
        """True if no latency reached the published limit."""
        return self.latency_us["max"] < RDDA_LATENCY_US


def measure(options: Options) -> Sheet:
    rate = (options.rates or (RDDA_RATE,))[0]
    cycles = round(options.seconds * rate) if options.seconds else RDDA_CYCLES
    reason = why_not(options)
    left_out = [f"the loop: {reason}"] if reason else []
    failed: list[str] = []
    rows = [] if reason else run_all(rate, cycles, failed)
    experiments, reason = run_experiments()
    left_out += [f"the experiments: {reason}"] if reason else []
    lines = [as_table(rows), *as_verdicts(rows), *as_failures(failed)]
    return Sheet(
        title=f"RDDA, a gripper with two drives; {RDDA_CONDITIONS}",
        conditions=f"ours: {AXES} virtual drives on a veth, {rate} Hz, {cycles} cycles, a law, a "
        f"share, a client at up to 500 Hz; load: {load_text()}",
        text="\n".join([*lines, "", as_experiments(experiments)]),
        figures={
            "published": {"latency_us": RDDA_LATENCY_US, "cycles": RDDA_CYCLES, "rate": RDDA_RATE},
            "published_experiments": dict(RDDA_EXPERIMENTS),
            "rate": rate,
            "rows": [{**asdict(row), "reached": row.reached} for row in rows],
            "rounds_done_again": failed,
            "experiments": experiments,
        },
        left_out=left_out,
    )


def why_not(options: Options) -> str:
    if options.refused:
        return f"no private network ({options.refused})"
    return "" if find_spec("numba") else "Numba is not installed (pip install 'catenary[law]')"


def run_experiments() -> tuple[dict[str, object], str]:
    """Return the results of the experiments, and the reason if they cannot run."""
    from benchmarks import gripper_experiments

    reason = gripper_experiments.why_not()
    if reason:
        return {}, reason
    try:
        return asdict(gripper_experiments.run()), ""
    except (CatenaryError, TimeoutExpired) as error:  # the rows of the loop remain
        return {}, str(error)


def run_all(rate: int, cycles: int, failed: list[str]) -> list[Row]:
    rows = []
    with served(AXES) as segment:
        for number, load in enumerate((IDLE, LOADED)):
            show_progress(load, number + 1, 2)
            with loaded() if load == LOADED else contextlib.nullcontext():
                found = run_with_retries(partial(run, segment, rate, cycles), failed)
            rows.append(row_of(load, found, 1e6 / rate))
    return rows


def load_text() -> str:
    if which("stress-ng"):
        return "stress-ng as in the table tasks"
    return f"{len(os.sched_getaffinity(0))} spinning programs (stress-ng is not installed)"


@contextlib.contextmanager
def loaded() -> Iterator[None]:
    """Load all processors during the block, with ordinary scheduling."""
    with contextlib.ExitStack() as stack:
        if which("stress-ng"):
            stack.enter_context(stressed())
        else:
            for _ in os.sched_getaffinity(0):
                stack.enter_context(start_program([sys.executable, "-c", SPIN]))
        yield


def run(segment: Served, rate: int, cycles: int) -> Found:
    """Run the loop and its client, each in its own process."""
    share = f"bench-rdda-{os.getpid()}"
    setting = Setting(segment.interface, share, rate, cycles, processors().masters, PRIORITY)
    words = ["-m", "benchmarks.gripper_loop", msgspec.json.encode(setting).decode()]
    with start_python(words) as loop:
        line = loop.read_line(BRING_UP_SECONDS)
        if line != "ready":
            raise RoundError(f"the loop of the gripper failed: {line or 'no output'}")
        with start_python(["-m", "benchmarks.gripper_client", share]) as client:
            line = loop.read_line(BRING_UP_SECONDS + SLOW * cycles / rate)
            if line is None or not line.startswith("{"):
                raise RoundError(f"the loop of the gripper failed: {line or 'no output'}")
            if status := client.process.wait(CLIENT_SECONDS):
                raise RoundError(f"the client of the gripper failed with exit status {status}")
    return msgspec.json.decode(line, type=Found)


def row_of(load: str, found: Found, period_us: float) -> Row:
    latency, periods, delay = (
        np.array(values) * 1e-3
        for values in (found.lateness_ns, found.period_ns, found.output_delay_ns)
    )
    within = abs(periods - period_us) <= RDDA_PERIOD_TOLERANCE * period_us
    return Row(
        load=load,
        cycles=len(latency),
        lost=found.lost,
        commands=found.commands,
        latency_us={**summarise(latency), "p99.9": float(np.quantile(latency, 0.999))},
        period_us=summarise(periods),
        output_delay_us=summarise(delay[delay >= 0]),
        within=float(within.mean()),
        scheduling=found.scheduling,
    )


# Text output


def as_table(rows: list[Row]) -> str:
    theirs = ["theirs: loaded", str(RDDA_CYCLES), "-", "-", f"< {RDDA_LATENCY_US:g}"]
    return grid(HEADER, [[*theirs, "450", "550", "all", "-", "-"], *map(texts_of, rows)])


def texts_of(row: Row) -> list[str]:
    latency, period = row.latency_us, row.period_us
    times = (latency["mean"], latency["p99.9"], latency["max"], period["min"], period["max"])
    return [
        row.load,
        str(row.cycles),
        *(f"{time:.1f}" for time in times),
        f"{row.within:.3%}",
        str(row.lost),
        str(row.commands),
    ]


def as_verdicts(rows: list[Row]) -> list[str]:
    return [
        f"{row.load}: latency below {RDDA_LATENCY_US:g} us: "
        + ("reached" if row.reached else "NOT REACHED")
        for row in rows
    ]


def as_experiments(found: dict[str, object]) -> str:
    ours = experiment_texts(found) if found else dict.fromkeys(RDDA_EXPERIMENTS, "-")
    rows = [(name, theirs, ours[name]) for name, theirs in RDDA_EXPERIMENTS.items()]
    width = max(len(theirs) for _, theirs, _ in rows)
    return "\n".join(
        f"{name:10} theirs: {theirs:{width}}  ours: {mine}" for name, theirs, mine in rows
    )


def experiment_texts(found: dict[str, object]) -> dict[str, str]:
    from benchmarks.gripper_experiments import Experiments

    one = msgspec.convert(found, Experiments)
    stiffness = ", ".join(
        f"{given:g} set, {'/'.join(f'{each:.2f}' for each in measured)} measured"
        for given, measured in one.stiffness
    )
    stops = ((one.open_rad, "open"), (one.closed_rad, "closed"), (one.meeting_rad, "meeting"))
    return {
        "homing": ", ".join(f"{name} {'/'.join(f'{v:.3f}' for v in at)}" for at, name in stops)
        + " rad",
        "stiffness": f"{stiffness} [N·m/rad]",
        "contact": f"felt {one.felt_ms:.1f} ms after the contact, no force sensor",
        "chirp": f"corner at {one.corner_rad_s:.2f} rad/s; the simulated finger has "
        f"{one.expected_corner_rad_s:.2f}",
    }
