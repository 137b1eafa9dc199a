"""Low-pass and chirp compared with scipy; the frequency response of a known plant."""

import math
from functools import cache

import numpy as np
import pytest
from scipy import signal

from catenary import control

PERIOD = 500e-6  # 2 kHz


@pytest.mark.parametrize("cutoff", [1.0, 250.0, 900.0])
def test_the_low_pass_is_scipys_butterworth(cutoff: float) -> None:
    block = control.LowPass(2, [cutoff, 100.0], PERIOD)
    b, a = signal.butter(2, cutoff, fs=1 / PERIOD)
    assert block.parameters[1:6] == pytest.approx([*b, *a[1:]], rel=1e-9)
    given = np.random.default_rng(0).normal(size=2000) + 3.0
    memory = block.memory
    got = [control.low_pass(memory, block.parameters, 0, x) for x in given]
    begin = signal.lfilter_zi(b, a) * given[0]
    expected, _ = signal.lfilter(b, a, given, zi=begin)
    assert got == pytest.approx(expected, abs=1e-9)


def test_the_low_pass_starts_settled_at_its_first_input() -> None:
    block = control.LowPass(1, 250.0, PERIOD)
    memory = block.memory
    assert [control.low_pass(memory, block.parameters, 0, 7.0) for _ in range(5)] == [
        pytest.approx(7.0)
    ] * 5


@pytest.mark.parametrize(
    ("cutoff", "period", "message"),
    [
        ([250.0, 1000.0], PERIOD, "cutoff of axis 1 is 1000 Hz; it must be below half .* 1000"),
        (0.0, PERIOD, "cutoff of axis 0 is 0.0; it must be above"),
        (250.0, 0.0, "period=0.0 s"),
    ],
)
def test_an_invalid_cutoff_is_refused(cutoff, period: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        control.LowPass(2, cutoff, period)


def test_the_chirp_is_scipys_logarithmic_one() -> None:
    block = control.Chirp(2, 0.5, [0.1, 50.0], [80.0, 2.0], 10.0)
    time = np.linspace(0, 10, 5001)
    for axis, (first, last) in enumerate([(0.1, 80.0), (50.0, 2.0)]):
        got = [control.chirp(block.parameters, axis, t) for t in time]
        expected = 0.5 * signal.chirp(time, first, 10.0, last, method="logarithmic", phi=-90)
        assert got == pytest.approx(expected, abs=1e-6)
    assert control.chirp(block.parameters, 0, 10.001) == 0.0
    assert control.chirp(block.parameters, 0, -0.1) == 0.0


def test_a_chirp_of_one_frequency_is_refused() -> None:
    with pytest.raises(ValueError, match="first and last of axis 0 are both 5 Hz"):
        control.Chirp(1, 1.0, 5.0, 5.0, 1.0)


@cache
def identified(noise: float) -> control.FrequencyResponse:
    """Identify 1 / (m s + b) with a chirp, from torque to velocity; its corner is 10 rad/s."""
    m, b = 0.01, 0.1
    block = control.Chirp(1, 0.2, 0.05, 50.0, 40.0)
    time = np.arange(0, 40, 2 * PERIOD)
    torque = np.array([control.chirp(block.parameters, 0, t) for t in time])
    pole = math.exp(-b / m * 2 * PERIOD)
    velocity = signal.lfilter([0, (1 - pole) / b], [1, -pole], torque)
    velocity += noise * np.random.default_rng(2).normal(size=len(time))
    return control.frequency_response(torque, velocity, 2 * PERIOD, segment=10_000)


def test_the_frequency_response_finds_plant_and_corner() -> None:
    found = identified(noise=0.0)
    band = (found.frequency > 0.4) & (found.frequency < 20.0)
    expected = 1 / (0.01j * 2 * np.pi * found.frequency + 0.1)
    # a sweep is not stationary: it covers 10 Hz per segment, which causes some leakage
    assert found.magnitude_db[band] == pytest.approx(20 * np.log10(abs(expected[band])), abs=0.6)
    assert found.phase_deg[band] == pytest.approx(np.degrees(np.angle(expected[band])), abs=6)
    corner = found.frequency[np.argmin(abs(found.magnitude_db - 20 * np.log10(10 / math.sqrt(2))))]
    assert corner * 2 * np.pi == pytest.approx(10.0, rel=0.1)


def test_noise_reduces_the_coherence() -> None:
    clean, noisy = identified(0.0), identified(2.0)
    band = (clean.frequency > 0.4) & (clean.frequency < 20.0)
    assert clean.coherence[band].min() > 0.97
    assert noisy.coherence[band].mean() < 0.8


def test_response_and_coherence_equal_scipys() -> None:
    rng = np.random.default_rng(5)
    x = rng.normal(size=4096)
    y = signal.lfilter([0.2, 0.3], [1, -0.5], x) + 0.3 * rng.normal(size=4096)
    found = control.frequency_response(x, y, PERIOD, segment=512)
    options = {"fs": 1 / PERIOD, "window": "hann", "nperseg": 512, "noverlap": 256}
    frequency, cross = signal.csd(x, y, **options)
    _, power = signal.welch(x, **options)
    _, coherence = signal.coherence(x, y, **options)
    assert found.frequency == pytest.approx(frequency[1:])
    assert found.response[:-1] == pytest.approx((cross / power)[1:-1])
    assert found.coherence == pytest.approx(coherence[1:])


@pytest.mark.parametrize(
    ("x", "y", "options", "message"),
    [
        (np.zeros(100), np.zeros(99), {}, "equal length"),
        (np.zeros(100), np.zeros(100), {"segment": 4}, "from 8 to 100 samples"),
        (np.zeros(100), np.zeros(100), {"segment": 100}, "the coherence needs"),
        (np.zeros(100), np.zeros(100), {"period": 0.0}, "period=0.0"),
    ],
)
def test_unusable_recordings_are_refused(x, y, options: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        control.frequency_response(x, y, **{"period": PERIOD, **options})
