"""`python -m benchmarks virtual`: speed of a loop in virtual time, relative to real time.

The segment runs in this process. Its clock advances only while all threads wait.
"""

from __future__ import annotations

import math
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

import catenary as cat
from catenary.bench.loop import write
from catenary.bench.report import machine
from catenary.bench.segment import COUNTS_PER_TURN, make_segment
from catenary.virtual import Segment, Servo, read_segment

ExecutionMode = Literal["inline", "threaded"]

PERIOD = 1e-3  # [s]
EXECUTION_MODES: tuple[ExecutionMode, ...] = ("inline", "threaded")


def measure(*, drives: int, seconds: float, file: Path | None, config: Path | None = None) -> None:
    """Print and write the speed in each execution mode.

    Args:
        drives: Number of drives.
        seconds: Virtual time [s].
        file: File for the figures.
        config: Segment file; None for a segment of `drives` drives.
    """

    def segment() -> Segment:
        return make_segment(drives, clock="virtual") if config is None else read_segment(config)

    found: dict[str, float] = {
        execution: run(segment(), seconds, execution) for execution in EXECUTION_MODES
    }
    if find_spec("numba"):
        found["law"] = run_law(segment(), seconds)
    drives = sum(device.axes for device in segment() if isinstance(device, Servo))
    print(f"{machine()}\n{drives} drives, {seconds:g} s of virtual time at {1 / PERIOD:.0f} Hz")
    for execution, took in found.items():
        print(f"  {execution:10} {took:7.3f} s: {seconds / took:6.0f} times real time")
    write(
        file,
        {
            "machine": machine(),
            "drives": drives,
            "config": None if config is None else config.name,
            "virtual_seconds": seconds,
            "times_real_time": {
                execution: round(seconds / took, 1) for execution, took in found.items()
            },
        },
    )


@cat.law
def sine(actual, target, memory, time, parameters):  # type: ignore[no-untyped-def]
    for i in range(actual.n):
        target.position[i] = memory[i] + 0.1 * math.sin(time)
    return time >= parameters[0]


def run_law(segment: Segment, seconds: float) -> float:
    """Return the run time of a loop with a law [s], without the compilation."""
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(
            main.scan().drives, mode="csp", counts_per_turn=COUNTS_PER_TURN, velocity_limit=100.0
        )
        with cat.Loop(arm, period=PERIOD, laws=[sine]) as loop:
            home = arm.actual.position.copy()
            loop.run(sine, memory=home, parameters=[PERIOD])
            start = time.perf_counter()
            loop.run(sine, memory=home, parameters=[seconds])
            return time.perf_counter() - start


def run(segment: Segment, seconds: float, execution: ExecutionMode) -> float:
    """Return the run time of a loop [s], without bring-up and leaving."""
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(
            main.scan().drives, mode="csp", counts_per_turn=COUNTS_PER_TURN, velocity_limit=100.0
        )
        with cat.Loop(arm, period=PERIOD, execution=execution) as loop:
            home = arm.actual.position.copy()
            start = time.perf_counter()
            for cycle in loop:
                arm.target.position[:] = home + 0.1 * math.sin(cycle.time)
                if cycle.time >= seconds:
                    break
            return time.perf_counter() - start
