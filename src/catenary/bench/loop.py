"""`catenary bench loop` and `catenary bench cost`: from what is asked to runs, and their report."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from catenary.bench.cost import Point, fit
from catenary.bench.job import Body, Job, Round
from catenary.bench.needed import need
from catenary.bench.peers import MODULES
from catenary.bench.report import as_json, as_text, machine
from catenary.bench.rounds import WARM_UP_CYCLES, interleave
from catenary.bench.segment import (
    ANALOG_CHANNELS,
    COUNTS_PER_TURN,
    PRIORITY,
    RATED_TORQUE,
    Served,
    processors,
    served,
)
from catenary.bench.statistics import Run, combine, ratios

OURS = ("catenary-inline", "catenary-threaded")
LAW = "catenary-law"  # where Numba is installed
STORM = "catenary-law-storm"  # beside a thread that spins and makes garbage
NEEDS = {"pysoem": "pysoem", LAW: "numba", STORM: "numba"}  # packages
ROUND_CYCLES = 900  # less than a second at 1 kHz: what the machine does meets all peers alike
DRIVE_BYTES = 26  # both ways
INPUT_BYTES = 4 * ANALOG_CHANNELS  # of one terminal
# drives, axes of each, terminals: 10, 33, 100 and 300 axes, and bytes without axes
COST_SEGMENTS = ((10, 1, 0), (33, 1, 0), (25, 4, 0), (50, 6, 0), (10, 1, 40), (33, 1, 40))
COST_RATE = 500  # [Hz]: 300 axes fill six frames, and their devices must have time to move


def measure(
    *,
    drives: int,
    rate: int,
    seconds: float,
    peers: Sequence[str],
    body: str,
    spin: bool,
    rounds: int | None = None,
    file: Path | None,
) -> None:
    names = peer_names(peers)
    setting = {"drives": drives, "rate": rate, "seconds": seconds, "body": body, "spin": spin}
    with served(drives) as segment:
        runs = run_all(
            names, segment, rate=rate, seconds=seconds, body=Body(body), spin=spin, rounds=rounds
        )
    quotients = ratios(runs)
    print(f"{machine()}\n{drives} drives at {rate} Hz, body {body}{', spinning' * spin}\n")
    print(as_text(runs, quotients))
    write(file, as_json(runs, quotients, setting))


def measure_cost(*, seconds: float, file: Path | None) -> None:
    rounds = math.ceil(seconds * 1000 / ROUND_CYCLES)
    found: dict[tuple[str, int, int], list[Round]] = {}  # by peer, axes, terminals
    for _ in range(rounds):  # all segments in turn: the machine's drift must not look like a cost
        for drives, axes, terminals in COST_SEGMENTS:
            with served(drives, terminals, axes) as segment:
                jobs = make_jobs(OURS, segment, COST_RATE, ROUND_CYCLES, Body.SINE, spin=False)
                for name, one in interleave(jobs, 1, show_progress).items():
                    found.setdefault((name, drives * axes, terminals), []).extend(one)
    costs: dict[str, list[Point]] = {name: [] for name in OURS}
    for (name, axes, terminals), ones in found.items():
        run = combine(name, ones)
        cost = run.timing_us["in_controller"]["p50"] + run.timing_us["tail"]["p50"]
        size = axes * DRIVE_BYTES + terminals * INPUT_BYTES
        costs[name].append(Point(axes, size, round(cost, 3)))
    fits = {name: fit(points) for name, points in costs.items()}
    print(f"{machine()}\nmedian of in_controller + tail:")
    for name, cost_line in fits.items():
        print(f"  {name:18} {cost_line}")
    write(
        file,
        {
            "machine": machine(),
            "costs": [
                {
                    "name": name,
                    "base_us": round(fits[name].base_us, 3),
                    "per_axis_us": round(fits[name].per_axis_us, 4),
                    "per_byte_us": round(fits[name].per_byte_us, 5),
                    "residual_us": round(fits[name].residual_us, 3),
                    "points": [[point.axes, point.size, point.cost_us] for point in points],
                }
                for name, points in costs.items()
            ],
        },
    )


def peer_names(peers: Sequence[str]) -> list[str]:
    """Ours and the chosen ones. ValueError: an unknown one; PackageError: it needs a package."""
    for name in peers:
        if name not in MODULES:
            known = ", ".join(name for name in MODULES if name not in (*OURS, LAW))
            raise ValueError(f"there is no peer {name!r}; known: {known}")
        if name in NEEDS:
            need(NEEDS[name], instead=f"; or leave {name} out: --peers c")
    ours = [*OURS, LAW] if find_spec("numba") else list(OURS)
    return [*ours, *(name for name in peers if name not in ours)]


def run_all(
    names: Sequence[str],
    segment: Served,
    *,
    rate: int,
    seconds: float,
    body: Body,
    spin: bool,
    rounds: int | None = None,
) -> list[Run]:
    """`rounds` of every peer; None: as many as make them short."""
    cycles = round(seconds * rate)
    rounds = rounds or math.ceil(cycles / ROUND_CYCLES)
    jobs = make_jobs(names, segment, rate, math.ceil(cycles / rounds), body, spin=spin)
    found = interleave(jobs, rounds, show_progress)
    return [combine(name, found[name]) for name in names]


def make_jobs(
    names: Sequence[str], segment: Served, rate: int, cycles: int, body: Body, *, spin: bool
) -> list[Job]:
    """The same for every peer, for one round."""
    return [
        Job(
            peer=name,
            interface=segment.interface,
            drives=segment.drives,
            body=body,
            period_ns=round(1e9 / rate),
            warm_up=WARM_UP_CYCLES,
            cycles=cycles,
            cpu=processors().masters,
            priority=PRIORITY,
            counts_per_turn=COUNTS_PER_TURN,
            rated_torque=RATED_TORQUE,
            spin=spin or name == STORM,
            storm=name == STORM,
            second=segment.second,
        )
        for name in names
    ]


def show_progress(peer: str, number: int, rounds: int) -> None:
    if sys.stderr.isatty():
        print(f"\r\x1b[Kround {number} of {rounds}: {peer} ", end="", file=sys.stderr, flush=True)


def write(file: Path | None, figures: dict[str, object]) -> None:
    if file is not None:
        file.write_text(json.dumps(figures, indent=1) + "\n")
        print(f"wrote {file}")
