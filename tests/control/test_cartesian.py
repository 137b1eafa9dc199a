"""Cartesian impedance, compared with MuJoCo's Jacobian and with simulated motions of an arm."""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from catenary import control
from tests.control.arm import SEVEN

JOINTS = ["waist", "pitch", "roll", "slide", "elbow", "forearm", "wrist"]
STIFFNESS = [400.0, 500.0, 600.0, 20.0, 30.0, 40.0]
DAMPING = [40.0, 45.0, 50.0, 2.0, 2.5, 3.0]
DT = 1e-3


@pytest.fixture
def seven(tmp_path: Path) -> Path:
    """The arm on a fixed base."""
    path = tmp_path / "seven.xml"
    path.write_text(SEVEN.replace('<freejoint name="float"/>', ""))
    return path


class Arm:
    """The arm in MuJoCo as judge and plant, and our kinematics."""

    def __init__(self, path: Path) -> None:
        self.model = model = mujoco.MjModel.from_xml_path(str(path))
        model.opt.timestep = DT
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        self.data = mujoco.MjData(model)
        self.kinematics = control.Kinematics(path, "grip", joints=JOINTS)
        self.dynamics = control.Dynamics(path, joints=JOINTS)
        self.memory, self.gravity = self.kinematics.memory, self.dynamics.memory
        self.places = [model.joint(name).qposadr[0] for name in JOINTS]
        self.degrees = [model.joint(name).dofadr[0] for name in JOINTS]

    def set(self, q: np.ndarray, v: np.ndarray) -> None:
        self.data.qpos[self.places], self.data.qvel[self.degrees] = q, v
        mujoco.mj_forward(self.model, self.data)

    @property
    def jacobian(self) -> np.ndarray:
        both = np.zeros((6, self.model.nv))
        mujoco.mj_jacSite(self.model, self.data, both[:3], both[3:], self.model.site("grip").id)
        return both[:, self.degrees]

    def error(self, goal: np.ndarray) -> np.ndarray:
        """Return the error (6,) in the axes of the world, with MuJoCo's functions."""
        site, quaternion, local = self.data.site("grip"), np.zeros(4), np.zeros(3)
        mujoco.mju_mat2Quat(quaternion, site.xmat)
        mujoco.mju_subQuat(local, goal[3:] / np.linalg.norm(goal[3:]), quaternion)
        return np.concatenate([goal[:3] - site.xpos, site.xmat.reshape(3, 3) @ local])

    def torque(self, block: control.CartesianImpedance, goal: Any, rate: Any = 0.0) -> np.ndarray:
        q, v = self.data.qpos[self.places].copy(), self.data.qvel[self.degrees].copy()
        found, rates = np.empty(7), np.broadcast_to(np.asarray(rate, float), (6,))
        control.cartesian_impedance(
            self.memory, block.parameters, np.asarray(goal, float), rates, q, v, found
        )
        return found

    def step(self, torque: np.ndarray, force: np.ndarray | None = None) -> None:
        """Simulate one period with gravity compensation, and a force at the point [N]."""
        q, found = self.data.qpos[self.places].copy(), np.empty(7)
        control.gravity(self.gravity, q, found)
        pushed = np.zeros(7) if force is None else self.jacobian[:3].T @ force
        self.data.qfrc_applied[self.degrees] = torque + found + pushed
        mujoco.mj_step(self.model, self.data)


@pytest.fixture
def arm(seven: Path) -> Arm:
    return Arm(seven)


def random_goal(rng: np.random.Generator, arm: Arm) -> np.ndarray:
    goal = arm.kinematics.pose(rng.uniform(-1.5, 1.5, 7))
    goal[3:] *= rng.choice([-2.0, 1.0])  # neither sign nor length of a quaternion matters
    return goal


def test_the_torque_equals_the_formula_with_mujocos_jacobian(arm: Arm) -> None:
    block = control.CartesianImpedance(7, STIFFNESS, DAMPING)
    rng = np.random.default_rng(3)
    for _ in range(50):
        arm.set(rng.uniform(-2, 2, 7), rng.normal(size=7))
        goal, rate = random_goal(rng, arm), rng.normal(size=6)
        velocity = arm.jacobian @ arm.data.qvel[arm.degrees]
        wrench = STIFFNESS * arm.error(goal) + DAMPING * (rate - velocity)
        assert arm.torque(block, goal, rate) == pytest.approx(
            arm.jacobian.T @ wrench, rel=1e-9, abs=1e-8
        )


@pytest.mark.parametrize(
    ("value", "expected"),
    [(5.0, [5, 5, 5, 0, 0, 0]), ([1, 2, 3], [1, 2, 3, 0, 0, 0]), (STIFFNESS, STIFFNESS)],
)
def test_stiffness_of_one_three_or_six_numbers(value: Any, expected: list[float]) -> None:
    parameters = control.CartesianImpedance(7, value, value).parameters
    assert parameters[1:7].tolist() == expected
    assert parameters[7:13].tolist() == expected


def test_without_rotational_gains_the_orientation_is_free(arm: Arm) -> None:
    block = control.CartesianImpedance(7, 400.0, 40.0)
    rng = np.random.default_rng(4)
    arm.set(rng.uniform(-1, 1, 7), rng.normal(size=7))
    one, other = random_goal(rng, arm), random_goal(rng, arm)
    other[:3] = one[:3]
    assert arm.torque(block, one) == pytest.approx(arm.torque(block, other), abs=1e-12)


def test_force_moment_and_torque_are_limited(arm: Arm) -> None:
    rng = np.random.default_rng(6)
    free = control.CartesianImpedance(7, STIFFNESS, DAMPING)
    bound = control.CartesianImpedance(7, STIFFNESS, DAMPING, force=30.0, moment=2.0)
    hard = control.CartesianImpedance(7, STIFFNESS, DAMPING, limit=[1, 2, 3, 4, 5, 6, 7])
    for _ in range(20):
        arm.set(rng.uniform(-1, 1, 7), rng.normal(size=7))
        goal = random_goal(rng, arm)
        back = np.linalg.pinv(arm.jacobian.T)
        wanted, limited = back @ arm.torque(free, goal), back @ arm.torque(bound, goal)
        for part, limit in ((slice(0, 3), 30.0), (slice(3, 6), 2.0)):
            length = np.linalg.norm(wanted[part])
            expected = wanted[part] * min(1.0, limit / length)
            assert limited[part] == pytest.approx(expected, abs=1e-7)
        torque = arm.torque(free, goal)
        clipped = np.clip(torque, -np.arange(1.0, 8.0), np.arange(1.0, 8.0))
        assert arm.torque(hard, goal).tolist() == clipped.tolist()


def test_the_point_yields_to_a_force_by_the_compliance(arm: Arm) -> None:
    """10 N, 4 s: the deflection is F / K, the orientation is held, no null motion remains."""
    block = control.CartesianImpedance(7, STIFFNESS, DAMPING, null_damping=1.0)
    arm.set(np.array([0.4, 0.3, -0.2, 0.1, 0.6, 0.2, -0.3]), np.zeros(7))
    goal = arm.kinematics.pose(arm.data.qpos[arm.places])
    force = np.array([10.0, -5.0, 8.0])
    for _ in range(4000):
        arm.step(arm.torque(block, goal), force)
    mujoco.mj_forward(arm.model, arm.data)
    assert -arm.error(goal)[:3] == pytest.approx(force / STIFFNESS[:3], abs=2e-5)
    assert arm.error(goal)[3:] == pytest.approx(np.zeros(3), abs=1e-4)
    assert abs(arm.data.qvel[arm.degrees]).max() < 1e-3


def test_the_stored_energy_never_grows(arm: Arm) -> None:
    """Kinetic energy and energy of the spring together, without external forces."""
    block = control.CartesianImpedance(7, STIFFNESS, DAMPING, null_damping=0.5)
    arm.set(np.array([0.4, 0.3, -0.2, 0.1, 0.6, 0.2, -0.3]), np.zeros(7))
    goal = arm.kinematics.pose(arm.data.qpos[arm.places] + 0.2)
    energies = []
    for _ in range(1500):
        mujoco.mj_forward(arm.model, arm.data)
        mujoco.mj_energyVel(arm.model, arm.data)
        kinetic, error = arm.data.energy[1], arm.error(goal)
        energies.append(kinetic + 0.5 * error @ (STIFFNESS * error))
        arm.step(arm.torque(block, goal))
    assert np.diff(energies).max() < 2e-3 * energies[0]
    assert energies[-1] < 1e-3 * energies[0]


@pytest.mark.parametrize(("gains", "rows"), [((STIFFNESS, DAMPING), 6), ((400.0, 40.0), 3)])
def test_null_damping_brakes_without_a_force_at_the_point(
    arm: Arm, gains: tuple[Any, Any], rows: int
) -> None:
    """The judge is (I - Jᵀ (Jᵀ)⁺) τ₀ with NumPy's pseudo-inverse."""
    own = [0.5, 0.6, 0.7, 5.0, 0.4, 0.3, 0.2]
    damped = control.CartesianImpedance(7, *gains, null_damping=own)
    plain = control.CartesianImpedance(7, *gains)
    rng, compared = np.random.default_rng(8), 0
    while compared < 20:
        arm.set(rng.uniform(-1.2, 1.2, 7), rng.normal(size=7))
        if np.linalg.svd(arm.jacobian)[1].min() < 0.05:
            continue  # close to a singularity, where the projection is regularised
        compared += 1
        goal = random_goal(rng, arm)
        torque = arm.torque(damped, goal) - arm.torque(plain, goal)
        task = arm.jacobian[:rows]
        velocity = arm.data.qvel[arm.degrees]
        wanted = -np.array(own) * velocity
        expected = wanted - task.T @ (np.linalg.pinv(task.T) @ wanted)
        assert torque == pytest.approx(expected, abs=2e-5)
        assert abs(np.linalg.pinv(task.T) @ torque).max() < 1e-3
    assert abs(expected).max() > 0.05


def test_in_a_singularity_the_torque_stays_finite(seven: Path) -> None:
    """Only two joints: most directions are lost, and J Jᵀ has rank 2."""
    arm = control.Kinematics(seven, "grip", joints=["pitch", "elbow"])
    block = control.CartesianImpedance(2, STIFFNESS, DAMPING, null_damping=1.0)
    torque, q = np.empty(2), np.array([0.2, 0.0])
    goal = arm.pose([0.5, 0.7])
    control.cartesian_impedance(
        arm.memory, block.parameters, goal, np.zeros(6), q, np.array([1.0, -1.0]), torque
    )
    assert np.isfinite(torque).all()
    assert abs(torque).max() < 500.0


def test_a_result_does_not_depend_on_an_earlier_call(arm: Arm) -> None:
    block = control.CartesianImpedance(7, STIFFNESS, DAMPING, null_damping=1.0)
    rng = np.random.default_rng(9)
    q, v, goal = rng.uniform(-1, 1, 7), rng.normal(size=7), random_goal(rng, arm)
    arm.set(q, v)
    before = arm.torque(block, goal)
    arm.set(rng.uniform(-1, 1, 7), rng.normal(size=7))
    arm.torque(block, random_goal(rng, arm))
    arm.set(q, v)
    assert arm.torque(block, goal).tolist() == before.tolist()


def test_nan_reaches_the_torque(arm: Arm) -> None:
    """Limits do not hide a NaN; the loop then stops the law."""
    block = control.CartesianImpedance(7, STIFFNESS, DAMPING, force=10.0, moment=1.0, limit=5.0)
    arm.set(np.full(7, 0.1), np.zeros(7))
    goal = arm.kinematics.pose(np.zeros(7))
    goal[1] = np.nan
    assert np.isnan(arm.torque(block, goal)[:4]).any()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"stiffness": [1.0, 2.0]}, r"stiffness has shape \(2,\); give 1, 3 or 6 numbers"),
        ({"damping": [1, 1, 1, 1, 1, -1.0]}, "damping of axis 5 is -1.0"),
        ({"force": 0.0}, "force of axis 0 is 0.0"),
        ({"moment": np.nan}, "moment of axis 0 is nan"),
        ({"limit": [1.0, 2.0]}, r"limit has shape \(2,\)"),
        ({"null_damping": -1.0}, "null_damping of axis 0 is -1.0"),
    ],
)
def test_invalid_settings_are_named(options: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        control.CartesianImpedance(**{"axes": 7, "stiffness": 1.0, "damping": 1.0, **options})


def test_wrong_rows_and_a_zero_quaternion_are_refused(arm: Arm) -> None:
    block = control.CartesianImpedance(7, STIFFNESS, DAMPING)
    arm.set(np.zeros(7), np.zeros(7))
    with pytest.raises(ValueError, match="the quaternion of the goal is zero"):
        arm.torque(block, np.zeros(7))
    with pytest.raises(ValueError, match="the block has another number of axes"):
        arm.torque(control.CartesianImpedance(6, 1.0, 1.0), np.ones(7))
    zeros = np.zeros(7)
    with pytest.raises(ValueError, match="not the parameters of a CartesianImpedance"):
        control.cartesian_impedance(arm.memory, zeros, zeros, zeros, zeros, zeros, zeros)
