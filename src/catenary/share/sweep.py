"""Frequency sweeps: jogs whose velocity is a sine of changing frequency.

The core of the loop generates the sine (core/_sweep.pxd).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

FREQUENCY_MIN = 1e-3  # [Hz]
DURATION_MIN = 0.2  # [s]; the amplitude rises in 0.1 s, and falls in 0.1 s


@dataclass(frozen=True, slots=True)
class Sweep:
    """Logarithmic sweep of the velocity of a jog, to measure a frequency response.

    The velocity is `velocity` · sin(phase). The core reduces the amplitude at frequencies at which
    the motion would exceed the acceleration of the axis. It rises and falls within 0.1 s.

    Args:
        start: frequency at the start, at least 0.001 Hz [Hz].
        end: frequency at the end [Hz]. It may be lower than `start`.
        duration: duration, at least 0.2 s [s].

    Raises:
        ValueError: a value is not finite, or too small.
    """

    start: float
    end: float
    duration: float

    def __post_init__(self) -> None:
        for name, least in (
            ("start", FREQUENCY_MIN),
            ("end", FREQUENCY_MIN),
            ("duration", DURATION_MIN),
        ):
            value = getattr(self, name)
            if not least <= value < math.inf:
                raise ValueError(f"{name}={value}: must be finite and at least {least}")

    def check_period(self, period: float) -> None:
        """Raise ValueError if a frequency is not below half of the cycle rate.

        `period`: cycle period [s].
        """
        highest = max(self.start, self.end)
        if highest * period >= 0.5:
            raise ValueError(
                f"{highest:g} Hz: must be below half of the cycle rate, {0.5 / period:g} Hz"
            )
