"""PID and cascade: comparison with closed-form solutions, and behaviour at the limits."""

import math

import numpy as np
import pytest
from scipy import signal

from catenary import control

DT = 1e-3


def response(block: control.Pid, errors: np.ndarray, measured: float = 0.0) -> np.ndarray:
    """Return the output of axis 0 for each error."""
    memory, parameters = block.memory, block.parameters
    return np.array([control.pid(memory, parameters, 0, e, measured, 0.0, DT) for e in errors])


def test_proportional_and_integral_of_a_step() -> None:
    out = response(control.Pid(1, 2.0, 5.0), np.full(1000, 0.1))
    time = DT * np.arange(1000)
    assert out == pytest.approx(0.1 * (2.0 + 5.0 * time), abs=1e-9)


def test_the_filtered_derivative_is_the_first_order_filters() -> None:
    """kd s / (Tf s + 1), backward differences: scipy's filter with the same substitution."""
    kd, tf = 0.3, 0.02
    block = control.Pid(1, 0.0, derivative=kd, derivative_time=tf)
    memory, parameters = block.memory, block.parameters
    measured = np.sin(np.linspace(0, 3, 500))
    out = [control.pid(memory, parameters, 0, 0.0, y, 0.0, DT) for y in measured]
    shifted = measured - measured[0]
    expected = signal.lfilter([-kd / (tf + DT), kd / (tf + DT)], [1, -tf / (tf + DT)], shifted)
    assert out == pytest.approx(expected, abs=1e-9)


def test_the_integral_does_not_wind_up() -> None:
    """After ten seconds at the limit, the output leaves it when the error changes its sign."""
    block = control.Pid(1, 1.0, 2.0, limit=1.0)
    errors = np.concatenate([np.full(10_000, 3.0), np.full(2000, -0.5)])
    out = response(block, errors)
    assert out.max() <= 1.0
    assert out[9_999] == 1.0
    assert out[10_000 + 50] < 0.5
    without = np.clip(np.cumsum(2.0 * errors * DT) + errors, -1, 1)
    assert without[10_000 + 1999] == 1.0  # with wind-up


def test_neither_limit_nor_rate_is_exceeded() -> None:
    rng = np.random.default_rng(3)
    block = control.Pid(1, 5.0, 3.0, 0.01, limit=2.0, rate=40.0)
    out = response(block, rng.normal(size=3000))
    assert abs(out).max() <= 2.0
    assert abs(np.diff(out)).max() <= 40.0 * DT + 1e-12
    assert abs(np.diff(out)).max() == pytest.approx(40.0 * DT)


def test_the_output_starts_at_the_feed_forward() -> None:
    block = control.Pid(1, 0.0, limit=100.0, rate=10.0)
    memory = block.memory
    assert control.pid(memory, block.parameters, 0, 0.0, 0.0, 50.0, DT) == 50.0
    assert control.pid(memory, block.parameters, 0, 0.0, 0.0, 60.0, DT) == 50.0 + 10.0 * DT


def test_parameters_of_another_block_are_refused() -> None:
    one = control.Pid(1, 1.0)
    both = control.Cascade(one, one)
    with pytest.raises(ValueError, match="not the parameters of a Pid"):
        control.pid(one.memory, both.parameters, 0, 0.0, 0.0, 0.0, DT)
    with pytest.raises(ValueError, match="not the parameters of a Cascade"):
        control.cascade(both.memory, one.parameters, 0, 0.0, 0.0, 0.0, 0.0, 0.0, DT)


def moved(block: control.Cascade, inertia: float, load: float, seconds: float) -> np.ndarray:
    """Return position, velocity and torque (k, 3) of an inertia that moves from 0 to 1 rad."""
    memory, parameters = block.memory, block.parameters
    q = v = 0.0
    track = []
    for _ in range(round(seconds / DT)):
        torque = control.cascade(memory, parameters, 0, 1.0, 0.0, 0.0, q, v, DT)
        v += (torque - load) / inertia * DT
        q += v * DT
        track.append((q, v, torque))
    return np.array(track)


def test_a_cascade_reaches_its_goal_under_load_within_its_limits() -> None:
    block = control.Cascade(
        control.Pid(1, 10.0, limit=2.0, rate=25.0),
        control.Pid(1, 40.0, 400.0, limit=30.0, rate=3000.0),
    )
    track = moved(block, inertia=1.0, load=5.0, seconds=4.0)
    assert track[-1] == pytest.approx([1.0, 0.0, 5.0], abs=1e-4)
    assert track[:, 1].max() < 2.0 * 1.15
    assert abs(track[:, 2]).max() <= 30.0
    assert abs(np.diff(track[:, 2])).max() <= 3000.0 * DT + 1e-9
    assert track[:, 0].max() < 1.02


def test_a_cascade_has_the_step_response_of_the_linear_system() -> None:
    """P over PI on an inertia, far from all limits, against the step response of scipy."""
    kp, kv, ki, inertia = 8.0, 20.0, 100.0, 0.5
    track = moved(
        control.Cascade(control.Pid(1, kp), control.Pid(1, kv, ki)), inertia, 0.0, seconds=2.0
    )
    closed = signal.TransferFunction([kp * kv, kp * ki], [inertia, kv, ki + kp * kv, kp * ki])
    time, expected = signal.step(closed, T=DT * np.arange(1, len(track) + 1))
    assert track[:, 0] == pytest.approx(expected, abs=0.02)
    assert math.isclose(time[-1], 2.0)


def test_axes_are_independent() -> None:
    block = control.Cascade(control.Pid(3, [1, 2, 3]), control.Pid(3, 1.0, 1.0))
    memory = block.memory
    torque = [control.cascade(memory, block.parameters, 2, 1.0, 0, 0, 0, 0, DT) for _ in range(9)]
    assert torque[0] == pytest.approx(3.0)
    assert not memory[:20].any()
    assert memory[20:].any()
