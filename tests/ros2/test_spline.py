"""Splines: values and rates at the waypoints, continuity, exact extremes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BPoly

from catenary.ros2.spline import Motion, Spline, Waypoint, exact_range, piece, spline

NUMBER = st.floats(-10, 10, allow_nan=False).map(lambda x: round(x, 3))
TRIPLE = st.tuples(NUMBER, NUMBER, NUMBER)
WIDE = np.array([np.inf])


def row(*values: float) -> np.ndarray:
    return np.array(values, dtype=float)


def still(*position: float) -> Motion:
    zero = np.zeros(len(position))
    return Motion(row(*position), zero, zero)


def test_positions_only_are_joined_by_straight_lines() -> None:
    path = spline(still(0.0), [Waypoint(1.0, row(2.0)), Waypoint(2.0, row(2.0))], 0.0)
    assert path.at(0.25).position == pytest.approx(0.5)
    assert path.at(0.25).velocity == pytest.approx(2.0)
    assert path.at(1.5).velocity == pytest.approx(0.0)


@given(TRIPLE, TRIPLE, st.floats(0.1, 5))
def test_a_quintic_segment_equals_the_hermite_polynomial_of_scipy(
    begin: tuple[float, ...], end: tuple[float, ...], duration: float
) -> None:
    points = [Waypoint(t, *map(row, values)) for t, values in ((0.0, begin), (duration, end))]
    path = Spline([0.0, duration], [piece(*points)])
    judge = BPoly.from_derivatives([0, duration], [list(begin), list(end)])
    for time in np.linspace(0, duration * 0.999, 7):
        motion = path.at(float(time))
        for order, value in enumerate(motion):
            scale = 100 / duration**order
            assert value[0] == pytest.approx(float(judge.derivative(order)(time)), abs=1e-9 * scale)


@given(TRIPLE, TRIPLE, st.floats(0.1, 5))
def test_a_cubic_segment_equals_the_hermite_polynomial_of_scipy(
    begin: tuple[float, ...], end: tuple[float, ...], duration: float
) -> None:
    points = [Waypoint(t, *map(row, v[:2])) for t, v in ((0.0, begin), (duration, end))]
    path = Spline([0.0, duration], [piece(*points)])
    judge = BPoly.from_derivatives([0, duration], [list(begin[:2]), list(end[:2])])
    for time in np.linspace(0, duration * 0.999, 7):
        assert path.at(float(time)).position[0] == pytest.approx(float(judge(time)), abs=1e-7)


def test_a_moving_start_keeps_its_velocity_before_positions_only() -> None:
    start = Motion(row(0.0), row(1.5), row(0.0))
    path = spline(start, [Waypoint(1.0, row(1.0)), Waypoint(2.0, row(3.0))], 0.0)
    assert path.at(0.0).velocity == pytest.approx(1.5)
    assert path.at(1.0 - 1e-9).velocity == pytest.approx(2.0)  # that of the next line
    assert path.at(1.5).velocity == pytest.approx(2.0)


def test_it_rests_after_the_last_waypoint() -> None:
    path = spline(still(0.0), [Waypoint(1.0, row(2.0))], 0.0)
    assert path.at(5.0).position == pytest.approx(2.0)
    assert not path.at(5.0).velocity.any()


@given(st.lists(NUMBER, min_size=6, max_size=6))
def test_the_exact_range_contains_all_values_and_is_reached(coefficients: list[float]) -> None:
    polynomial = np.array(coefficients)
    low, high = exact_range(polynomial)
    values = np.polyval(polynomial[::-1], np.linspace(0, 1, 2001))
    assert low <= values.min() + 1e-6
    assert high >= values.max() - 1e-6
    assert low >= values.min() - 1e-3
    assert high <= values.max() + 1e-3


@given(TRIPLE, TRIPLE, st.integers(0, 2))
def test_extremes_are_exact_beyond_the_limits(
    begin: tuple[float, ...], end: tuple[float, ...], order: int
) -> None:
    points = [Waypoint(t, *map(row, values)) for t, values in ((0.0, begin), (1.0, end))]
    path = Spline([0.0, 1.0], [piece(*points)])
    low, high = path.extremes(order, row(0.0), row(0.0))
    values = [path.at(t)[order][0] for t in np.linspace(0, 0.9999, 501)]
    slack = 1e-6 + 0.02 * (max(values) - min(values))
    assert min(values) - slack <= low[0] <= min(values) + 1e-6
    assert max(values) - 1e-6 <= high[0] <= max(values) + slack


def test_extremes_within_the_limits_are_bounds() -> None:
    start = Motion(row(0.0), row(1.0), row(0.0))
    path = spline(start, [Waypoint(1.0, row(0.0), row(-1.0))], 0.0)
    low, high = path.extremes(0, -WIDE, WIDE)
    assert low[0] <= 0.0
    assert high[0] >= 0.25  # reached at half the time
