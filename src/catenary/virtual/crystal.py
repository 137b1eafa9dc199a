"""A controller's crystal, as the clocks of real ones are: a little off, and drifting."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Literal

ClockBits = Literal[32, 64]
PPM_LIMIT = 500.0  # beyond it no time control loop can follow


@dataclass(frozen=True, slots=True, kw_only=True)
class Crystal:
    """What a controller counts time with. The default is exact.

    ppm: constant error of the frequency; positive: it counts too fast.
    drift_ppm, drift_period [s]: a slow sine of the temperature added to it.
    jitter [s]: time stamps (receive times, system times read or compared) scatter evenly over so
    much, half of it either way, the same in every run.
    """

    ppm: float = 0.0
    drift_ppm: float = 0.0
    drift_period: float = 600.0
    jitter: float = 0.0

    def __post_init__(self) -> None:
        for f in fields(self):
            if not math.isfinite(getattr(self, f.name)):
                raise ValueError(f"crystal: {f.name} must be a number, not {getattr(self, f.name)}")
        if abs(self.ppm) + abs(self.drift_ppm) > PPM_LIMIT:
            raise ValueError(f"a crystal is off by at most {PPM_LIMIT:g} ppm, drift included")
        if self.drift_period < 1:
            raise ValueError("a crystal's drift_period is at least 1 s: temperatures are slow")
        if not 0 <= self.jitter <= 1e-3:
            raise ValueError(f"a crystal's jitter is 0 to 1 ms, not {self.jitter} s")


EXACT = Crystal()
