"""Result of the demo: the source of its text, demo.json and demo.html."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from catenary.figures import FIGURES
from catenary.loop.timing import COUNTED, Timing

Reals = npt.NDArray[np.float64]
Figures = Mapping[str, float]
Bucket = tuple[float, float, int]  # lower, upper [s], count

PHASES = ("period", "lateness", "receive", "process", "send", "in_controller", "post_processing")
# A set-point written in one cycle is sent in the next cycle. The first position that it affects is
# received one cycle later.
TRANSPORT_CYCLES = 2


@dataclass(frozen=True, slots=True)
class Device:
    position: int
    name: str
    vendor: int
    product: int
    state: str


@dataclass(frozen=True, slots=True)
class Motion:
    """One row per iteration, one column per drive."""

    time: Reals  # (cycles,) [s]
    reference: Reals  # (cycles, drives) [rad]
    actual: Reals  # (cycles, drives) [rad], received before the reference was written

    def error(self, delay: float) -> Reals:
        """Return the tracking error, shape (cycles, drives) [rad].

        It is the actual position minus the reference `delay` [s] earlier, which is the set-point
        that had reached the drive. It is NaN before the first set-point arrives.
        """
        if not len(self.time):
            return self.actual - self.reference
        sent = np.searchsorted(self.time, self.time - delay + 1e-9, side="right") - 1
        return np.where((sent >= 0)[:, None], self.actual - self.reference[sent], np.nan)


@dataclass(frozen=True, slots=True)
class Result:
    devices: Sequence[Device]
    period: float  # [s]
    cycles: int
    timing: Timing
    histograms: Mapping[str, Sequence[Bucket]]  # by phase
    motion: Motion
    link: Literal["veth", "in-process"]
    scheduling: str

    @property
    def transport_delay(self) -> float:
        """Time from writing a set-point to reading the first position that it affects [s]."""
        return TRANSPORT_CYCLES * self.period

    @property
    def error(self) -> Reals:
        """Actual position minus the set-point that had reached the drive [rad]."""
        return self.motion.error(self.transport_delay)

    @property
    def tracking_error(self) -> Figures:
        error = self.error[np.isfinite(self.error)]
        if error.size == 0:
            return {"rms": 0.0, "max": 0.0}
        return {"rms": float(np.sqrt(np.mean(error**2))), "max": float(np.abs(error).max())}

    @property
    def timing_us(self) -> Mapping[str, Figures]:
        """Figures of each phase [us]."""
        return {p: {name: self.timing[p][name] * 1e6 for name in FIGURES} for p in PHASES}


def as_json(result: Result) -> str:
    """Return the text of `demo.json`. The format is public: other programs read it."""
    return json.dumps(
        {
            "devices": [
                {
                    "position": device.position,
                    "name": device.name,
                    "vendor": device.vendor,
                    "product": device.product,
                    "state": device.state,
                }
                for device in result.devices
            ],
            "cycles": result.cycles,
            **{name: result.timing.counters[name] for name in COUNTED},
            "verdict": result.timing.verdict,
            "tracking_error_rad": {k: round(v, 6) for k, v in result.tracking_error.items()},
            "transport_delay_s": result.transport_delay,
            "timing_us": {
                phase: {name: round(value, 3) for name, value in figures.items()}
                for phase, figures in result.timing_us.items()
            },
            "link": result.link,
            "scheduling": result.scheduling,
        },
        indent=2,
    )
