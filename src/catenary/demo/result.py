"""What the demo found out: one value, from which the text, demo.json and demo.html are made."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

Reals = npt.NDArray[np.float64]
Figures = Mapping[str, float]
Bucket = tuple[float, float, int]  # lower, upper [us], count

PHASES = ("period", "lateness", "receive", "process", "send", "in_controller", "tail")
FIGURES = ("mean", "min", "max", "sd", "p50", "p99", "p999")


@dataclass(frozen=True, slots=True)
class Device:
    position: int
    name: str
    vendor: int
    product: int
    state: str


@dataclass(frozen=True, slots=True)
class Motion:
    """One row per cycle, one column per drive."""

    time: Reals  # (cycles,) [s]
    reference: Reals  # (cycles, drives) [rad]
    actual: Reals  # (cycles, drives) [rad], measured when the reference was written

    @property
    def error(self) -> Reals:
        return self.actual - self.reference


@dataclass(frozen=True, slots=True)
class Result:
    devices: Sequence[Device]
    period: float  # [s]
    cycles: int
    lost: int
    late: int
    timing_us: Mapping[str, Figures]  # by phase
    histograms: Mapping[str, Sequence[Bucket]]  # by phase
    motion: Motion
    link: Literal["veth", "in-process"]
    scheduling: str

    @property
    def tracking_error(self) -> Figures:
        error = self.motion.error
        if error.size == 0:
            return {"rms": 0.0, "max": 0.0}
        return {"rms": float(np.sqrt(np.mean(error**2))), "max": float(np.abs(error).max())}


def as_json(result: Result) -> str:
    """`demo.json`: its form is public, programs read it."""
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
            "lost": result.lost,
            "late": result.late,
            "tracking_error_rad": {k: round(v, 6) for k, v in result.tracking_error.items()},
            "timing_us": {
                phase: {name: round(result.timing_us[phase][name], 3) for name in FIGURES}
                for phase in PHASES
            },
            "link": result.link,
            "scheduling": result.scheduling,
        },
        indent=2,
    )
