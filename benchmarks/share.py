"""`python -m benchmarks share`: time to read a cycle, and the cost of 16 readers for the loop.

The time to read is compared with a plain copy. The loop runs without a share, with a share that is
not read, and with readers.
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

import catenary as cat
from benchmarks.peers import modules_of
from catenary.bench.job import Body
from catenary.bench.loop import run_all, write
from catenary.bench.report import as_json, as_text, machine
from catenary.bench.segment import COUNTS_PER_TURN, make_segment, served
from catenary.bench.statistics import Run

ORDERS = ("catenary-inline", "catenary-threaded")
SHARED, READ, BESIDE = "-shared", "-readers", "-bystanders"
NAMES = tuple(f"{order}{way}" for order in ORDERS for way in ("", SHARED, READ, BESIDE))
AXES = (3, 33)
READS = 20_000
CYCLES = 100
READ_LIMIT_US = 1.0  # in addition to the copy
LOOP_LIMIT = 1.05  # ratio of the medians with readers to those without


@dataclass(frozen=True, slots=True)
class Reading:
    """Medians [us] of reading one cycle."""

    axes: int
    bytes: int
    read: float
    copy: float  # np.copyto of the same number of bytes

    @property
    def beyond(self) -> float:
        return self.read - self.copy


def measure(*, drives: int, rate: int, seconds: float, file: Path | None) -> None:
    readings = [measure_reading(axes) for axes in AXES]
    with served(drives) as segment:
        runs = run_all(
            modules_of(NAMES), segment, rate=rate, seconds=seconds, body=Body.SINE, spin=False
        )
    quotients = share_ratios(runs)
    print(f"{machine()}\n{drives} drives at {rate} Hz: no share, a share, 16 readers at 100 Hz\n")
    print(as_text(runs, quotients))
    print(f"\n{as_aims(readings, quotients)}")
    setting: dict[str, object] = {"drives": drives, "rate": rate, "seconds": seconds}
    reads = [{**asdict(each), "beyond": round(each.beyond, 3)} for each in readings]
    write(file, {**as_json(runs, quotients, setting), "reading_us": reads})


def measure_reading(axes: int) -> Reading:
    """Measure reading from a loop that stands still in this process."""
    name = f"bench-read-{os.getpid()}"
    with cat.MainDevice(make_segment(axes, clock="virtual")) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=COUNTS_PER_TURN, velocity_limit=100.0)
        with (
            cat.Share(name) as share,
            cat.Loop(arm, sink=share) as loop,
            cat.attach(name) as reader,
        ):
            for cycle in loop:
                if cycle.number == CYCLES:
                    break
            size = reader.dtype.itemsize
            source, place = np.ones(size, np.uint8), np.empty(size, np.uint8)
            return Reading(
                axes, size, median_us(reader.read), median_us(lambda: np.copyto(place, source))
            )


def median_us(action: Callable[[], object]) -> float:
    """Return the median time of one call, without the time of reading the clock."""
    return max(_median_ns(action) - _median_ns(lambda: None), 0.0) * 1e-3


def _median_ns(action: Callable[[], object]) -> float:
    clock = time.perf_counter_ns
    found = []
    for _ in range(READS):
        start = clock()
        action()
        found.append(clock() - start)
    return statistics.median(found)


def share_ratios(runs: Sequence[Run]) -> dict[str, float]:
    """Return the ratios of the medians between the variants.

    The first ratio is the cost of reading: 16 readers to 16 equally busy processes that do not
    read. The others are readers to a share without readers, and that to no share.
    """
    timing = {run.name: run.timing_us for run in runs}
    return {
        f"{phase}: {order}{one} / {order}{other}": round(
            timing[f"{order}{one}"][phase]["p50"]
            / max(timing[f"{order}{other}"][phase]["p50"], 1e-3),
            3,
        )
        for order in ORDERS
        for one, other in ((READ, BESIDE), (READ, SHARED), (SHARED, ""))
        for phase in ("in_controller", "post_processing")
    }


def as_aims(readings: Sequence[Reading], quotients: dict[str, float]) -> str:
    """Return one line per limit, with the measured value."""
    lines = [
        f"  read {each.bytes} bytes ({each.axes} axes): {each.read:.2f} us, the copy alone "
        f"{each.copy:.2f} us: difference {each.beyond:.2f} us, limit {READ_LIMIT_US:g} us: "
        + verdict(each.beyond <= READ_LIMIT_US)
        for each in readings
    ]
    lines += [
        f"  {name}: {found:.3f}, limit {LOOP_LIMIT:g}: {verdict(found <= LOOP_LIMIT)}"
        for name, found in quotients.items()
        if name.endswith(BESIDE)
    ]
    return "\n".join(lines)


def verdict(held: bool) -> str:
    return "reached" if held else "NOT REACHED"
