"""Blocks in compiled laws: same results as in Python, no allocation, errors are reported."""

import subprocess
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import catenary as cat
from catenary import control
from catenary.errors import LawError
from tests.control.arm import THREE
from tests.loop_options import grouped

pytest.importorskip("numba", reason="laws are compiled by Numba: pip install 'catenary[law]'")
JOINTS = ["turn", "shoulder", "elbow"]


@contextmanager
def opened(
    mode: str = "cst", axes: int = 3, **more: float
) -> Iterator[tuple[cat.Drives, cat.Loop]]:
    servo = cat.virtual.Servo(axes=axes, inertia=0.01, rated_torque=20.0)
    with cat.MainDevice(cat.Segment([servo])) as main:
        arm = cat.Drives(main.scan().drives, mode=mode, counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Loop(arm, period=1e-3, **grouped(more)) as loop, warnings.catch_warnings():
            warnings.simplefilter("error")  # a law that allocates causes a warning
            yield arm, loop


@cat.law
def hold(actual, target, memory, time, parameters):
    state, goal = control.part(memory, 0), control.part(memory, 1)
    for i in range(actual.n):
        if not actual.enabled[i]:
            control.restart(state, i, actual.n)
        target.torque[i] = control.cascade(
            state,
            parameters,
            i,
            goal[i],
            0.0,
            0.0,
            actual.position[i],
            actual.velocity[i],
            actual.dt,
        )
    return time > 1.0


def test_a_cascade_gives_the_same_result_in_a_law_and_in_python() -> None:
    block = control.Cascade(control.Pid(3, 20.0, limit=5.0), control.Pid(3, 1.0, 5.0, limit=10.0))
    goal = [0.5, -0.5, 1.0]
    ends = []
    for compiled in (True, False):
        with opened() as (arm, loop):
            memory = control.join(block.memory, goal)
            memory = loop.run(hold, memory, block.parameters, compiled=compiled)
            assert arm.actual.position == pytest.approx(goal, abs=2e-3)
            ends.append(memory)
    assert ends[0] == pytest.approx(ends[1], abs=0.02)  # they differ by one cycle


@cat.law
def weightless(actual, target, memory, time):
    model, torque, motion = (
        control.part(memory, 0),
        control.part(memory, 1),
        control.part(memory, 2),
    )
    control.gravity(model, actual.position, torque)
    for i in range(actual.n):
        target.torque[i] = torque[i]
    control.inverse(model, actual.position, actual.velocity, actual.velocity, motion)
    control.gravity(model, control.part(memory, 3), torque)
    return time > 0.05


def test_dynamics_give_the_same_result_in_a_law_and_in_python(tmp_path: Path) -> None:
    path = tmp_path / "three.xml"
    path.write_text(THREE)
    dynamics = control.Dynamics(path, joints=JOINTS)
    place = np.array([0.4, -0.3, 0.9])
    for compiled in (True, False):
        with opened() as (arm, loop):
            memory = control.join(dynamics.memory, np.zeros(3), np.zeros(3), place)
            memory = loop.run(weightless, memory, compiled=compiled)
            assert control.part(memory, 1).tolist() == dynamics.gravity(place).tolist()
            q = arm.actual.position
            assert abs(control.part(memory, 2)).max() < 200
            assert np.isfinite(q).all()


@cat.law
def everything(memory, parameters):
    """Run all blocks on generated signals, so that the start time does not matter."""
    count, kept = control.part(memory, 0), control.part(memory, 1)
    count[0] += 1.0
    time, dt = count[0] * 1e-3, 1e-3
    sweep = control.chirp(control.part(parameters, 0), 0, time)
    q, v = 0.3 * sweep, sweep
    for i in range(2):
        x = control.low_pass(control.part(memory, 2), control.part(parameters, 1), i, q)
        known = control.feed_forward(control.part(parameters, 2), i, v, q)
        known += control.friction(control.part(parameters, 3), i, v)
        x += control.pid(control.part(memory, 3), control.part(parameters, 4), i, q, v, known, dt)
        stiff = control.part(parameters, 5)
        x += control.impedance(control.part(memory, 4), stiff, i, 0.1, 0.0, known, 0.2, q, v, dt)
        yields = control.part(parameters, 6)
        x += control.natural_admittance(control.part(memory, 5), yields, i, 0.1, 0.0, 0.2, q, v, dt)
        found = control.residual(control.part(memory, 6), control.part(parameters, 7), i, x, v, dt)
        hit = control.threshold(control.part(memory, 7), control.part(parameters, 8), i, found, dt)
        pull = control.part(parameters, 10)
        tau = control.coupling(control.part(memory, 9), pull, i, 0.1, sweep > 0, q, v, dt)
        port = control.part(parameters, 11)
        x += control.passivity(control.part(memory, 10), port, i, tau, -0.1, q, v, dt)
        x += control.force_feedback(control.part(parameters, 12), i, tau, v)
        way = control.part(parameters, 9)
        kept[i] += x + found + hit + control.homing(control.part(memory, 8), way, i, q, x, dt)
    if control.homed(control.part(memory, 8)):
        control.restart(control.part(memory, 8), 0, 2)
    return count[0] > 500.0


def test_every_compiled_block_gives_the_same_result_and_allocates_nothing() -> None:
    blocks = [
        control.LowPass(2, [50.0, 80.0], 1e-3),
        control.Pid(2, 2.0, 3.0, 0.01, limit=5.0, rate=900.0, derivative_time=0.01),
        control.Impedance(2, 5.0, 0.4, 0.01, 0.05, bandwidth=80.0, compensation=0.2, limit=3.0),
        control.NaturalAdmittance(2, 0.01, 0.3, 4.0, 5.0),
        control.Residual(2, 50.0, 0.01),
        control.Threshold(2, 0.5, 0.003),
        control.Homing(2, 0.5, 0.3, 2.0, time=0.002),
        control.Coupling(2, 2.0, 0.1, 0.01, 1e-3),
        control.Passivity(2, 2.0, 1.0, 1e-3, damping=0.1),
    ]
    chirp = control.Chirp(1, 1.0, 1.0, 30.0, 2.0)
    known = control.FeedForward(2, 0.1, 0.2), control.Friction(2, 0.1, 0.2)
    felt = control.ForceFeedback(2, 0.5, 0.2, (5.0, 0.1), 0.01, 1e-3)
    given = [chirp, blocks[0], *known, *blocks[1:], felt]
    parameters = control.join(*(block.parameters for block in given))
    memory = control.join([0.0], [0.0, 0.0], *(block.memory for block in blocks))
    ends = []
    for compiled in (True, False):
        with opened("csp") as (_, loop):
            ends.append(loop.run(everything, memory, parameters, compiled=compiled))
    assert ends[0] == pytest.approx(ends[1], rel=1e-9, abs=1e-12)
    assert control.part(ends[0], 0)[0] == 501.0
    assert abs(control.part(ends[0], 1)).min() > 1.0
    assert control.part(ends[0], 8).any()  # homing


@cat.law
def observed(memory, parameters):
    """Run the residual with a model on generated signals."""
    count, q, v = control.part(memory, 0), control.part(memory, 3), control.part(memory, 4)
    count[0] += 1.0
    for i in range(3):
        q[i], v[i] = 1e-3 * count[0] * (i + 1), 0.5 * i - 1e-3 * count[0]
    external = control.part(memory, 5)
    control.model_residual(
        control.part(memory, 1), parameters, control.part(memory, 2), v, q, v, 1e-3, external
    )
    return count[0] > 100.0


def test_the_compiled_residual_with_a_model_gives_the_same_result(tmp_path: Path) -> None:
    path = tmp_path / "three.xml"
    path.write_text(THREE)
    dynamics, block, still = (
        control.Dynamics(path, joints=JOINTS),
        control.Residual(3, 50.0),
        [0.0] * 3,
    )
    ends = []
    for compiled in (True, False):
        memory = control.join([0.0], block.memory, dynamics.memory, still, still, still)
        with opened("csp") as (_, loop):
            memory = loop.run(observed, memory, block.parameters, compiled=compiled)
        ends.append(control.part(memory, 5))
    assert ends[0] == pytest.approx(ends[1], rel=1e-12)
    assert abs(ends[0]).min() > 0.01


def test_trial_steps_leave_nothing_in_the_model(tmp_path: Path) -> None:
    """Trial steps run on copies of the law's memory, but in the same MuJoCo workspace."""
    path = tmp_path / "three.xml"
    path.write_text(THREE)
    dynamics = control.Dynamics(path, joints=JOINTS)
    ends = []
    for _ in range(2):
        with opened() as (_, loop):
            memory = control.join(dynamics.memory, np.zeros(3), np.zeros(3), np.full(3, 0.2))
            memory = loop.run(weightless, memory)
            ends.append([*control.part(memory, 1), *control.part(memory, 2)])
    assert ends[0] == ends[1]


def test_without_numba_blocks_are_plain_python() -> None:
    code = """
import sys
sys.modules["numba"] = None
from catenary import control
block = control.Cascade(control.Pid(1, 2.0), control.Pid(1, 3.0))
print(control.cascade(block.memory, block.parameters, 0, 1.0, 0.0, 0.5, 0.0, 0.0, 1e-3))
"""
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert float(done.stdout) == 6.5


def test_wrong_parameters_stop_the_drives_with_an_error() -> None:
    with opened() as (_, loop):
        pid = control.Pid(3, 1.0)
        memory = control.join(np.zeros(30), np.zeros(3))
        with pytest.raises(LawError, match="not the parameters of a Cascade"):
            loop.run(hold, memory, pid.parameters)


def test_more_axes_than_the_model_has_joints(tmp_path: Path) -> None:
    path = tmp_path / "three.xml"
    path.write_text(THREE)
    dynamics = control.Dynamics(path, joints=JOINTS)
    with opened(axes=4) as (_, loop):
        memory = control.join(dynamics.memory, np.zeros(4), np.zeros(4), np.zeros(4))
        with pytest.raises(LawError, match="the number of joints of the model differs"):
            loop.run(weightless, memory)


@pytest.mark.parametrize("use", ["import catenary", "from catenary import control"])
def test_numba_is_not_imported_before_a_law_is_compiled(use: str) -> None:
    code = f"{use}\nimport sys\nassert 'numba' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
