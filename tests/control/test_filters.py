"""Low-pass and chirp against scipy; the frequency response of a plant that is known."""

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


def test_it_begins_at_rest_at_its_first_input() -> None:
    block = control.LowPass(1, 250.0, PERIOD)
    memory = block.memory
    assert [control.low_pass(memory, block.parameters, 0, 7.0) for _ in range(5)] == [
        pytest.approx(7.0)
    ] * 5


@pytest.mark.parametrize(
    ("cutoff", "period", "message"),
    [
        ([250.0, 1000.0], PERIOD, "cutoff of axis 1: 1000 Hz, must be below half the rate, 1000"),
        (0.0, PERIOD, "cutoff of axis 0: 0.0, must be above"),
        (250.0, 0.0, "period=0.0 s"),
    ],
)
def test_a_cutoff_that_cannot_be(cutoff, period: float, message: str) -> None:
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
    with pytest.raises(ValueError, match="last of axis 0: 5 Hz, the same as first"):
        control.Chirp(1, 1.0, 5.0, 5.0, 1.0)


@cache
def identified(noise: float) -> control.FrequencyResponse:
    """Torque → velocity of 1/(m s + b), corner at 10 rad/s as RDDA's, by a chirp."""
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
    # a sweep is no stationary signal: 10 Hz in a piece leak a little
    assert found.magnitude_db[band] == pytest.approx(20 * np.log10(abs(expected[band])), abs=0.6)
    assert found.phase_deg[band] == pytest.approx(np.degrees(np.angle(expected[band])), abs=6)
    corner = found.frequency[np.argmin(abs(found.magnitude_db - 20 * np.log10(10 / math.sqrt(2))))]
    assert corner * 2 * np.pi == pytest.approx(10.0, rel=0.1)


def test_coherence_tells_noise_from_answer() -> None:
    clean, noisy = identified(0.0), identified(2.0)
    band = (clean.frequency > 0.4) & (clean.frequency < 20.0)
    assert clean.coherence[band].min() > 0.97
    assert noisy.coherence[band].mean() < 0.8


def test_response_and_coherence_are_scipys() -> None:
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
        (np.zeros(100), np.zeros(99), {}, "equally long"),
        (np.zeros(100), np.zeros(100), {"segment": 4}, "at least 8"),
        (np.zeros(100), np.zeros(100), {"segment": 100}, "no coherence"),
        (np.zeros(100), np.zeros(100), {"period": 0.0}, "period=0.0"),
    ],
)
def test_records_that_say_nothing(x, y, options: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        control.frequency_response(x, y, **{"period": PERIOD, **options})
