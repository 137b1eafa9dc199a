"""Law of the joints: impedance, friction, limits, and the damping mode after a silent command."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("numba", reason="laws need Numba: pip install 'catenary[law]'")

import laws

import catenary as cat
from catenary import control, virtual

N, PERIOD = 2, 250e-6
GAINS = np.array([100.0, 50.0]), np.array([5.0, 2.0])
ZERO = np.zeros(N)


@pytest.fixture
def command() -> Any:
    limits = laws.Limits(
        torque=np.array([40.0, 20.0]),
        lower=np.array([-1.0, -1.0]),
        upper=np.array([1.0, 1.0]),
        speed=np.array([5.0, 5.0]),
        brake=np.array([3.0, 3.0]),
        silence=2 * PERIOD,
        rise=PERIOD,
    )
    return laws.Command(limits, control.Friction(N, 0.5, 1.0))


class Axes:
    """Axes at a position and a velocity, and the law that runs on them."""

    def __init__(self, q: Any = ZERO, v: Any = ZERO) -> None:
        self.actual = SimpleNamespace(
            n=N, dt=PERIOD, position=np.array(q) + ZERO, velocity=np.array(v) + ZERO
        )
        self.target = SimpleNamespace(torque=np.full(N, np.nan))
        self.memory = np.zeros(laws.STATES)

    def step(self, parameters: Any) -> Any:
        assert not laws.joints(self.actual, self.target, self.memory, parameters)
        return self.target.torque.copy()


def test_the_torque_is_that_of_the_spring_the_damper_friction_and_feed_forward(
    command: Any,
) -> None:
    axes = Axes(q=[0.1, -0.2], v=[0.3, 0.0])
    speed = np.array([0.0, 1.0])
    row = command.write(1, laws.COMPLIANT, ZERO, speed, np.array([7.0, 0.0]), GAINS)
    friction = np.array([0.0, 0.5 + np.tanh(1.0 / 0.05)])
    expected = friction + np.array([-10.0 - 1.5 + 7.0, 10.0 + 2.0])
    assert axes.step(row) == pytest.approx(expected)


@pytest.mark.parametrize("q", [1.1, -1.1])
def test_beyond_the_range_a_joint_is_not_driven_further_out(command: Any, q: float) -> None:
    outward = np.full(N, np.sign(q) * 2.0)
    row = command.write(1, laws.COMPLIANT, outward, ZERO, ZERO, GAINS)
    assert Axes(q=q).step(row) == pytest.approx(ZERO)
    inward = command.write(2, laws.COMPLIANT, -outward, ZERO, ZERO, GAINS)
    assert (np.sign(Axes(q=q).step(inward)) == -np.sign(q)).all()


def test_above_the_speed_limit_a_joint_brakes(command: Any) -> None:
    forward = command.write(1, laws.COMPLIANT, ZERO, ZERO, np.full(N, 19.0), (ZERO, ZERO))
    assert Axes(v=4.0).step(forward) == pytest.approx([19.0, 19.0])
    assert Axes(v=6.0).step(forward) == pytest.approx([-3.0, -3.0])
    back = command.write(2, laws.COMPLIANT, ZERO, ZERO, np.full(N, -19.0), (ZERO, ZERO))
    assert Axes(v=-6.0).step(back) == pytest.approx([3.0, 3.0])


def test_no_torque_exceeds_its_limit(command: Any) -> None:
    row = command.write(1, laws.COMPLIANT, ZERO, ZERO, np.array([1e6, -1e6]), GAINS)
    assert Axes().step(row) == pytest.approx([40.0, -20.0])


def test_a_silent_command_ends_in_the_damping_mode(command: Any) -> None:
    axes = Axes(q=0.1, v=1.0)
    row = command.write(1, laws.COMPLIANT, ZERO, ZERO, ZERO, GAINS)
    compliant = axes.step(row)
    assert axes.step(row) == pytest.approx(compliant)
    assert axes.step(row) == pytest.approx(compliant)
    assert axes.step(row) == pytest.approx([-3.0, -3.0])  # older than 2 periods
    row = command.write(2, laws.COMPLIANT, ZERO, ZERO, ZERO, GAINS)
    assert axes.step(row) == pytest.approx(compliant)


def test_the_damping_mode_brakes_and_the_command_returns_gradually() -> None:
    rows = np.full((5, N), 10.0)
    limits = laws.Limits(*rows, silence=1.0, rise=4 * PERIOD)
    command = laws.Command(limits, control.Friction(N, 0.0, 0.0))
    axes = Axes(v=0.5)
    row = command.write(1, laws.DAMPED, ZERO, ZERO, np.full(N, 8.0), (ZERO, ZERO))
    assert axes.step(row) == pytest.approx([-5.0, -5.0])
    row = command.write(2, laws.COMPLIANT, ZERO, ZERO, np.full(N, 8.0), (ZERO, ZERO))
    shares = [0.25, 0.5, 0.75, 1.0, 1.0]
    assert [axes.step(row)[0] for _ in shares] == pytest.approx(
        [share * 8.0 - (1 - share) * 5.0 for share in shares]
    )


def test_the_compiled_law_holds_servos_and_brakes_them_when_the_body_is_silent() -> None:
    segment = virtual.Segment([virtual.Servo(inertia=2e-3) for _ in range(N)])
    limits = laws.Limits(*(np.full(N, each) for each in (4.0, -9.0, 9.0, 50.0, 0.05)), silence=0.01)
    command = laws.Command(limits, control.Friction(N, 0.0, 0.0))
    gains = np.full(N, 2.0), np.full(N, 0.1)
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(
            main.scan().drives, mode="cst", counts_per_turn=2**20, velocity_limit=100.0
        )
        with cat.Loop(arm, period=PERIOD, laws=[laws.joints]) as loop:
            goal = arm.actual.position + 0.5
            run = loop.start(laws.joints, np.zeros(laws.STATES), command.parameters)
            for cycle in loop:
                run.parameters = command.write(
                    cycle.number, laws.COMPLIANT, goal, ZERO, ZERO, gains
                )
                if cycle.time > 1.5:
                    break
            assert arm.actual.position == pytest.approx(goal, abs=0.05)  # dry friction
            for cycle in loop:  # the body renews nothing
                if cycle.time > 1.6:
                    break
            assert run.memory[laws.BLEND] == 0.0
            run.stop()
