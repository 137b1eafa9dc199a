"""Cartesian impedance, energy residual and delay in compiled laws: as in Python, no allocation."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import catenary as cat
from catenary import control
from catenary.errors import LawError
from tests.control.arm import SEVEN

pytest.importorskip("numba", reason="laws are compiled by Numba: pip install 'catenary[law]'")
JOINTS = ["pitch", "roll", "slide", "elbow", "forearm", "wrist"]
STIFFNESS = [400.0, 500.0, 600.0, 20.0, 30.0, 40.0]


@pytest.fixture
def seven(tmp_path: Path) -> Path:
    path = tmp_path / "seven.xml"
    path.write_text(SEVEN)
    return path


@contextmanager
def opened(axes: int = 6) -> Iterator[tuple[cat.Drives, cat.Loop]]:
    servo = cat.virtual.Servo(axes=axes, inertia=0.2, rated_torque=20.0)
    with cat.MainDevice(cat.Segment([servo])) as main:
        arm = cat.Drives(
            main.scan().drives, mode="cst", counts_per_turn=2**20, velocity_limit=100.0
        )
        with cat.Loop(arm, period=1e-3) as loop, warnings.catch_warnings():
            warnings.simplefilter("error")  # a law that allocates causes a warning
            yield arm, loop


@cat.law
def generated(memory, parameters):
    """Run the blocks on generated signals, so that the start time does not matter."""
    count, hand, model = control.part(memory, 0), control.part(memory, 1), control.part(memory, 2)
    q, v, torque = control.part(memory, 3), control.part(memory, 4), control.part(memory, 5)
    pose, columns, kept = control.part(memory, 6), control.part(memory, 7), control.part(memory, 8)
    count[0] += 1.0
    for i in range(6):
        q[i] = 1.5 - 3e-3 * count[0] * (i + 1)
        v[i] = control.delay(
            control.part(memory, 9), control.part(parameters, 1), i, 0.5 * i - 2e-3 * count[0]
        )
    goal = control.part(memory, 10)
    control.cartesian_impedance(hand, control.part(parameters, 0), goal, v, q, v, torque)
    control.pose(hand, q, pose)
    control.jacobian(hand, q, columns)
    energy = control.part(memory, 11)
    power = control.energy_residual(energy, control.part(parameters, 2), model, torque, q, v, 1e-3)
    for i in range(6):
        kept[i] += torque[i]
    kept[6] += power
    return count[0] > 400.0


def blocks() -> tuple[control.CartesianImpedance, control.Delay, control.EnergyResidual]:
    return (
        control.CartesianImpedance(
            6, STIFFNESS, 20.0, force=90.0, moment=8.0, limit=40.0, null_damping=0.7
        ),
        control.Delay(6, [0, 1, 2, 3, 4, 40]),
        control.EnergyResidual(6, 50.0),
    )


def test_compiled_blocks_give_the_same_result_as_in_python(seven: Path) -> None:
    impedance, delay, energy = blocks()
    hand = control.Kinematics(seven, "grip", frame="torso", joints=JOINTS)
    model = control.Dynamics(seven, joints=JOINTS)
    goal = hand.pose(np.full(6, 0.2))
    parameters = control.join(impedance.parameters, delay.parameters, energy.parameters)
    ends = []
    for compiled in (True, False):
        rows = [np.zeros(n) for n in (6, 6, 6, 7, 36, 7)]
        memory = control.join(
            *([0.0], hand.memory, model.memory, *rows, delay.memory, goal, energy.memory)
        )
        with opened() as (_, loop):
            ends.append(loop.run(generated, memory, parameters, compiled=compiled))
    for k in (3, 4, 5, 6, 7, 8, 9, 11):
        found, expected = (control.part(end, k) for end in ends)
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)
    assert control.part(ends[0], 0)[0] == 401.0
    assert abs(control.part(ends[0], 8)).min() > 1.0
    assert control.part(ends[0], 6) == pytest.approx(hand.pose(control.part(ends[0], 3)), abs=1e-12)


@cat.law
def hold(actual, target, memory, parameters):
    hand, goal, still = control.part(memory, 0), control.part(memory, 1), control.part(memory, 2)
    control.cartesian_impedance(
        hand, parameters, goal, still, actual.position, actual.velocity, target.torque
    )


def test_a_law_moves_the_hand_to_its_goal(seven: Path) -> None:
    """It starts in a singularity. Dry friction of the motors leaves an error of a few mm."""
    hand = control.Kinematics(seven, "grip", frame="torso", joints=JOINTS)
    block = control.CartesianImpedance(
        6, [400.0] * 3 + [40.0] * 3, [60.0] * 3 + [6.0] * 3, limit=18.0
    )
    moved = np.array([0.3, -0.2, 0.05, 0.4, 0.3, -0.2])
    with opened() as (arm, loop):
        goal = hand.pose(arm.actual.position + moved)
        loop.start(hold, control.join(hand.memory, goal, np.zeros(6)), block.parameters)
        for cycle in loop:
            if cycle.number > 4000:
                break
        reached = hand.pose(arm.actual.position)
        assert reached[:3] == pytest.approx(goal[:3], abs=3e-3)
        assert abs(reached[3:] @ goal[3:]) == pytest.approx(1.0, abs=1e-5)


def test_another_number_of_axes_stops_the_drives_with_an_error(seven: Path) -> None:
    hand = control.Kinematics(seven, "grip", frame="torso", joints=JOINTS)
    block = control.CartesianImpedance(7, 1.0, 1.0)
    with opened(axes=7) as (_, loop):
        memory = control.join(hand.memory, np.ones(7), np.zeros(6))
        with pytest.raises(LawError, match="the number of joints of the model differs"):
            loop.run(hold, memory, block.parameters)
