"""A terminal samples a wave ten times per cycle, on a clock that drifts, and another one puts a
wave out. The reconstructed wave has no missing and no repeated sample. Each sample has its time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

import catenary as cat
from catenary.virtual import Coupler, Crystal, OversamplingTerminal, Segment

SAMPLES = 10
PERIOD = 1e-3
FREQUENCY = 437.0  # [Hz] nearly half of the frequency of the cycles
AMPLITUDE = 20_000
CYCLES = 400


def wave(time: float) -> int:
    return round(AMPLITUDE * math.sin(2 * math.pi * FREQUENCY * time))


@contextmanager
def opened(
    terminal: OversamplingTerminal, kind: type[cat.Inputs] | type[cat.Outputs]
) -> Iterator[tuple[Segment, cat.Inputs | cat.Outputs, cat.Loop]]:
    segment = Segment([Coupler(), terminal])
    dc = cat.DistributedClock(op_mode=f"DcSync{terminal.samples}")
    with cat.MainDevice(segment) as main:
        channels = kind(main.scan()[1], dc=dc, oversampling=terminal.samples)
        with cat.Loop(channels, period=PERIOD) as loop:
            loop.wait_locked()
            yield segment, channels, loop


@pytest.mark.parametrize("crystal", [Crystal(), Crystal(ppm=80.0, jitter=0.2e-6)])
def test_a_sampled_wave_has_no_gaps(crystal: Crystal) -> None:
    terminal = OversamplingTerminal(channels=2, samples=SAMPLES, crystal=crystal)
    terminal.apply_wave(0, wave)
    counter = iter(range(1 << 30))
    terminal.apply_wave(1, lambda _: next(counter) % 30_000)
    with opened(terminal, cat.Inputs) as (_, inputs, loop):
        times, values = [], []
        for cycle in loop:
            assert inputs.samples.shape == (2, SAMPLES)
            times.append(inputs.sample_times(cycle))
            values.append(inputs.samples.copy())
            if len(times) == CYCLES:
                break
    time, [curve, count] = np.concatenate(times), np.concatenate(values, axis=1)
    assert (np.diff(count) % 30_000 == 1).all()  # no sample is missing or repeated
    assert np.diff(time) == pytest.approx(PERIOD / SAMPLES, abs=1e-6)
    # a sine of the known frequency, with the phase of the clock, fits all samples
    basis = np.stack([f(2 * np.pi * FREQUENCY * time) for f in (np.sin, np.cos)], axis=1)
    factors, *_ = np.linalg.lstsq(basis, curve, rcond=None)
    assert np.hypot(*factors) == pytest.approx(AMPLITUDE, rel=1e-3)
    assert np.abs(basis @ factors - curve).max() < 0.01 * AMPLITUDE


def test_the_outputs_put_every_sample_out() -> None:
    terminal = OversamplingTerminal(direction="outputs", channels=1, samples=SAMPLES)
    with opened(terminal, cat.Outputs) as (_, outputs, loop):
        start = 1
        for _ in loop:
            outputs.samples[0] = np.arange(start, start + SAMPLES)
            start += SAMPLES
            if start > CYCLES * SAMPLES:
                break
        recorded = [(time, value) for time, [value] in terminal.wave if value]
    times, values = np.array(recorded).T
    assert len(values) > (CYCLES - 10) * SAMPLES
    assert (np.diff(values) == 1).all()
    assert np.diff(times) == pytest.approx(PERIOD / SAMPLES, abs=1e-8)
