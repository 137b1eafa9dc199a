"""`python -m benchmarks table tocabi`: 18 + 15 axes on two networks, 4 and 8 kHz.

Five variants take turns:

- `loop`: one loop over both networks, with targets from Python in every cycle.
- `laws`: one loop over both networks with a law on each, and a 1 kHz Python task.
- `law`: a separate process with a loop and a law for each network, and the same task.
- `triggered`: the same, but the second process starts its cycles with those of the first.
- `c`: two C programs.

The publication has one process for each network, and the first triggers the second.

The published loop waits within the cycle for the answer to its frame, while `c` receives the frame
of the previous cycle. Compare `receive` only among our variants. Compare `output delay` (from cycle
start to last cyclic frame passed to the kernel) between ours and `c`.

A variant holds a rate if no frame was lost, no cycle start was missed, and no job of the task was
missed. `--peers law --rates 4000,5000,6000` searches for the highest rate.
"""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from benchmarks.compiler import has_programs
from benchmarks.networks import DRIVES, C, NetworkRound, run_c, run_ours
from benchmarks.peers import modules_of
from benchmarks.tables.published import TOCABI, TOCABI_CONDITIONS, Channel, spread_of
from benchmarks.tables.sheet import Options, Sheet, as_failures, grid, slashed
from benchmarks.tables.tocabi_laws import (
    LAW,
    LAWS,
    NETWORKS,
    TRIGGERED,
    Places,
    WayRounds,
    one_process,
    triggered_process,
    two_processes,
)
from catenary.bench.job import Body, Job
from catenary.bench.loop import make_jobs, show_progress
from catenary.bench.rounds import run_with_retries
from catenary.bench.segment import served
from catenary.bench.statistics import summarise
from catenary.realtime import Statistics

RATES, SECONDS, ROUNDS = (4000, 8000), 10.0, 2
LOOP = "loop"
HEADER = ("avg/max/min/sd [us]", "latency", "send", "receive", "output delay", "overflows", "lost")
OUTPUT_DELAY = "output_delay"


@dataclass(frozen=True, slots=True)
class Column:
    """Results of one network in one variant, over all rounds."""

    name: str
    cycles: int
    lost: int
    overflows: int  # missed cycle starts; for C, cycles that began a period late
    missed_triggers: int  # cycles that began without the trigger of the other process
    timing_us: dict[str, dict[str, float]]

    def channel(self) -> Channel:
        latency, send, receive = (
            spread_of(self.timing_us[name]) for name in ("lateness", "send", "receive")
        )
        return Channel(latency, send, receive, str(self.overflows))


def measure(options: Options) -> Sheet:
    rates = options.rates or RATES
    seconds, rounds = options.seconds or SECONDS, options.rounds or ROUNDS
    ways, left_out = ways_for(options)
    failed: list[str] = []
    found = {
        rate: run(rate, seconds, rounds, ways, options, failed) if ways else {} for rate in rates
    }
    shape = "rings" if options.ring else "lines"
    axes = axes_of(options)
    blocks = [as_table(rate, of_ways) for rate, of_ways in found.items()]
    return Sheet(
        title=f"TOCABI, 18 + 15 axes on two networks; {TOCABI_CONDITIONS}",
        conditions=f"ours: {' + '.join(map(str, axes))} virtual drives, two {shape} of veth, "
        f"{rounds} x {seconds / rounds:g} s",
        text="\n\n".join([*blocks, "\n".join(as_verdicts(found)), *as_failures(failed)]),
        figures={
            "published": {f"{rate}, {name}": c._asdict() for (rate, name), c in TOCABI.items()},
            "ring": options.ring,
            "axes": axes,
            "seconds": seconds,
            "rounds": rounds,
            "rounds_done_again": failed,
            "rates": [as_figures(rate, of_ways) for rate, of_ways in found.items()],
        },
        left_out=left_out,
    )


def axes_of(options: Options) -> tuple[int, ...]:
    """Return the number of drives on each network.

    Raises:
        ValueError: The option does not name two networks.
    """
    axes = options.axes or DRIVES
    if len(axes) != len(NETWORKS):
        raise ValueError(f"tocabi has {len(NETWORKS)} networks, not {len(axes)}: --axes 6,6")
    return axes


Way = Callable[[Sequence[Job], "Places", WayRounds], None]


def ways_for(options: Options) -> tuple[dict[str, Way], list[str]]:
    """Return the requested variants that this machine can run, and the reasons for omitted ones.

    Raises:
        ValueError: A variant does not exist.
    """
    ways: dict[str, Way] = {
        LOOP: one_loop,
        LAWS: one_process,
        LAW: two_processes,
        TRIGGERED: triggered_process,
        C: two_programs,
    }
    asked = options.peers or tuple(ways)
    for name in asked:
        if name not in ways:
            raise ValueError(f"unknown peer {name!r} of tocabi; known peers: {', '.join(ways)}")
    if options.refused:
        return {}, [f"all of ours: no private network ({options.refused})"]
    reasons = why_not(options)
    left_out = [f"{name}: {reason}" for name, reason in reasons.items() if name in asked]
    return {name: ways[name] for name in asked if name not in reasons}, left_out


def why_not(options: Options) -> dict[str, str]:
    """Return the reasons why variants cannot run on this machine."""
    reasons = {}
    if find_spec("numba") is None:
        missing = "Numba is not installed (pip install 'catenary[law]')"
        reasons.update(dict.fromkeys((LAWS, LAW, TRIGGERED), missing))
    if options.ring:
        reasons[C] = "the C programs support one wire, not the two wires of a ring"
    elif not has_programs():
        reasons[C] = "no C compiler (sudo apt install gcc libc6-dev)"
    return reasons


def run(
    rate: int,
    seconds: float,
    rounds: int,
    ways: Mapping[str, Way],
    options: Options,
    failed: list[str],
) -> dict[str, WayRounds]:
    """Run all variants in turn, round by round."""
    found = {name: WayRounds([], [], []) for name in ways}
    with contextlib.ExitStack() as stack:
        segments = [stack.enter_context(served(n, ring=options.ring)) for n in axes_of(options)]
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="catenary-bench-")))
        cycles = round(seconds * rate / rounds)
        jobs = [
            replace(
                make_jobs(modules_of([C]), segment, rate, cycles, Body.SINE, spin=False)[0],
                busy_wait=options.busy_wait,
            )
            for segment in segments
        ]
        for number in range(rounds):
            for name, way in ways.items():
                show_progress(f"{name}, {rate} Hz", number + 1, rounds)
                run_with_retries(partial(way, jobs, Places(segments, folder), found[name]), failed)
    return found


def one_loop(jobs: Sequence[Job], _places: Places, found: WayRounds) -> None:
    found.networks.append(run_ours(jobs))


def two_programs(jobs: Sequence[Job], places: Places, found: WayRounds) -> None:
    found.networks.append(run_c(jobs, places.folder))


# Output as text and as figures


def in_columns(found: Mapping[str, WayRounds]) -> tuple[list[Column], list[Statistics]]:
    columns = [
        column(f"{name}, {NETWORKS[network]}", mine)
        for name, way in found.items()
        for network, mine in enumerate(zip(*way.networks, strict=True))
    ]
    return columns, [statistics for way in found.values() for statistics in way.task]


def column(name: str, rounds: Sequence[NetworkRound]) -> Column:
    phases = {
        phase: np.concatenate([each.phases_ns[phase] for each in rounds]) * 1e-3
        for phase in rounds[0].phases_ns
    }
    return Column(
        name=name,
        cycles=len(phases["lateness"]),
        lost=sum(each.lost for each in rounds),
        overflows=sum(each.late for each in rounds),
        missed_triggers=sum(each.missed_triggers for each in rounds),
        # -1 ns: the phase did not occur in that cycle
        timing_us={
            phase: summarise(values if phase == "lateness" else values[values >= 0])
            for phase, values in phases.items()
        },
    )


def as_table(rate: int, found: Mapping[str, WayRounds]) -> str:
    columns, task = in_columns(found)
    rows = [
        row(f"theirs: {name}", channel, "-", "-")
        for (published, name), channel in TOCABI.items()
        if published == rate
    ]
    rows += [
        row(
            each.name,
            each.channel(),
            slashed(spread_of(each.timing_us[OUTPUT_DELAY]), 2),
            f"{each.lost} of {each.cycles}",
        )
        for each in columns
    ]
    lines = [f"{rate} Hz", grid(HEADER, rows)]
    if task:
        jobs, missed = sum(each.jobs for each in task), sum(each.misses for each in task)
        lines.append(f"the 1 kHz Python task next to the laws: {missed} of {jobs} jobs missed")
    lines += [
        f"{each.name}: {each.missed_triggers} of {each.cycles} cycles without a trigger"
        for each in columns
        if each.name == f"{TRIGGERED}, {NETWORKS[1]}"
    ]
    for each in (shares for way in found.values() for shares in way.shares):
        took = ", ".join(f"{name} {share:.1%}" for name, share in each.items())
        lines.append(f"processor shares: {took}")
    return "\n".join(lines)


def as_verdicts(found: Mapping[int, Mapping[str, WayRounds]]) -> list[str]:
    """Return a line for each variant, with the rates that it holds and those that it does not."""
    lines = []
    for name in next(iter(found.values()), {}):
        held = [rate for rate, ways in found.items() if holds(name, ways[name])]
        others = [rate for rate in found if rate not in held]
        lines.append(f"{name}: nothing lost, late or missed at {in_hertz(held)}")
        lines[-1] += f"; not at {in_hertz(others)}" if others else ""
    return lines


def in_hertz(rates: Sequence[int]) -> str:
    return f"{', '.join(map(str, rates))} Hz" if rates else "no rate"


def holds(name: str, way: WayRounds) -> bool:
    columns, task = in_columns({name: way})
    return not any(each.lost or each.overflows for each in columns) and not any(
        each.misses for each in task
    )


def row(name: str, channel: Channel, output_delay: str, lost: str) -> list[str]:
    texts = [slashed(each, 2) for each in (channel.latency, channel.send, channel.receive)]
    return [name, *texts, output_delay, channel.overflows, lost]


def as_figures(rate: int, found: Mapping[str, WayRounds]) -> dict[str, object]:
    columns, task = in_columns(found)
    return {
        "rate": rate,
        "columns": [asdict(each) for each in columns],
        "task_beside": [asdict(each) for each in task],
        "shares": {name: way.shares for name, way in found.items() if way.shares},
        "holds": {name: holds(name, way) for name, way in found.items()},
    }
