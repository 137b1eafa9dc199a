"""`python -m benchmarks cost`: cost of a cycle, as a + b·axes + c·bytes.

The result is a least-squares fit over segments with different numbers of axes and bytes, so that
the cost per axis and the cost per byte can be separated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.peers import modules_of
from catenary.bench.job import Body, Round
from catenary.bench.loop import OURS, ROUND_CYCLES, make_jobs, show_progress, write
from catenary.bench.report import machine
from catenary.bench.rounds import interleave
from catenary.bench.segment import ANALOG_CHANNELS, served
from catenary.bench.statistics import WITH_POST_PROCESSING, combine

DRIVE_BYTES = 26  # in both directions
INPUT_BYTES = 4 * ANALOG_CHANNELS  # of one terminal
# drives, axes of each, terminals: 10, 33, 100 and 300 axes, and bytes without axes
COST_SEGMENTS = ((10, 1, 0), (33, 1, 0), (25, 4, 0), (50, 6, 0), (10, 1, 40), (33, 1, 40))
COST_RATE = 500  # [Hz]: 300 axes fill six frames, and their devices must have time to move


@dataclass(frozen=True, slots=True)
class Point:
    axes: int
    size: int  # bytes of process data in both directions
    cost_us: float


@dataclass(frozen=True, slots=True)
class Cost:
    base_us: float
    per_axis_us: float
    per_byte_us: float
    residual_us: float  # root mean square of the residuals

    def __str__(self) -> str:
        return (
            f"{self.base_us:.2f} us + {self.per_axis_us:.3f} us · axes "
            f"+ {self.per_byte_us * 1000:.3f} ns · bytes (residual {self.residual_us:.2f} us)"
        )


def measure(*, seconds: float, file: Path | None) -> None:
    rounds = math.ceil(seconds * 1000 / ROUND_CYCLES)
    found: dict[tuple[str, int, int], list[Round]] = {}  # by peer, axes, terminals
    for _ in range(rounds):  # all segments in turn: drift of the machine affects all equally
        for drives, axes, terminals in COST_SEGMENTS:
            with served(drives, terminals, axes) as segment:
                jobs = make_jobs(
                    modules_of(OURS), segment, COST_RATE, ROUND_CYCLES, Body.SINE, spin=False
                )
                for name, one in interleave(jobs, 1, show_progress).items():
                    found.setdefault((name, drives * axes, terminals), []).extend(one)
    costs: dict[str, list[Point]] = {name: [] for name in OURS}
    for (name, axes, terminals), ones in found.items():
        run = combine(name, ones)
        cost = run.timing_us[WITH_POST_PROCESSING]["p50"]
        size = axes * DRIVE_BYTES + terminals * INPUT_BYTES
        costs[name].append(Point(axes, size, round(cost, 3)))
    fits = {name: fit(points) for name, points in costs.items()}
    print(f"{machine()}\nmedian of in_controller + post_processing:")
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


def fit(points: Sequence[Point]) -> Cost:
    """Fit the cost model. At least three segments are needed, with axes not proportional to bytes.

    Raises:
        ValueError: The segments cannot separate the cost of an axis from that of a byte.
    """
    terms = np.array([(1.0, point.axes, point.size) for point in points])
    if np.linalg.matrix_rank(terms) < 3:
        raise ValueError("the segments cannot separate the cost of an axis from that of a byte")
    costs = np.array([point.cost_us for point in points])
    solution, *_ = np.linalg.lstsq(terms, costs, rcond=None)
    residual = float(np.sqrt(np.mean((terms @ solution - costs) ** 2)))
    base, per_axis, per_byte = map(float, solution)
    return Cost(base, per_axis, per_byte, residual)
