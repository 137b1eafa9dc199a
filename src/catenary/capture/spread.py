"""Statistics of a stream of numbers, in constant memory."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Spread:
    """Summary of numbers. All are 0 if `count` is 0."""

    count: int
    minimum: float
    mean: float
    maximum: float
    deviation: float  # standard deviation


class RunningSpread:
    """Owner of the sums of a stream of numbers (Welford's algorithm)."""

    def __init__(self) -> None:
        self._count = 0
        self._minimum, self._maximum = math.inf, -math.inf
        self._mean = self._squares = 0.0

    def add(self, value: float) -> None:
        """Add a number."""
        self._count += 1
        self._minimum = min(self._minimum, value)
        self._maximum = max(self._maximum, value)
        before = value - self._mean
        self._mean += before / self._count
        self._squares += before * (value - self._mean)

    @property
    def spread(self) -> Spread:
        """The summary of the numbers so far."""
        if not self._count:
            return Spread(0, 0.0, 0.0, 0.0, 0.0)
        deviation = math.sqrt(self._squares / self._count)
        return Spread(self._count, self._minimum, self._mean, self._maximum, deviation)


class Slope:
    """Owner of the sums of a least-squares line through a stream of points."""

    def __init__(self) -> None:
        self._count = 0
        self._x = self._y = 0.0  # means
        self._xx = self._xy = 0.0

    def add(self, x: float, y: float) -> None:
        """Add a point."""
        self._count += 1
        before = x - self._x
        self._x += before / self._count
        self._y += (y - self._y) / self._count
        self._xx += before * (x - self._x)
        self._xy += before * (y - self._y)

    @property
    def slope(self) -> float:
        """Slope of the line; 0 if all points have the same x."""
        return self._xy / self._xx if self._xx else 0.0
