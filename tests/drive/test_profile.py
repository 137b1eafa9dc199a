"""Profiles of one axis: each ends at rest at its goal and keeps its rates."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.drive.profile import Motion, Profile, Rates, make_profile, make_stop

STEPS = 200
positions = st.floats(-5, 5)
velocities = st.floats(-3, 3)
limits = st.floats(0.1, 3)


def samples(profile: Profile) -> list[Motion]:
    return [profile.at(profile.duration * k / STEPS) for k in range(STEPS + 1)]


def check_motion(profile: Profile, start: Motion, rates: Rates, speed: float) -> None:
    """Check that a profile is continuous, keeps its rates, and ends at rest."""
    step = profile.duration / STEPS
    for before, after in pairwise(samples(profile)):
        assert abs(after.velocity) <= speed * (1 + 1e-6) + 1e-9
        assert (
            abs(after.velocity - before.velocity) <= rates.acceleration * step * (1 + 1e-6) + 1e-6
        )
        assert abs(after.position - before.position) <= speed * step * (1 + 1e-6) + 1e-6
    assert profile.at(0.0).position == pytest.approx(start.position)
    assert profile.at(0.0).velocity == pytest.approx(start.velocity, abs=1e-9)
    assert profile.at(profile.duration + 1) == Motion(profile.goal)


@given(positions, velocities, positions, limits, limits)
def test_a_trapezoid(
    position: float, velocity: float, goal: float, limit: float, acceleration: float
) -> None:
    start, rates = Motion(position, velocity), Rates(limit, acceleration)
    profile = make_profile(start, goal, rates)
    assert profile.goal == goal
    check_motion(profile, start, rates, max(limit, abs(velocity)))


@given(positions, velocities, limits)
def test_a_stop(position: float, velocity: float, acceleration: float) -> None:
    start, rates = Motion(position, velocity), Rates(1.0, acceleration)
    profile = make_stop(start, rates)
    assert profile.duration == pytest.approx(abs(velocity) / acceleration)
    check_motion(profile, start, rates, abs(velocity))


@given(positions, velocities, positions, limits, limits)
def test_limited_jerk(
    position: float, velocity: float, goal: float, limit: float, acceleration: float
) -> None:
    pytest.importorskip("ruckig")
    start, rates = Motion(position, velocity), Rates(limit, acceleration, 10.0)
    check_motion(make_profile(start, goal, rates), start, rates, max(limit, abs(velocity)))
    check_motion(make_stop(start, rates), start, rates, abs(velocity))


def test_a_start_above_the_velocity_limit_decelerates_first() -> None:
    profile = make_profile(Motion(0.0, 2.0), 5.0, Rates(1.0, 4.0))
    assert profile.at(0.25).velocity == pytest.approx(1.0)
    assert profile.at(1.0).velocity == pytest.approx(1.0)


def test_a_profile_of_no_distance() -> None:
    profile = make_profile(Motion(1.0), 1.0, Rates(1.0, 1.0))
    assert profile.duration == 0.0
    assert profile.at(0.0) == Motion(1.0)
