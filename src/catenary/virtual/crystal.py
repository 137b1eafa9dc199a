"""Crystal of a controller, with the frequency error, drift and jitter of a real one."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Literal

ClockBits = Literal[32, 64]
PPM_LIMIT = 500.0  # a time control loop cannot compensate for larger errors


@dataclass(frozen=True, slots=True, kw_only=True)
class Crystal:
    """Frequency error and time stamp jitter of a controller's clock. The default is exact.

    Attributes:
        ppm: Constant frequency error [ppm]. Positive: the clock runs fast.
        drift_ppm: Amplitude of a slow sine that is added to the frequency error [ppm]. It models
            the influence of temperature.
        drift_period: Period of this sine [s].
        jitter: Peak-to-peak width of the uniform scatter of time stamps [s]. It affects receive
            times and the system time. The random sequence is the same in every run.
    """

    ppm: float = 0.0
    drift_ppm: float = 0.0
    drift_period: float = 600.0
    jitter: float = 0.0

    def __post_init__(self) -> None:
        for f in fields(self):
            if not math.isfinite(getattr(self, f.name)):
                raise ValueError(f"crystal: {f.name} must be finite, not {getattr(self, f.name)}")
        if abs(self.ppm) + abs(self.drift_ppm) > PPM_LIMIT:
            raise ValueError(f"crystal: |ppm| + |drift_ppm| must be at most {PPM_LIMIT:g} ppm")
        if self.drift_period < 1:
            raise ValueError(
                f"crystal: drift_period must be at least 1 s, not {self.drift_period} s"
            )
        if not 0 <= self.jitter <= 1e-3:
            raise ValueError(f"crystal: jitter must be 0 to 1 ms, not {self.jitter} s")


EXACT = Crystal()
