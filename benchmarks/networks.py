"""`python -m benchmarks networks`: a loop with 18 and 15 axes on two networks, and two C programs.

The C programs run at the same time under the same load, one for each network, like the native
threads of the loop. Each network is a pair of interfaces with a separate segment. The segments
share one processor, and the masters share the other. The same loop also runs in virtual time.
"""

from __future__ import annotations

import contextlib
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import msgspec
import numpy as np
import numpy.typing as npt

import catenary as cat
from benchmarks.peers import modules_of
from catenary.bench.job import PHASES, Body, Job, Nanoseconds
from catenary.bench.loop import make_jobs, show_progress, write
from catenary.bench.python_loop import LATE_LIMIT, LOST_LIMIT
from catenary.bench.report import machine
from catenary.bench.rounds import BRING_UP_SECONDS, RoundError, run_round
from catenary.bench.segment import COUNTS_PER_TURN, make_segment, served
from catenary.loop import Network
from catenary.realtime import VirtualClock
from catenary.realtime.child import start_python

Positions = npt.NDArray[np.float64]  # [rad]

DRIVES = (18, 15)  # of the published humanoid's upper and lower network
OURS, C = "catenary", "c"
BRING_UP = 2.0  # [s] longest bring-up of two programs together
KEPT = ("lateness", "receive", "send", "output_delay")  # phases


@dataclass(frozen=True, slots=True)
class Tally:
    """Results of one network, over all rounds."""

    name: str
    network: int
    cycles: int
    lost: int
    late: int  # missed cycle starts (ours), cycles that began a period late (C)
    lateness_us: dict[str, float]  # max, p50, p99


@dataclass(frozen=True, slots=True)
class NetworkRound:
    """One network in one round of the loop."""

    lost: int
    late: int
    phases_ns: dict[str, list[int]]  # of KEPT; -1: did not occur in that cycle
    missed_triggers: int = 0  # cycles that began without the trigger of another process


def measure(*, rates: Sequence[int], seconds: float, rounds: int, file: Path | None) -> None:
    print(machine())
    found: dict[str, object] = {"machine": machine(), "drives": DRIVES}
    for rate in rates:
        tallies = on_wires(rate, seconds, rounds)
        virtual = in_virtual_time(rate, seconds)
        print(f"\n{' + '.join(map(str, DRIVES))} axes at {rate} Hz\n{as_text(tallies)}")
        print(f"  in virtual time: {virtual[0]} cycles on each, {virtual[1]} not complete")
        found[str(rate)] = {
            "runs": [asdict(tally) for tally in tallies],
            "virtual": {"cycles": virtual[0], "incomplete": virtual[1]},
        }
    write(file, found)


def on_wires(rate: int, seconds: float, rounds: int) -> list[Tally]:
    """Run Catenary's loop and the C programs in turn, round by round."""
    cycles = round(seconds * rate / rounds)
    with contextlib.ExitStack() as stack:
        segments = [stack.enter_context(served(drives)) for drives in DRIVES]
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="catenary-bench-")))
        jobs = [
            make_jobs(modules_of([C]), one, rate, cycles, Body.SINE, spin=False)[0]
            for one in segments
        ]
        ours: list[list[NetworkRound]] = []
        theirs: list[list[NetworkRound]] = []
        for number in range(rounds):
            show_progress(OURS, number + 1, rounds)
            ours.append(run_ours(jobs))
            show_progress(C, number + 1, rounds)
            theirs.append(run_c(jobs, folder))
    return [*tally(OURS, cycles, ours), *tally(C, cycles, theirs)]


def run_c(jobs: Sequence[Job], folder: Path) -> list[NetworkRound]:
    """Run one program for each network at the same time.

    Python brings each segment up on the masters' processor. Counting begins when all programs run.
    """
    start = round(BRING_UP / (jobs[0].period_ns * 1e-9))
    jobs = [replace(job, warm_up=start) for job in jobs]
    places = [folder / str(number) for number in range(len(jobs))]
    for place in places:
        place.mkdir(exist_ok=True)
    with ThreadPoolExecutor(len(jobs)) as pool:
        rounds = list(pool.map(run_round, jobs, places))
    return [of_samples(each.lost, each.samples, jobs[0].period_ns) for each in rounds]


def of_samples(lost: int, samples: Nanoseconds, period_ns: int) -> NetworkRound:
    phases = {name: samples[:, PHASES.index(name)] for name in KEPT}
    late = int(np.count_nonzero(phases["lateness"] >= period_ns))
    return NetworkRound(lost, late, {name: column.tolist() for name, column in phases.items()})


def run_ours(jobs: Sequence[Job]) -> list[NetworkRound]:
    """Run the loop over all networks in a separate process, like the C programs."""
    arguments = ["-m", "benchmarks.networks", msgspec.json.encode(jobs).decode()]
    seconds = BRING_UP_SECONDS + (jobs[0].warm_up + jobs[0].cycles) * jobs[0].period_ns * 1e-9
    with start_python(arguments) as worker:
        said = worker.read_line(seconds)
    if said is None or not said.startswith("["):
        raise RoundError(f"the loop over {len(jobs)} networks failed: {said or 'no output'}")
    return msgspec.json.decode(said, type=list[NetworkRound])


def tally(name: str, cycles: int, rounds: Sequence[Sequence[NetworkRound]]) -> Iterator[Tally]:
    for network, mine in enumerate(zip(*rounds, strict=True)):
        lateness = np.concatenate([each.phases_ns["lateness"] for each in mine]) * 1e-3
        p50, p99 = np.percentile(lateness, [50.0, 99.0])
        yield Tally(
            name=name,
            network=network,
            cycles=cycles * len(rounds),
            lost=sum(each.lost for each in mine),
            late=sum(each.late for each in mine),
            lateness_us={
                "max": round(float(lateness.max()), 2),
                "p50": round(float(p50), 2),
                "p99": round(float(p99), 2),
            },
        )


def as_text(tallies: Sequence[Tally]) -> str:
    lines = [
        f"  {'':10}{'network':>8}{'cycles':>9}{'late':>7}{'lost':>7}"
        f"{'lateness [us] max, p50, p99':>32}"
    ]
    for each in tallies:
        lateness = "".join(f"{value:10.1f}" for value in each.lateness_us.values())
        lines.append(
            f"  {each.name:10}{each.network:8d}{each.cycles:9d}{each.late:7d}{each.lost:7d}"
            f"  {lateness}"
        )
    return "\n".join(lines)


def in_virtual_time(rate: int, seconds: float) -> tuple[int, int]:
    """Return the number of cycles, and the number of cycles that were incomplete on a network."""
    incomplete = 0
    cycles = round(seconds * rate)
    with VirtualClock() as clock, contextlib.ExitStack() as stack:
        segments = [make_segment(drives, clock=clock) for drives in DRIVES]
        mains = [stack.enter_context(cat.MainDevice(segment)) for segment in segments]
        bodies = [
            cat.Drives(
                main.scan().drives,
                mode="csp",
                counts_per_turn=COUNTS_PER_TURN,
                velocity_limit=100.0,
            )
            for main in mains
        ]
        loop = stack.enter_context(cat.Loop(*bodies, period=1 / rate))
        homes = homes_of(bodies)
        for cycle in loop:
            incomplete += not cycle.ok
            follow(bodies, homes, cycle.time)
            if cycle.number + 1 >= cycles:
                break
    return cycles, incomplete


def homes_of(bodies: Sequence[cat.Drives]) -> list[Positions]:
    return [body.actual.position.copy() for body in bodies]


def follow(bodies: Sequence[cat.Drives], homes: Sequence[Positions], t: float) -> None:
    for body, home in zip(bodies, homes, strict=True):
        body.target.position[:] = home + 0.1 * np.sin(np.pi * t)


# Process of one round


def main(arguments: Sequence[str]) -> None:
    jobs = msgspec.json.decode(arguments[0], type=list[Job])
    print(msgspec.json.encode(run_loop(jobs)).decode(), flush=True)


def run_loop(jobs: Sequence[Job]) -> list[NetworkRound]:
    first = jobs[0]
    with contextlib.ExitStack() as stack:
        mains = [stack.enter_context(cat.MainDevice(*job.interfaces)) for job in jobs]
        bodies = [
            cat.Drives(
                main.scan().drives,
                mode="csp",
                counts_per_turn=COUNTS_PER_TURN,
                velocity_limit=100.0,
            )
            for main in mains
        ]
        loop = stack.enter_context(
            cat.Loop(
                *bodies,
                period=first.period_ns * 1e-9,
                cpu=None if first.cpu is None else [first.cpu] * len(jobs),
                priority=first.priority,
                stop=cat.StopPolicy(lost_limit=LOST_LIMIT, late_limit=LATE_LIMIT),
                log=first.log,
            )
        )
        return follow_and_count(loop, bodies, first)


def follow_and_count(loop: cat.Loop, bodies: Sequence[cat.Drives], job: Job) -> list[NetworkRound]:
    """Run the loop, and return the counts and the phases of each network after the warm-up."""
    networks = loop.networks
    before, counted = [network.timing.counters for network in networks], False
    homes = homes_of(bodies)
    for cycle in loop:
        follow(bodies, homes, cycle.time)
        if not counted and cycle.number >= job.warm_up:  # a late loop skips numbers
            before, counted = [network.timing.counters for network in networks], True
        if cycle.number >= job.warm_up + job.cycles:
            break
    after = [network.timing.counters for network in networks]
    return [
        NetworkRound(
            lost=now["lost"] - then["lost"],
            late=now["late"] - then["late"],
            phases_ns=phases_of(network, job.cycles),
        )
        for network, then, now in zip(networks, before, after, strict=True)
    ]


def phases_of(network: Network | cat.Loop, cycles: int) -> dict[str, list[int]]:
    """Return the phases of the last cycles [ns]."""
    last = network.log[-cycles:]
    return {name: last[f"{name}_ns"].tolist() for name in KEPT}


if __name__ == "__main__":
    main(sys.argv[1:])
