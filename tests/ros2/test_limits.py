"""Limits, tolerances and stops of axes."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.ros2.limits import AxisLimits, Tolerances, overridden, stop_time
from catenary.ros2.waypoints import Code, TrajectoryError
from tests.ros2.trajectories import JOINTS, limits

DEFAULT = Tolerances.of(2, path=0.1, goal=[0.2, 0.3], goal_time=0.5)


def tolerance(name: str, position: float) -> Any:
    return SimpleNamespace(name=name, position=position)


def test_requested_tolerances_replace_the_default() -> None:
    found = overridden(DEFAULT, JOINTS, [tolerance("b", 0.05)], [tolerance("a", 0.01)], 2.0)
    assert found.path.tolist() == [0.1, 0.05]
    assert found.goal.tolist() == [0.01, 0.3]
    assert found.goal_time == 2.0
    assert DEFAULT.path.tolist() == [0.1, 0.1]


def test_zero_selects_the_default_and_a_negative_value_disables_the_check() -> None:
    found = overridden(DEFAULT, JOINTS, [tolerance("a", 0.0), tolerance("b", -1.0)], [], -1.0)
    assert found.path.tolist() == [0.1, math.inf]
    assert found.goal_time == math.inf
    assert overridden(DEFAULT, JOINTS, [], [], 0.0).goal_time == 0.5


@pytest.mark.parametrize(
    ("name", "value", "code"),
    [("c", 0.1, Code.INVALID_JOINTS), ("a", math.nan, Code.INVALID_GOAL)],
)
def test_bad_tolerances_are_refused(name: str, value: float, code: Code) -> None:
    with pytest.raises(TrajectoryError) as caught:
        overridden(DEFAULT, JOINTS, [tolerance(name, value)], [], 0.0)
    assert caught.value.code == code


@pytest.mark.parametrize("name", ["velocity", "deceleration"])
def test_limits_must_be_positive(name: str) -> None:
    with pytest.raises(ValueError, match=name):
        AxisLimits.of(2, **{"velocity": 1.0, "deceleration": 1.0, name: 0.0})


@pytest.mark.parametrize("name", ["goal_time", "stopped_velocity", "path", "goal"])
def test_tolerances_must_be_positive(name: str) -> None:
    with pytest.raises(ValueError, match=name):
        Tolerances.of(2, **{name: 0.0})


@given(
    st.lists(st.floats(-3, 3), min_size=2, max_size=2),
    st.lists(st.floats(-2, 2), min_size=2, max_size=2),
)
def test_a_stop_ends_within_the_position_limits(q: list[float], v: list[float]) -> None:
    bounds, position, velocity = limits(), np.array(q), np.array(v)
    duration = stop_time(bounds, position, velocity)
    end = position + velocity * duration / 2
    assert (end <= bounds.position_max + 1e-6).all()
    assert (end >= bounds.position_min - 1e-6).all()
    needed = abs(velocity).max() / 4.0
    assert duration <= needed + 1e-9


def test_a_stop_far_from_the_limits_uses_the_deceleration() -> None:
    assert stop_time(limits(), np.zeros(2), np.array([1.0, -2.0])) == pytest.approx(0.5)


def test_axes_at_rest_need_no_time_to_stop() -> None:
    assert stop_time(limits(), np.zeros(2), np.zeros(2)) == 0.0
