"""`python -m benchmarks clocks`: synchronisation of distributed clocks, in virtual time.

The crystals of the virtual segment differ, drift with the temperature and have jitter. The true
difference of a clock from the reference is taken from the model. It cannot be read on the bus.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from random import Random

import catenary as cat
from catenary.bench.loop import write
from catenary.bench.report import machine
from catenary.bench.segment import COUNTS_PER_TURN
from catenary.virtual import Coupler, Crystal, Segment, Servo

PERIOD = 1e-3  # [s]
BOUND = 1e-6  # [s]
LOCK_TIMEOUT = 2.0  # [s] from the start of the loop, including the burst
PPM = 100.0  # largest deviation of a crystal, positive or negative
DRIFT_PPM, DRIFT_PERIOD = 2.0, 600.0  # additional drift with the temperature; [s]
LOOKS = 5  # cycles between two readings of the true differences


@dataclass(frozen=True, slots=True)
class Outcome:
    """Results of one segment. Differences in us."""

    devices: int
    seconds: float  # of virtual time
    locked_after: float  # [s] from entering the loop
    worst_reported: float  # largest value of `loop.clocks.differences`
    worst_true: float
    rms_true: float
    looks: int  # readings of all clocks
    looks_beyond: int  # readings with a clock beyond the bound
    worst_phase: float  # phase error of the cycle starts, mean over some cycles
    times_unlocked: int
    took: float  # [s]

    @property
    def held(self) -> bool:
        return self.worst_true < BOUND * 1e6 and self.worst_reported < BOUND * 1e6


def measure(
    *, devices: Sequence[int], minutes: float, jitter: float, seed: int, file: Path | None
) -> bool:
    """Print and write the results. Return True if every clock stayed within the bound."""
    print(
        f"{machine()}\ncrystals within ±{PPM:g} ppm, {DRIFT_PPM:g} ppm of drift; time stamps with "
        f"{jitter * 1e6:g} us of jitter, two per difference; {1 / PERIOD:.0f} Hz, "
        f"{minutes:g} min of virtual time"
    )
    outcomes = [run(count, minutes * 60, jitter, seed) for count in devices]
    for outcome in outcomes:
        print(
            f"  {outcome.devices:3} devices: within {BOUND * 1e6:g} us after "
            f"{outcome.locked_after:.3f} s; then at most {outcome.worst_true:.3f} us "
            f"(rms {outcome.rms_true:.3f}), reported {outcome.worst_reported:.3f} us; beyond in "
            f"{outcome.looks_beyond} of {outcome.looks} readings; cycle starts "
            f"{outcome.worst_phase:.3f} us; unlocked {outcome.times_unlocked} times; took "
            f"{outcome.took:.0f} s"
        )
    write(
        file,
        {
            "machine": machine(),
            "jitter_us": jitter * 1e6,
            "seed": seed,
            "bound_us": BOUND * 1e6,
            "runs": [asdict(outcome) for outcome in outcomes],
        },
    )
    return all(outcome.held for outcome in outcomes)


def make_segment(count: int, jitter: float, seed: int) -> Segment:
    """Return a segment of a coupler with the reference clock, and servos."""
    random = Random(seed)

    def crystal() -> Crystal:
        return Crystal(
            ppm=random.uniform(-PPM, PPM),
            drift_ppm=DRIFT_PPM,
            drift_period=DRIFT_PERIOD,
            jitter=jitter,
        )

    servos = [Servo(serial=k + 1, crystal=crystal()) for k in range(count)]
    return Segment([Coupler(crystal=crystal()), *servos])


def run(count: int, seconds: float, jitter: float, seed: int) -> Outcome:
    """One segment."""
    start = time.perf_counter()
    segment = make_segment(count, jitter, seed)
    truth = Truth(segment)
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(
            main.scan().drives, counts_per_turn=COUNTS_PER_TURN, velocity_limit=100.0, dc=True
        )
        entered = segment.now_ns
        with cat.Loop(arm, period=PERIOD) as loop:
            loop.wait_locked(within=BOUND, timeout=LOCK_TIMEOUT)
            locked_after = (segment.now_ns - entered) * 1e-9
            list(main.events)
            first: float | None = None
            for cycle in loop:
                first = cycle.time if first is None else first
                if cycle.number % LOOKS == 0:
                    truth.look(loop)
                if cycle.time - first >= seconds:
                    break
        unlocked = sum(type(event).__name__ == "ClockUnlocked" for event in main.events)
    return truth.outcome(seconds, locked_after, unlocked, time.perf_counter() - start)


class Truth:
    """Owns the readings of a segment's clocks."""

    def __init__(self, segment: Segment) -> None:
        self._segment = segment
        self._positions = [d.position for d in segment if isinstance(d, Servo)]
        self._looks = self._beyond = self._worst = 0
        self._squares = 0.0
        self._reported = self._phase = 0.0

    def look(self, loop: cat.Loop) -> None:
        core = self._segment.core
        reference = core.system_time(0)
        differences = [abs(core.system_time(p) - reference) for p in self._positions]
        largest = max(differences)
        self._looks += 1
        self._beyond += largest >= BOUND * 1e9
        self._worst = max(self._worst, largest)
        self._squares += sum(d * d for d in differences)
        clocks = loop.clocks
        self._reported = max(self._reported, *map(abs, clocks.differences.values()))
        self._phase = max(self._phase, abs(clocks.phase_error))

    def outcome(self, seconds: float, locked_after: float, unlocked: int, took: float) -> Outcome:
        count = len(self._positions)
        return Outcome(
            devices=count,
            seconds=seconds,
            locked_after=round(locked_after, 6),
            worst_reported=round(self._reported * 1e6, 3),
            worst_true=self._worst * 1e-3,
            rms_true=round((self._squares / (self._looks * count)) ** 0.5 * 1e-3, 3),
            looks=self._looks,
            looks_beyond=self._beyond,
            worst_phase=round(self._phase * 1e6, 3),
            times_unlocked=unlocked,
            took=round(took, 1),
        )
