"""`python -m benchmarks table humanoid_tasks`: two networks and stand-ins of a humanoid's tasks.

One loop runs 18 + 15 axes on two networks, with a law on each. Four processes stand for the tasks:
each job spins for a fixed processor time. Rates and processor times:

- dynamics: rate of the loop, 15 us
- estimator: half of the rate, 25 us
- balance: a quarter of the rate, 40 us
- status: 1 Hz, 1 ms

The tasks share the processor of the loop. The segments use the other one, if there are two.
"""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from functools import partial
from importlib.util import find_spec

from benchmarks.networks import DRIVES
from benchmarks.tables.sheet import Options, Sheet, as_failures, grid
from benchmarks.tables.tocabi import Column, in_columns, run
from benchmarks.tables.tocabi_laws import LAWS, NETWORKS, WayRounds, one_process
from catenary.bench.segment import processors
from catenary.realtime import Running, Statistics, Task, Tasks, session

RATES, SECONDS = (4000,), 5.0
HEADER = ("", "rate [Hz]", "jobs", "missed", "skipped", "response, mean/max [us]", "execution [us]")
NETWORK_HEADER = ("", "cycles", "lost", "skipped", "output delay, mean/max [us]")


@dataclass(frozen=True, slots=True)
class StandIn:
    """Task that spins: its name, rate, processor time of a job and priority."""

    name: str
    divider: int  # of the rate of the loop; 0: 1 Hz
    spin: float  # [s]
    priority: int

    def rate(self, loop: int) -> float:
        """Return the rate [Hz] at a rate of the loop [Hz]."""
        return loop / self.divider if self.divider else 1.0


STAND_INS = (
    StandIn("dynamics", 1, 15e-6, 64),
    StandIn("estimator", 2, 25e-6, 63),
    StandIn("balance", 4, 40e-6, 62),
    StandIn("status", 0, 1e-3, 10),
)


def measure(options: Options) -> Sheet:
    rates, seconds = options.rates or RATES, options.seconds or SECONDS
    reason = why_not(options)
    failed: list[str] = []
    found = {} if reason else {rate: run_at(rate, seconds, options, failed) for rate in rates}
    axes = options.axes or DRIVES
    return Sheet(
        title="A humanoid's two networks and stand-ins of its tasks",
        conditions=f"ours: one loop, {' + '.join(map(str, axes))} virtual drives, a law on each "
        f"network, four spinning processes, {seconds:g} s",
        text="\n\n".join(
            [*(as_text(rate, way) for rate, way in found.items()), *as_failures(failed)]
        ),
        figures={
            "ring": options.ring,
            "axes": axes,
            "seconds": seconds,
            "stand_ins": [asdict(each) for each in STAND_INS],
            "rounds_done_again": failed,
            "rates": [as_figures(rate, way) for rate, way in found.items()],
        },
        left_out=[reason] if reason else [],
    )


def why_not(options: Options) -> str:
    if options.refused:
        return f"all of ours: no private network ({options.refused})"
    if find_spec("numba") is None:
        return "all of ours: Numba is not installed (pip install 'catenary[law]')"
    return ""


def run_at(rate: int, seconds: float, options: Options, failed: list[str]) -> WayRounds:
    way = partial(one_process, beside=partial(stand_ins, rate))
    return run(rate, seconds, 1, {LAWS: way}, options, failed)[LAWS]


def stand_ins(rate: int) -> Tasks:
    return Tasks(
        *(
            Task(
                spin,
                (each.spin,),
                name=each.name,
                period=1 / each.rate(rate),
                priority=each.priority,
                cpu=processors().masters,
            )
            for each in STAND_INS
        ),
        workers="processes",
        session=session(best_effort=True),
        best_effort=True,
    )


def spin(task: Running, seconds: float) -> None:
    """Use processor time in every job.

    Args:
        task: The running task.
        seconds: Processor time of a job [s].
    """
    for _job in task:
        end = time.thread_time() + seconds
        while time.thread_time() < end:
            pass


def holds(rate: int, way: WayRounds) -> list[str]:
    """Return the names of the networks and tasks that lost or missed nothing."""
    columns, tasks = in_columns({LAWS: way})
    good = [each.name for each in columns if not each.lost and not each.overflows]
    return good + [each.name for each in tasks if not each.misses and not each.skipped]


def as_text(rate: int, way: WayRounds) -> str:
    columns, tasks = in_columns({LAWS: way})
    rates = {each.name: each.rate(rate) for each in STAND_INS}
    took = ", ".join(f"{name} {share:.1%}" for each in way.shares for name, share in each.items())
    return "\n".join(
        [
            f"{rate} Hz",
            grid(NETWORK_HEADER, [network_row(each) for each in columns]),
            grid(HEADER, [task_row(each, rates[each.name]) for each in tasks]),
            f"processor shares: {took}",
            f"without a loss or miss: {', '.join(holds(rate, way)) or 'none'}",
        ]
    )


def network_row(column: Column) -> list[str]:
    delay = column.timing_us["output_delay"]
    texts = f"{delay['mean']:.1f}/{delay['max']:.1f}"
    name = column.name.partition(", ")[2]
    assert name in NETWORKS
    return [name, *map(str, (column.cycles, column.lost, column.overflows)), texts]


def task_row(task: Statistics, rate: float) -> list[str]:
    response = f"{task.response.mean * 1e6:.0f}/{task.response.max * 1e6:.0f}"
    counts = map(str, (task.jobs, task.misses, task.skipped))
    return [task.name, f"{rate:g}", *counts, response, f"{task.execution.mean * 1e6:.1f}"]


def as_figures(rate: int, way: WayRounds) -> dict[str, object]:
    columns, tasks = in_columns({LAWS: way})
    return {
        "rate": rate,
        "columns": [asdict(each) for each in columns],
        "tasks": [asdict(each) for each in tasks],
        "shares": way.shares,
        "holds": holds(rate, way),
    }
