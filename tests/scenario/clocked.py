"""Segments with different clocks, for the scenarios of distributed clocks."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from random import Random

import catenary as cat
from catenary.virtual import Coupler, Crystal, Device, DigitalOutputs, Segment, Servo
from tests.scenario.cell import Cell, cell_of

STAMP_JITTER = 0.5e-6  # [s]; a difference uses two time stamps and has 1 us of jitter


def crystal(random: Random, jitter: float = STAMP_JITTER) -> Crystal:
    """Return a crystal within ±100 ppm of the machine's that drifts with the temperature."""
    return Crystal(ppm=random.uniform(-100, 100), drift_ppm=2.0, drift_period=600.0, jitter=jitter)


def clocked_devices(servos: int, seed: int, jitter: float) -> list[Device]:
    """Return a coupler with the first clock, lamps without a clock, and servos."""
    random = Random(seed)
    return [
        Coupler(crystal=crystal(random, jitter)),
        DigitalOutputs(),
        *(Servo(serial=k + 1, crystal=crystal(random, jitter)) for k in range(servos)),
    ]


@contextmanager
def clocked_cell(servos: int = 2, seed: int = 1, jitter: float = STAMP_JITTER) -> Iterator[Cell]:
    with cell_of(*clocked_devices(servos, seed, jitter)) as cell:
        yield cell


def true_differences(segment: Segment, reference: int = 0) -> dict[int, float]:
    """Return the true difference of each clock from the reference at one time [s].

    It is taken from the model. It cannot be read on the bus.
    """
    core = segment.core
    of_reference = core.system_time(reference)
    return {
        device.position: (core.system_time(device.position) - of_reference) * 1e-9
        for device in segment
        if isinstance(device, Servo)
    }


def run_for(loop: cat.Loop, seconds: float) -> None:
    """Run cycles for a time [s] without motion."""
    first: float | None = None
    for cycle in loop:
        first = cycle.time if first is None else first
        if cycle.time - first >= seconds:
            return
