"""Proportional force feedback: the passivity limit, and behaviour on both sides of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from catenary import control
from tests.control.two_sides import PERIOD, Delay, Side, constant

K, B = 5.0, 0.1
PEER = (K, B)


def test_the_limit_is_the_stated_formula() -> None:
    block = control.ForceFeedback(1, 0.1, 0.2, PEER, 0.02, PERIOD)
    trip, room = 0.02 + 4e-3, B / K - 2e-3
    limit = 0.2 / (K * (trip + trip**2 / (4 * room)))
    assert block.largest_gain[0] == pytest.approx(limit)
    control.ForceFeedback(1, limit * 0.999, 0.2, PEER, 0.02, PERIOD)
    with pytest.raises(ValueError, match=r"is not passive with a delay of 20 ms; it must be below"):
        control.ForceFeedback(1, limit, 0.2, PEER, 0.02, PERIOD)


def test_a_follower_that_is_not_stable_permits_no_gain() -> None:
    with pytest.raises(ValueError, match="must be below 0"):
        control.ForceFeedback(1, 0.01, 0.2, (K, K * 1e-3), 0.02, PERIOD)


def test_without_a_delay_the_limit_is_that_of_the_sampled_loop() -> None:
    block = control.ForceFeedback(1, 1.0, 0.2, PEER, 0.0, 1e-9)
    assert block.largest_gain[0] > 1e5


@pytest.mark.parametrize("torque", [math.nan, math.inf])
def test_a_torque_that_is_not_finite_is_not_reflected(torque: float) -> None:
    block = control.ForceFeedback(1, 0.5, 0.2, PEER, 0.0, PERIOD)
    assert control.force_feedback(block.parameters, 0, torque, 2.0) == pytest.approx(-0.4)


def test_the_limit_bounds_the_reflected_torque() -> None:
    block = control.ForceFeedback(1, 0.5, 0.2, PEER, 0.0, PERIOD, limit=0.1)
    assert control.force_feedback(block.parameters, 0, 9.0, 0.0) == pytest.approx(-0.1)


def swing(gain: float, periods: int, damping: float) -> float:
    """Push a leader whose follower stands at a wall. Return its largest late deflection [rad]."""
    block = control.ForceFeedback(1, 0.0, damping, PEER, 0.0, 1e-9)
    row = np.array(block.parameters)
    row[1] = gain
    leader = Side(velocity=1.0)
    there, back = Delay(constant(periods), 0.0), Delay(constant(periods), 0.0)
    for k in range(3000):
        spring = K * float(there.step(k, leader.position))  # type: ignore[arg-type]
        felt = float(back.step(k, spring))  # type: ignore[arg-type]
        leader.step(k * PERIOD, control.force_feedback(row, 0, felt, leader.velocity))
    return max(map(abs, leader.positions[-500:]))


def test_below_the_limit_a_wall_is_felt_stably_and_far_above_it_is_not() -> None:
    limit = control.ForceFeedback(1, 0.0, 0.2, PEER, 0.04, PERIOD).largest_gain[0]
    assert swing(0.95 * limit, 20, 0.2) < 1e-3
    assert swing(6 * limit, 20, 0.2) > 1.0


def test_other_parameters_are_refused() -> None:
    with pytest.raises(ValueError, match="not the parameters of a ForceFeedback"):
        control.force_feedback(control.Pid(1, 1.0).parameters, 0, 0.0, 0.0)
