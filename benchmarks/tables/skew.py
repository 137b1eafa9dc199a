"""`python -m benchmarks table skew`: two digital outputs at the ends of a line.

The outputs are switched in the same cycle. The clock of the segment replaces an oscilloscope. In
virtual time, all runs are the same.

Without clocks, an output switches when the frame has passed, so the last one switches later by the
delay of the line. With distributed clocks, all switch at SYNC0, and the skew is the difference of
the clocks.
"""

from __future__ import annotations

from dataclasses import dataclass
from random import Random

import numpy as np

import catenary as cat
from benchmarks.clocks import DRIFT_PERIOD, DRIFT_PPM, LOCK_TIMEOUT, PPM
from benchmarks.tables.published import SKEW, SKEW_CONDITIONS, Spread, spread_of
from benchmarks.tables.sheet import Options, Sheet, grid
from catenary.bench.statistics import summarise
from catenary.errors import CatenaryError
from catenary.virtual import Coupler, Crystal, DigitalOutputs, Segment, Servo

DRIVES, PERIOD, SECONDS = 3, 1e-3, 10.0
TIMEOUT = 1.0  # [s] of virtual time
STAMP_JITTER, SEED = 100e-9, 1  # [s] jitter of a controller's time stamp
WAYS = {
    "SYNC0, exact crystals": (True, False),
    "SYNC0": (True, True),
    "with the frame": (False, True),
}
FIRST = 1  # position of the first output; the other one is the last device


@dataclass(frozen=True, slots=True)
class Found:
    """Switching time of the last output minus that of the first [us], and its magnitude."""

    cycles: int
    skew_us: dict[str, float]
    amount_us: dict[str, float]


def measure(options: Options) -> Sheet:
    seconds = options.seconds or SECONDS
    found = {
        name: run(make_line(real_crystals=real), seconds, dc=dc)
        for name, (dc, real) in WAYS.items()
    }
    rows = [row("theirs: oscilloscope", SKEW)]
    rows += [row(name, spread_of(each.amount_us)) for name, each in found.items()]
    return Sheet(
        title=f"Skew of two digital outputs at both ends of the line; {SKEW_CONDITIONS}",
        conditions=f"ours: {DRIVES} drives between, 1 kHz, {seconds:g} s of virtual time; crystals "
        f"within {PPM:g} ppm, {DRIFT_PPM:g} ppm of drift, time stamps with "
        f"{STAMP_JITTER * 1e9:g} ns of jitter",
        text=grid(("magnitude of the skew [us]", "mean", "max", "min", "sd"), rows),
        figures={
            "published_us": SKEW._asdict(),
            "seconds": seconds,
            "ways": {
                name: {"cycles": each.cycles, "skew": each.skew_us, "amount": each.amount_us}
                for name, each in found.items()
            },
        },
    )


def make_line(*, real_crystals: bool) -> Segment:
    """Return a line: a coupler with the reference clock, an output, drives, an output."""
    random = Random(SEED)

    def crystal() -> Crystal:
        if not real_crystals:
            return Crystal()
        return Crystal(
            ppm=random.uniform(-PPM, PPM),
            drift_ppm=DRIFT_PPM,
            drift_period=DRIFT_PERIOD,
            jitter=STAMP_JITTER,
        )

    coupler = Coupler(crystal=crystal())
    first, last = (DigitalOutputs(dc=True, serial=k, crystal=crystal()) for k in (1, 2))
    servos = [Servo(serial=k + 3, crystal=crystal()) for k in range(DRIVES)]
    return Segment([coupler, first, *servos, last])


def run(segment: Segment, seconds: float, *, dc: bool) -> Found:
    """Switch both outputs in every cycle, and read their switching times in the next."""
    first, last = segment[FIRST], segment[len(segment) - 1]
    skews: list[int] = []
    with cat.MainDevice(segment) as main:
        subs = main.scan()
        outputs = cat.Outputs(subs[first.position], subs[last.position], dc=dc)
        with cat.Loop(outputs, period=PERIOD, execution="inline") as loop:
            if dc:
                loop.wait_locked(timeout=LOCK_TIMEOUT)
            for cycle in loop:
                switched = first.outputs_taken_ns, last.outputs_taken_ns
                if switched[0] is not None and switched[1] is not None:
                    skews.append(switched[1] - switched[0])
                outputs.bits[:] = cycle.number % 2
                if len(skews) * PERIOD >= seconds:
                    break
                if cycle.time > 2 * seconds + TIMEOUT:
                    raise CatenaryError(
                        f"the outputs of {first.name} and {last.name} switched only {len(skews)}"
                        f" times in {cycle.time:.0f} s of virtual time"
                    )
    skew_us = np.array(skews) * 1e-3
    return Found(len(skews), summarise(skew_us), summarise(abs(skew_us)))


def row(name: str, spread: Spread) -> list[str]:
    return [name, *("-" if value is None else f"{value:.3f}" for value in spread)]
