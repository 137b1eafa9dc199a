"""Cost of the operator's page: `python -m benchmarks.dashboard_viewers --seconds 10 --json FILE`.

The first part compares a loop that 10 viewers watch at 60 Hz with the same loop while they watch
another one: the load of the processors is the same. The second part measures the processor time of
the dashboard for 33 axes and 4 viewers.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from benchmarks.peers import modules_of
from benchmarks.peers.dashboard_parts import dashboard, part
from catenary.bench.job import Body
from catenary.bench.loop import run_all, write
from catenary.bench.report import as_json, as_text, machine
from catenary.bench.segment import served
from catenary.bench.statistics import Run
from catenary.realtime.private_network import enter

ORDERS = ("catenary-inline", "catenary-threaded")
WATCHED, OTHERS = "-viewers", "-others"
NAMES = tuple(f"{order}{way}" for order in ORDERS for way in (WATCHED, OTHERS))
RATIO_LIMIT = 1.02  # of the medians, watched to not watched
AXES, VIEWERS = 33, 4
CPU_LIMIT = 0.15  # of one core


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=int, default=3)
    parser.add_argument("--rate", type=int, default=1000, help="cycles per second")
    parser.add_argument("--seconds", type=float, default=10.0, help="run time of every variant")
    parser.add_argument("--json", type=Path, help="file for the results")
    chosen = parser.parse_args(arguments)
    enter()
    with served(chosen.drives) as segment:
        runs = run_all(
            modules_of(NAMES),
            segment,
            rate=chosen.rate,
            seconds=chosen.seconds,
            body=Body.SINE,
            spin=False,
        )
    load = measure_load(AXES, VIEWERS, chosen.seconds)
    report(runs, load, chosen)


def report(runs: Sequence[Run], load: float, chosen: argparse.Namespace) -> None:
    """Print the results, and write them to a file if one is chosen."""
    ratios = viewer_ratios(runs)
    print(f"{machine()}\n{chosen.drives} drives at {chosen.rate} Hz, 10 viewers at 60 Hz\n")
    print(as_text(runs, ratios))
    print(f"\n{as_aims(ratios, load)}")
    setting = {"drives": chosen.drives, "rate": chosen.rate, "seconds": chosen.seconds}
    figures = as_json(runs, ratios, setting)
    own = {"axes": AXES, "viewers": VIEWERS, "share_of_a_core": round(load, 4)}
    write(chosen.json, {**figures, "dashboard": own})


def viewer_ratios(runs: Sequence[Run]) -> dict[str, float]:
    """Return the ratios of the medians: the watched loop to the loop that is not watched."""
    timing = {run.name: run.timing_us for run in runs}
    return {
        f"{phase}: {order}{WATCHED} / {order}{OTHERS}": round(
            timing[f"{order}{WATCHED}"][phase]["p50"]
            / max(timing[f"{order}{OTHERS}"][phase]["p50"], 1e-3),
            3,
        )
        for order in ORDERS
        for phase in ("in_controller", "post_processing")
    }


def measure_load(axes: int, viewers: int, seconds: float) -> float:
    """Return the processor time of the dashboard per time, as a share of one core."""
    name = f"bench-{os.getpid()}-load"
    cpus = ",".join(map(str, sorted(os.sched_getaffinity(0))))
    with ExitStack() as stack:
        stack.enter_context(part("decoy", cpus, name, str(axes)))
        server, link = stack.enter_context(dashboard(name, cpus))
        watching, _ = stack.enter_context(part("view", cpus, link, str(viewers)))
        if watching.read_line(60.0) is None:
            raise RuntimeError("the viewers received no frames within 60 s")
        before, start = processor_time(server.pid), time.monotonic()
        time.sleep(seconds)
        return (processor_time(server.pid) - before) / (time.monotonic() - start)


def processor_time(pid: int) -> float:
    """Return the processor time of all threads of a process, user and system [s]; proc(5)."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def as_aims(ratios: dict[str, float], load: float) -> str:
    """Return one line per limit, with the measured value."""
    lines = [
        f"  {name}: {found:.3f}, limit {RATIO_LIMIT:g}: {verdict(found <= RATIO_LIMIT)}"
        for name, found in ratios.items()
        if name.startswith("in_controller")
    ]
    lines.append(
        f"  dashboard for {AXES} axes and {VIEWERS} viewers: {load:.1%} of a core, limit "
        f"{CPU_LIMIT:.0%}: {verdict(load <= CPU_LIMIT)}"
    )
    return "\n".join(lines)


def verdict(held: bool) -> str:
    return "reached" if held else "NOT REACHED"


if __name__ == "__main__":
    main()
