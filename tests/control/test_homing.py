"""Homing of two fingers with hard stops, without them, and with an obstacle."""

import numpy as np
import pytest

from catenary import control

DT = 1e-3
OPEN, SHUT, INERTIA = (-0.8, 0.9), (0.5, -0.4), 0.01


class Fingers:
    """Two simulated axes between stops; they meet where their positions differ by 0.2 rad."""

    def __init__(self, *, stops: bool = True) -> None:
        self.q, self.v = np.array([-0.1, 0.2]), np.zeros(2)
        self.stops = stops

    def outside(self, i: int) -> float:
        """Return the torque of the stop and of the other finger."""
        low, high = sorted((OPEN[i], SHUT[i]))
        over = max(self.q[i] - high, 0) + min(self.q[i] - low, 0)
        met = max(0.0, self.q[0] - self.q[1] - 0.2)
        torque = -2000 * over * self.stops - [1, -1][i] * 2000 * met
        return torque - 1.0 * self.v[i] * self.stops * (over != 0 or met > 0)

    def step(self, torque: np.ndarray) -> None:
        outside = np.array([self.outside(0), self.outside(1)])
        self.v += (torque + outside - 0.02 * self.v) * DT / INERTIA
        self.q += self.v * DT


def home(fingers: Fingers, seconds: float = 20.0) -> tuple[np.ndarray, int]:
    block = control.Homing(2, [-0.5, 0.5], torque=0.3, travel=2.0, time=0.05)
    loop = control.Pid(2, 0.5, 5.0, limit=0.5)
    memory, kept, torque = block.memory, loop.memory, np.zeros(2)
    for k in range(round(seconds / DT)):
        for i in range(2):
            velocity = control.homing(memory, block.parameters, i, fingers.q[i], torque[i], DT)
            torque[i] = control.pid(kept, loop.parameters, i, velocity, fingers.v[i], 0.0, DT)
        fingers.step(torque)
        if control.homed(memory):
            return memory, k
    return memory, -1


def test_the_three_phases_find_all_stops() -> None:
    fingers = Fingers()
    memory, steps = home(fingers)
    assert steps > 0
    found = control.stops(memory)
    assert found.open == pytest.approx(OPEN, abs=0.01)
    assert found.closed[0] == pytest.approx(SHUT[0], abs=0.01)
    assert found.closed[1] == pytest.approx(SHUT[1], abs=0.01)
    assert found.meeting[0] - found.meeting[1] == pytest.approx(0.2, abs=0.02)
    assert not found.failed.any()


def test_without_stops_homing_fails_and_both_axes_stop() -> None:
    fingers = Fingers(stops=False)
    memory, steps = home(fingers)
    assert steps > 0
    found = control.stops(memory)
    assert found.failed.any()
    assert np.isnan(found.open).all()
    velocities = [
        control.homing(
            memory, control.Homing(2, -0.5, 0.3, 2.0).parameters, i, fingers.q[i], 0.0, DT
        )
        for i in range(2)
    ]
    assert velocities == [0.0, 0.0]


class Obstructed(Fingers):
    """Fingers with an obstacle between finger 0 and its open stop, after it has closed."""

    closed = False

    def outside(self, i: int) -> float:
        self.closed |= bool(self.q[0] > SHUT[0] - 1e-3)
        wall = min(self.q[0] - 0.2, 0.0) if self.closed and i == 0 else 0.0
        return super().outside(i) - 2000 * wall - 1.0 * self.v[i] * (wall != 0)


def test_an_axis_that_is_blocked_on_its_return_has_failed() -> None:
    fingers = Obstructed()
    memory, steps = home(fingers)
    assert steps > 0
    assert fingers.q[0] == pytest.approx(0.2, abs=0.01)
    found = control.stops(memory)
    assert found.failed.tolist() == [True, False]
    assert found.closed[0] == pytest.approx(SHUT[0], abs=0.01)
    assert np.isnan(found.meeting).all()


def test_all_results_are_nan_before_homing() -> None:
    found = control.stops(control.Homing(2, 0.5, 0.3, 2.0).memory)
    assert np.isnan([found.open, found.closed, found.meeting]).all()


def test_a_velocity_of_zero_is_refused() -> None:
    with pytest.raises(ValueError, match="velocity of axis 1 is 0"):
        control.Homing(2, [0.5, 0.0], 0.3, 2.0)
