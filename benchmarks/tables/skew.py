"""`python -m benchmarks table skew`: two digital outputs at both ends of a line, switched in the
same cycle, by the segment's own clock in place of an oscilloscope. Virtual time, the same in every
run.

Without clocks an output switches when the frame has passed, so the last one later by the line's
delay. With distributed clocks all switch at SYNC0; what remains is how well the clocks agree.
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
PATIENCE = 1.0  # [s] of virtual time
STAMP_JITTER, SEED = 100e-9, 1  # [s] over which a controller's time stamp scatters
WAYS = {
    "SYNC0, exact crystals": (True, False),
    "SYNC0": (True, True),
    "with the frame": (False, True),
}
FIRST = 1  # position; the other one is the last


@dataclass(frozen=True, slots=True)
class Found:
    """The last output's switching less the first one's [us], and its amount."""

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
        f"within {PPM:g} ppm and {DRIFT_PPM:g} ppm of drift, stamps scatter over "
        f"{STAMP_JITTER * 1e9:g} ns",
        text=grid(("amount of the skew [us]", "mean", "max", "min", "sd"), rows),
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
    """A coupler with the reference clock, an output, drives, an output."""
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
    """Both are switched in every cycle, and looked at in the next."""
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
                if cycle.time > 2 * seconds + PATIENCE:
                    raise CatenaryError(
                        f"the outputs of {first.name} and {last.name} were taken over {len(skews)}"
                        f" times in {cycle.time:.0f} s of virtual time"
                    )
    skew_us = np.array(skews) * 1e-3
    return Found(len(skews), summarise(skew_us), summarise(abs(skew_us)))


def row(name: str, spread: Spread) -> list[str]:
    return [name, *("-" if value is None else f"{value:.3f}" for value in spread)]
