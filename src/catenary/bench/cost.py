"""What a cycle costs, as a + b·axes + c·bytes: a least-squares fit over segments that differ in
both, so that the work per axis and the work per byte come apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


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
    residual_us: float  # root mean square of what the line does not explain

    def __str__(self) -> str:
        return (
            f"{self.base_us:.2f} us + {self.per_axis_us:.3f} us · axes "
            f"+ {self.per_byte_us * 1000:.3f} ns · bytes (residual {self.residual_us:.2f} us)"
        )


def fit(points: Sequence[Point]) -> Cost:
    """At least three segments; axes and bytes must not be proportional."""
    terms = np.array([(1.0, point.axes, point.size) for point in points])
    if np.linalg.matrix_rank(terms) < 3:
        raise ValueError("the segments do not tell the cost of an axis from that of a byte")
    costs = np.array([point.cost_us for point in points])
    solution, *_ = np.linalg.lstsq(terms, costs, rcond=None)
    residual = float(np.sqrt(np.mean((terms @ solution - costs) ** 2)))
    base, per_axis, per_byte = map(float, solution)
    return Cost(base, per_axis, per_byte, residual)
