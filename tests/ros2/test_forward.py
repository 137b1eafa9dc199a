"""Forwarded set-points: checks, limits and the time-out."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from catenary.ros2.forward import CommandError, ForwardCommand, Quantity
from catenary.ros2.goal import AxisStates
from tests.ros2.trajectories import JOINTS, limits

REST = np.zeros(2)


def array(*values: float) -> Any:
    return SimpleNamespace(data=values)


def state(*commanded: float) -> AxisStates:
    return AxisStates(REST, REST, np.array(commanded or REST))


def forward(quantity: Quantity = "position", **more: Any) -> ForwardCommand:
    torque = 10.0 if quantity == "torque" else None
    return ForwardCommand(JOINTS, limits(**more), quantity, 0.1, torque_limit=torque)


def test_a_position_is_approached_with_the_velocity_limit() -> None:
    it = forward(velocity=2.0)
    it.accept(array(0.05, -0.01), 10.0, state())
    assert it.sample(10.01, state()) == pytest.approx([0.02, -0.01])
    assert it.sample(10.02, state()) == pytest.approx([0.04, -0.01])
    assert it.sample(10.03, state()) == pytest.approx([0.05, -0.01])


def test_positions_begin_where_the_axes_are_commanded() -> None:
    it = forward()
    it.accept(array(1.0, 1.0), 10.0, state(0.99, 1.0))
    assert it.sample(10.0, state(0.99, 1.0)) == pytest.approx([0.99, 1.0])


def test_without_a_message_there_is_no_command() -> None:
    assert forward().sample(10.0, state()) is None


@pytest.mark.parametrize(
    ("quantity", "values", "text"),
    [
        ("position", (0.0,), "1 values for 2 joints"),
        ("position", (0.0, math.nan), "not finite"),
        ("position", (0.0, 3.5), "position 3.5 rad for b is beyond the limit 3"),
        ("velocity", (-2.5, 0.0), "velocity -2.5 rad/s for a is beyond the limit -2"),
        ("torque", (11.0, 0.0), "torque 11 N·m for a is beyond the limit 10"),
    ],
)
def test_bad_values_are_refused(quantity: Quantity, values: tuple[float, ...], text: str) -> None:
    it = forward(quantity)
    with pytest.raises(CommandError, match=text):
        it.accept(array(*values), 10.0, state())
    assert it.sample(10.0, state()) is None


def test_after_the_time_out_positions_hold() -> None:
    it = forward()
    it.accept(array(1.0, 0.0), 10.0, state())
    assert it.sample(10.1, state()) is not None
    assert it.sample(10.11, state()) is None
    assert (it.active, it.timeouts) == (False, 1)


def test_a_refused_message_does_not_delay_the_time_out() -> None:
    it = forward()
    it.accept(array(1.0, 0.0), 10.0, state())
    with pytest.raises(CommandError):
        it.accept(array(9.0, 0.0), 10.09, state())
    assert it.sample(10.11, state()) is None


def test_after_the_time_out_velocities_decelerate_to_zero() -> None:
    it = forward("velocity", deceleration=4.0)
    speeds = []
    for k in range(100):
        now = 10 + 0.01 * k
        if k <= 40:
            it.accept(array(1.0, -0.5), now, state())
        speeds.append(it.sample(now, state()))
    assert speeds[30] == pytest.approx([1.0, -0.5])
    ends = [k for k, row in enumerate(speeds) if row is None]
    assert ends[0] == pytest.approx(50 + 25, abs=1)  # 0.1 s of time-out, 0.25 s of braking
    rows = np.array([row for row in speeds if row is not None])
    assert abs(np.diff(rows, axis=0)).max() <= 0.04 + 1e-9


def test_a_velocity_stops_at_a_position_limit() -> None:
    it, position = forward("velocity", position_max=0.5), REST
    for k in range(200):
        now = 10 + 0.01 * k
        it.accept(array(1.0, 0.0), now, state())
        speed = it.sample(now, state(*position))
        assert speed is not None
        position = position + speed * 0.01
    assert position[0] == pytest.approx(0.5, abs=0.02)
    assert position[0] <= 0.5 + 1e-3


def test_a_torque_ends_with_the_time_out() -> None:
    it = forward("torque")
    it.accept(array(3.0, -1.0), 10.0, state())
    assert it.sample(10.05, state()) == pytest.approx([3.0, -1.0])
    assert it.sample(10.2, state()) is None


def test_each_axis_has_its_own_torque_limit() -> None:
    it = ForwardCommand(JOINTS, limits(), "torque", 0.1, torque_limit=[10.0, 2.0])
    it.accept(array(9.0, -2.0), 10.0, state())
    with pytest.raises(CommandError, match="torque -3 N·m for b is beyond the limit -2"):
        it.accept(array(9.0, -3.0), 10.0, state())


def test_torques_need_a_limit() -> None:
    with pytest.raises(ValueError, match="torque_limit"):
        ForwardCommand(JOINTS, limits(), "torque", 0.1)


def test_a_stop_ends_the_command() -> None:
    it = forward()
    it.accept(array(1.0, 0.0), 10.0, state())
    it.stop()
    assert it.sample(10.01, state()) is None


@pytest.mark.parametrize("quantity", ["position", "velocity"])
def test_unknown_limits_are_infinite(quantity: Quantity) -> None:
    it = forward(quantity, velocity=math.inf, deceleration=math.inf, position_max=0.0)
    it.accept(array(-0.5, -1.0), 10.0, state())
    assert np.isfinite(it.sample(10.0, state())).all()
    assert it.sample(10.01, state()) == pytest.approx([-0.5, -1.0])
