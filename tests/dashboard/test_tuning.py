"""Figures for tuning, compared with simulated axes of known parameters."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from catenary.dashboard.tuning import Capture, bode, crossing, identify, margins

PERIOD = 1e-3
TIME = np.arange(0.0, 20.0, PERIOD)


def chirp(amplitude: float = 0.2) -> np.ndarray:
    return amplitude * signal.chirp(TIME, 0.2, TIME[-1], 40.0, "logarithmic", phi=-90)


def moved(commanded: np.ndarray, rate: float, damping: float) -> Capture:
    """Return the capture of a second-order position loop T = w² / (s² + 2 d w s + w²)."""
    system = signal.TransferFunction([rate**2], [1, 2 * damping * rate, rate**2])
    _, position, _ = signal.lsim(system, commanded, TIME)
    velocity = np.gradient(position, PERIOD)
    return Capture(PERIOD, position, commanded, velocity, np.zeros_like(position))


def test_the_response_and_its_margins_are_those_of_the_loop() -> None:
    rate, damping = 2 * np.pi * 5.0, 0.7
    found = bode(moved(chirp(), rate, damping))
    s = 2j * np.pi * found.frequency
    expected = rate**2 / (s**2 + 2 * damping * rate * s + rate**2)
    low = found.frequency < 15
    assert np.allclose(found.magnitude_db[low], 20 * np.log10(abs(expected))[low], atol=0.5)
    # L = w² / (s (s + 2 d w)): crossover and phase margin in closed form
    cross = rate * np.sqrt(np.sqrt(1 + 4 * damping**4) - 2 * damping**2)
    assert found.crossover == pytest.approx(cross / (2 * np.pi), rel=0.05)
    phase = np.degrees(np.arctan(2 * damping * rate / cross))
    assert found.phase_margin_deg == pytest.approx(phase, abs=3)
    assert found.bandwidth == pytest.approx(5.05, rel=0.05)


def test_the_gain_margin_of_a_third_order_loop() -> None:
    frequency = np.linspace(0.01, 10.0, 20_000)
    s = 2j * np.pi * frequency
    gain, phase, crossover = margins(frequency, 2.0 / (s * (s + 1) * (s / 2 + 1)))
    assert gain == pytest.approx(20 * np.log10(1.5), abs=0.02)  # K_max = 3 for K = 2
    assert phase is not None
    assert 0 < phase < 30
    assert crossover is not None


def test_a_regression_finds_inertia_and_friction() -> None:
    position = chirp()
    velocity = np.gradient(position, PERIOD)
    acceleration = np.gradient(velocity, PERIOD)
    noise = np.random.default_rng(1).normal(0.0, 0.05, len(TIME))
    torque = 0.4 * acceleration + 1.5 * velocity + 2.0 * np.sign(velocity) - 3.0 + noise
    slow = TIME < 12  # the derivative smooths fast motions
    found = identify(Capture(PERIOD, *(v[slow] for v in (position, position, velocity, torque))))
    assert found.inertia == pytest.approx(0.4, rel=0.03)
    assert found.viscous == pytest.approx(1.5, rel=0.03)
    assert found.coulomb == pytest.approx(2.0, rel=0.03)
    assert found.offset == pytest.approx(-3.0, rel=0.02)
    assert found.determination > 0.99
    assert all(0 < error < 0.05 for error in found.errors)


@pytest.mark.parametrize(
    ("rows", "change", "message"),
    [
        (100, 1.0, "too few"),
        (1000, 0.0, "did not move"),
        (1000, np.nan, "not known"),
    ],
)
def test_unusable_captures_are_refused(rows: int, change: float, message: str) -> None:
    position = change * np.linspace(0.0, 1.0, rows)
    capture = Capture(PERIOD, position, position, position, position)
    for analyse in (bode, identify):
        with pytest.raises(ValueError, match=message):
            analyse(capture)


def test_uniform_motion_does_not_identify_an_axis() -> None:
    ones = np.ones(2000)
    with pytest.raises(ValueError, match="too uniform"):
        identify(Capture(PERIOD, np.linspace(0, 1, 2000), ones, ones, ones))


def test_a_crossing_is_interpolated() -> None:
    assert crossing(np.array([1.0, 2.0, 3.0]), np.array([2.0, 1.0, -1.0])) == 2.5
    assert crossing(np.array([1.0, 2.0]), np.array([2.0, 1.0])) is None
