"""`catenary bench loop`: measure the loop on this machine in all its execution modes."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path

from catenary.bench.job import Body, Job
from catenary.bench.report import as_json, loop_text, machine
from catenary.bench.rounds import WARM_UP_CYCLES, interleave
from catenary.bench.segment import (
    COUNTS_PER_TURN,
    PRIORITY,
    RATED_TORQUE,
    Served,
    processors,
    served,
)
from catenary.bench.setting import Setting
from catenary.bench.statistics import Run, combine

OURS = ("catenary-inline", "catenary-threaded")
LAW = "catenary-law"  # only if Numba is installed
STORM = "catenary-law-storm"  # next to a busy thread that creates garbage
MODULES = {
    "catenary-inline": "catenary.bench.python_loop",
    "catenary-threaded": "catenary.bench.python_loop",
    LAW: "catenary.bench.law_loop",
}
ROUND_CYCLES = 900  # less than a second at 1 kHz, so that disturbances affect all peers alike


def measure(setting: Setting, file: Path | None) -> None:
    """Print the timing of all execution modes, and write it to `file` as JSON.

    Raises:
        ValueError: The busy-wait is not less than the period.
    """
    names = own_names()
    show(setting, run_setting(setting, {name: MODULES[name] for name in names}), {}, file)


def own_names() -> list[str]:
    """Return the execution modes that this machine can run."""
    return [*OURS, LAW] if find_spec("numba") else list(OURS)


def run_setting(setting: Setting, modules: Mapping[str, str]) -> list[Run]:
    """Run the peers, given by name and module, on a new segment."""
    check_busy_wait(setting.busy_wait, setting.rate)
    with served(setting.drives) as segment:
        return run_all(
            modules,
            segment,
            rate=setting.rate,
            seconds=setting.seconds,
            body=Body(setting.body),
            spin=setting.spin,
            rounds=setting.rounds,
            busy_wait=setting.busy_wait,
        )


def check_busy_wait(busy_wait: float, rate: int) -> None:
    """Raise ValueError unless the busy-wait is less than the period."""
    if not 0 <= busy_wait < 1 / rate:
        raise ValueError(
            f"busy-wait of {busy_wait} s: it must be at least 0 and less than the period of "
            f"{1 / rate} s"
        )


def show(
    setting: Setting, runs: Sequence[Run], ratios: Mapping[str, float], file: Path | None
) -> None:
    """Print the figures of all runs and the verdicts, and write the figures to `file` as JSON."""
    print(loop_text(machine(), setting, runs, ratios))
    chosen = asdict(setting)
    del chosen["rounds"]  # each run has its own rounds
    write(file, as_json(runs, ratios, chosen))


def run_all(
    modules: Mapping[str, str],
    segment: Served,
    *,
    rate: int,
    seconds: float,
    body: Body,
    spin: bool,
    rounds: int | None = None,
    busy_wait: float = 0.0,
) -> list[Run]:
    """Run all peers in alternating rounds.

    Args:
        modules: Module of each peer, by name.
        segment: Segment that is already served.
        rate: Cycles per second [Hz].
        seconds: Measured time per peer [s].
        body: Body of the loops.
        spin: True to run a busy Python thread next to every loop.
        rounds: Number of rounds per peer; None for rounds of less than a second at 1 kHz.
        busy_wait: Time of busy-waiting before each cycle start [s].
    """
    cycles = round(seconds * rate)
    rounds = rounds or math.ceil(cycles / ROUND_CYCLES)
    jobs = make_jobs(
        modules, segment, rate, math.ceil(cycles / rounds), body, spin=spin, busy_wait=busy_wait
    )
    found = interleave(jobs, rounds, show_progress)
    return [combine(name, found[name]) for name in modules]


def make_jobs(
    modules: Mapping[str, str],
    segment: Served,
    rate: int,
    cycles: int,
    body: Body,
    *,
    spin: bool,
    busy_wait: float = 0.0,
) -> list[Job]:
    """Make the jobs of one round, with the same parameters for each peer.

    PySOEM and the C peers other than `c-busy` ignore `busy_wait`.
    """
    return [
        Job(
            peer=name,
            module=module,
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
        for name, module in modules.items()
    ]


def show_progress(peer: str, number: int, rounds: int) -> None:
    if sys.stderr.isatty():
        print(f"\r\x1b[Kround {number} of {rounds}: {peer} ", end="", file=sys.stderr, flush=True)


def write(file: Path | None, figures: dict[str, object]) -> None:
    if file is not None:
        file.write_text(json.dumps(figures, indent=1) + "\n")
        print(f"wrote {file}")
