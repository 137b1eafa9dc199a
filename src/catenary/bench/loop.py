"""`catenary bench loop` and `catenary bench cost`: run the peers and report their figures."""

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
from catenary.bench.statistics import WITH_TAIL, Run, combine, ratios

OURS = ("catenary-inline", "catenary-threaded")
LAW = "catenary-law"  # where Numba is installed
STORM = "catenary-law-storm"  # next to a thread that spins and creates garbage
BUSY = "c-busy"  # C with a busy-wait
NEEDS = {"pysoem": "pysoem", LAW: "numba", STORM: "numba"}  # packages
ROUND_CYCLES = 900  # less than a second at 1 kHz: disturbances affect all peers alike
DRIVE_BYTES = 26  # in both directions
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
    busy_wait: float = 0.0,
    file: Path | None,
) -> None:
    names = peer_names(peers)
    check_busy_wait(busy_wait, names, rate)
    setting: dict[str, object] = {
        "drives": drives,
        "rate": rate,
        "seconds": seconds,
        "body": body,
        "spin": spin,
        "busy_wait": busy_wait,
    }
    with served(drives) as segment:
        runs = run_all(
            names,
            segment,
            rate=rate,
            seconds=seconds,
            body=Body(body),
            spin=spin,
            rounds=rounds,
            busy_wait=busy_wait,
        )
    quotients = ratios(runs)
    notes = [f"{drives} drives at {rate} Hz, body {body}"]
    notes += ["spinning"] if spin else []
    notes += [f"busy-wait {busy_wait * 1e6:g} us (ours and {BUSY})"] if busy_wait else []
    print(f"{machine()}\n{', '.join(notes)}\n")
    print(as_text(runs, quotients))
    write(file, as_json(runs, quotients, setting))


def measure_cost(*, seconds: float, file: Path | None) -> None:
    rounds = math.ceil(seconds * 1000 / ROUND_CYCLES)
    found: dict[tuple[str, int, int], list[Round]] = {}  # by peer, axes, terminals
    for _ in range(rounds):  # all segments in turn, so that drift of the machine is not a cost
        for drives, axes, terminals in COST_SEGMENTS:
            with served(drives, terminals, axes) as segment:
                jobs = make_jobs(OURS, segment, COST_RATE, ROUND_CYCLES, Body.SINE, spin=False)
                for name, one in interleave(jobs, 1, show_progress).items():
                    found.setdefault((name, drives * axes, terminals), []).extend(one)
    costs: dict[str, list[Point]] = {name: [] for name in OURS}
    for (name, axes, terminals), ones in found.items():
        run = combine(name, ones)
        cost = run.timing_us[WITH_TAIL]["p50"]
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
    """Return our peers and the chosen ones.

    Raises:
        ValueError: unknown peer.
        PackageError: a chosen peer needs a package that is not installed.
    """
    for name in peers:
        if name not in MODULES:
            known = ", ".join(name for name in MODULES if name not in (*OURS, LAW))
            raise ValueError(f"unknown peer {name!r}; known: {known}")
        if name in NEEDS:
            need(NEEDS[name], instead=f"; or leave {name} out: --peers c")
    ours = [*OURS, LAW] if find_spec("numba") else list(OURS)
    return [*ours, *(name for name in peers if name not in ours)]


def check_busy_wait(busy_wait: float, names: Sequence[str], rate: int) -> None:
    """Raise ValueError for a busy-wait that the loops or the chosen peers cannot use."""
    if not 0 <= busy_wait < 1 / rate:
        raise ValueError(
            f"busy-wait of {busy_wait} s: must be less than the period of {1 / rate} s"
        )
    if BUSY in names and not busy_wait:
        raise ValueError(f"{BUSY} needs a busy-wait: add --busy-wait 0.00005")


def run_all(
    names: Sequence[str],
    segment: Served,
    *,
    rate: int,
    seconds: float,
    body: Body,
    spin: bool,
    rounds: int | None = None,
    busy_wait: float = 0.0,
) -> list[Run]:
    """Run all peers in turn. `rounds` of each; None: as many as keep a round below a second."""
    cycles = round(seconds * rate)
    rounds = rounds or math.ceil(cycles / ROUND_CYCLES)
    jobs = make_jobs(
        names, segment, rate, math.ceil(cycles / rounds), body, spin=spin, busy_wait=busy_wait
    )
    found = interleave(jobs, rounds, show_progress)
    return [combine(name, found[name]) for name in names]


def make_jobs(
    names: Sequence[str],
    segment: Served,
    rate: int,
    cycles: int,
    body: Body,
    *,
    spin: bool,
    busy_wait: float = 0.0,
) -> list[Job]:
    """Make the jobs of one round, the same for each peer. C peers other than `c-busy` and PySOEM
    ignore `busy_wait`."""
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
            busy_wait=busy_wait,
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
