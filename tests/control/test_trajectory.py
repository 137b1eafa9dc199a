"""Trajectories: finite differences of all samples stay within the limits; invalid input fails."""

import sys

import numpy as np
import pytest

from catenary import control
from catenary.errors import ConfigurationError

PERIOD = 1e-3
LIMITS = control.MotionLimits(velocity=[1.5, 1.0, 2.0], acceleration=[6.0, 5.0, 9.0], jerk=60.0)
HOME = np.zeros(3)


def assert_within(motion: control.Trajectory, start: control.MotionState) -> None:
    """Check the differences of the samples, not the derivatives that ruckig reports."""
    n = motion.position.shape[1]
    q = np.vstack([start.position, motion.position])
    v = np.vstack([start.velocity, motion.velocity])
    a = np.vstack(
        [np.zeros(n) if start.acceleration is None else start.acceleration, motion.acceleration]
    )
    assert (abs(np.diff(q, axis=0)) / PERIOD <= np.array(LIMITS.velocity) + 1e-6).all()
    assert (abs(np.diff(v, axis=0)) / PERIOD <= np.array(LIMITS.acceleration) + 1e-6).all()
    assert (abs(np.diff(a, axis=0)) / PERIOD <= LIMITS.jerk + 1e-6).all()
    # position, velocity and acceleration are consistent: the trapezoidal rule holds up to the jerk
    steps = PERIOD * (v[1:] + v[:-1]) / 2
    assert np.diff(q, axis=0) == pytest.approx(steps, abs=LIMITS.jerk * PERIOD**3)
    steps = PERIOD * (a[1:] + a[:-1]) / 2
    assert np.diff(v, axis=0) == pytest.approx(steps, abs=LIMITS.jerk * PERIOD**2)


def at_rest(position) -> control.MotionState:
    return control.MotionState(position, np.zeros(len(position)))


@pytest.mark.parametrize("seed", range(8))
def test_every_sample_is_within_the_limits(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start, goal = rng.uniform(-3, 3, (2, 3))
    motion = control.trajectory(start, goal, LIMITS, PERIOD)
    assert_within(motion, at_rest(start))
    assert motion.position[-1].tolist() == goal.tolist()
    assert not motion.velocity[-1].any()
    assert 0 <= len(motion) * PERIOD - motion.duration < PERIOD


@pytest.mark.parametrize("seed", range(8))
def test_from_a_moving_start(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start = control.MotionState(
        rng.uniform(-3, 3, 3), rng.uniform(-0.8, 0.8, 3), rng.uniform(-3, 3, 3)
    )
    motion = control.trajectory(start, rng.uniform(-3, 3, 3), LIMITS, PERIOD)
    assert_within(motion, start)


def test_all_axes_arrive_together_and_the_slowest_reaches_its_limit() -> None:
    motion = control.trajectory(HOME, [0.5, 2.0, 0.1], LIMITS, PERIOD)
    moving = abs(np.diff(motion.position, axis=0)) > 1e-12
    assert moving[-5:-1].all()
    assert motion.velocity[:, 1].max() == pytest.approx(1.0, abs=1e-6)
    # duration of a motion of one axis with all seven phases: q / v + v / a + a / j
    assert motion.duration == pytest.approx(2.0 / 1.0 + 1.0 / 5.0 + 5.0 / 60.0, abs=1e-6)


def test_a_motion_through_waypoints_rests_at_each() -> None:
    way = [[0.3, 0.0, -0.3], [0.3, 0.5, 0.3], [0.0, 0.0, 0.0]]
    motion = control.trajectory(HOME, way, LIMITS, PERIOD)
    assert_within(motion, at_rest(HOME))
    for point in way:
        nearest = np.argmin(abs(motion.position - point).max(axis=1))
        assert motion.position[nearest] == pytest.approx(point, abs=1e-5)
        assert abs(motion.velocity[nearest]).max() < 0.05
    single = [
        control.trajectory(a, b, LIMITS, PERIOD).duration
        for a, b in zip([HOME, *way[:-1]], way, strict=True)
    ]
    assert motion.duration == pytest.approx(sum(single))


def test_single_rows_equal_the_arrays() -> None:
    goals = [[1.0, -0.5], [0.2, 0.3]]
    limits = control.MotionLimits(1.0, 5.0, 50.0)
    motion = control.trajectory([0.0, 0.0], goals, limits, 0.01)
    rows = np.array([motion.row(k) for k in range(len(motion))])
    arrays = [motion.position, motion.velocity, motion.acceleration]
    assert np.array_equal(rows, np.stack(arrays, axis=1))
    with pytest.raises(IndexError, match="row 3000"):
        motion.row(3000)


def test_a_motion_to_the_start_has_one_row() -> None:
    motion = control.trajectory(HOME, HOME, LIMITS, PERIOD)
    assert motion.position.tolist() == [[0.0, 0.0, 0.0]]
    assert motion.duration == 0.0


def test_without_ruckig_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ruckig", None)
    with pytest.raises(ConfigurationError, match=r"pip install 'catenary\[traj\]'"):
        control.trajectory(HOME, HOME, LIMITS, PERIOD)


def bounded(low: float, high: float) -> control.MotionLimits:
    return control.MotionLimits(1.0, 5.0, 50.0, position_min=low, position_max=high)


@pytest.mark.parametrize(
    ("start", "goal", "limits", "message"),
    [
        (HOME, [0, 2, 0], bounded(-1, 1), "goal of axis 1 is 2; it is beyond position_max 1"),
        (HOME, [0, 0, -2], bounded(-1, 1), "goal of axis 2 is -2; it is beyond position_min -1"),
        ([0, 3, 0], HOME, bounded(-1, 1), "start of axis 1 is 3; it is beyond position_max"),
        (HOME, [0, np.nan, 0], LIMITS, "goal of axis 1 is nan"),
        ([np.inf, 0, 0], HOME, LIMITS, "start position of axis 0 is inf"),
        (HOME, [0, 0], LIMITS, "give 3 numbers"),
        (control.MotionState(HOME, [0, 1.2, 0]), HOME, LIMITS, "start velocity of axis 1 is 1.2"),
        (
            control.MotionState(HOME, [0, 0.9, 0], [0, 5.0, 0]),
            HOME,
            LIMITS,
            "velocity after the start acceleration has decreased to zero of axis 1 is 1.1",
        ),
        (
            control.MotionState(HOME, HOME, [0, 0, 10.0]),
            HOME,
            LIMITS,
            "start acceleration of axis 2 is 10; it is beyond the limit 9",
        ),
        (
            control.MotionState([0.95, 0, 0], [0.9, 0, 0]),
            HOME,
            bounded(-1, 1),
            "highest position of the motion of axis 0 is 1.*; it is beyond position_max 1",
        ),
        (
            HOME,
            HOME,
            control.MotionLimits(1.0, 0.0, 1.0),
            "acceleration of axis 0 is 0.0; it must be",
        ),
        (
            HOME,
            HOME,
            control.MotionLimits(1.0, 1.0, np.inf),
            "jerk of axis 0 is inf; it must be finite",
        ),
        (HOME, HOME, bounded(1, 1), "position_min of axis 0 is 1; it must be below position_max"),
    ],
)
def test_an_impossible_motion_names_axis_and_limit(start, goal, limits, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        control.trajectory(start, goal, limits, PERIOD)
