"""Poses and Jacobians, compared with MuJoCo, with Pinocchio and with finite differences."""

import pickle
from pathlib import Path

import mujoco
import numpy as np
import pytest

from catenary import control
from catenary.errors import ConfigurationError
from tests.control.arm import SEVEN, URDF

JOINTS = ["pitch", "roll", "slide", "elbow", "forearm", "wrist", "neck"]


@pytest.fixture
def seven(tmp_path: Path) -> Path:
    path = tmp_path / "seven.xml"
    path.write_text(SEVEN)
    return path


class Judge:
    """Relative pose and Jacobian from MuJoCo's `mj_jac`, with a moving floating base."""

    def __init__(self, path: Path, frame: str, order: list[str], seed: int) -> None:
        self.model = mujoco.MjModel.from_xml_path(str(path))
        self.data = mujoco.MjData(self.model)
        rng = np.random.default_rng(seed)
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:3] = rng.uniform(-1, 1, 3)
        self.data.qpos[3:7] = rng.normal(size=4)
        self.frame, self.order = frame, order
        self.q = rng.uniform(-3, 3, len(order))

    def __call__(self, q: np.ndarray, point: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        model, data = self.model, self.data
        data.qpos[[model.joint(name).qposadr[0] for name in self.order]] = q
        mujoco.mj_forward(model, data)
        base = data.body(self.frame)
        end = data.site(point) if point == "grip" else data.body(point)
        moved = data.body("hand" if point == "grip" else point).id
        turn, place = base.xmat.reshape(3, 3).T, end.xpos - base.xpos
        linear, angular = np.zeros((2, 3, model.nv))
        mujoco.mj_jac(model, data, linear, angular, end.xpos, moved)
        degrees = [model.joint(name).dofadr[0] for name in self.order]
        both = np.vstack([turn @ linear[:, degrees], turn @ angular[:, degrees]])
        return turn @ place, turn @ end.xmat.reshape(3, 3), both


def matrix(quaternion: np.ndarray) -> np.ndarray:
    found = np.zeros(9)
    mujoco.mju_quat2Mat(found, quaternion)
    return found.reshape(3, 3)


@pytest.mark.parametrize("point", ["grip", "hand", "bracket"])
@pytest.mark.parametrize("order", [JOINTS, JOINTS[::-1]])
def test_pose_and_jacobian_equal_those_of_mujoco(seven: Path, point: str, order: list[str]) -> None:
    """The floating base has a random pose each time. It does not change the relative pose."""
    arm = control.Kinematics(seven, point, frame="torso", joints=order, axes=7)
    assert arm.joints == tuple(order)
    for seed in range(20):
        judge = Judge(seven, "torso", order, seed)
        place, turn, both = judge(judge.q, point)
        pose = arm.pose(judge.q)
        assert pose[:3] == pytest.approx(place, abs=1e-12)
        assert matrix(pose[3:]) == pytest.approx(turn, abs=1e-12)
        assert np.linalg.norm(pose[3:]) == pytest.approx(1.0)
        assert pose[3] >= 0.0
        assert arm.jacobian(judge.q) == pytest.approx(both, abs=1e-12)


def test_every_branch_of_the_quaternion_is_continuous(seven: Path) -> None:
    """One turn of the waist about z, with the hand in an arbitrary orientation."""
    order = ["waist", *JOINTS]
    arm = control.Kinematics(seven, "grip", frame="base", joints=order)
    largest = set()
    before = arm.pose(np.zeros(8))[3:]
    for seed in range(30):
        rng = np.random.default_rng(seed)
        q = rng.uniform(-3, 3, 8)
        for angle in np.linspace(-3, 3, 61):
            q[0] = angle
            found = arm.pose(q)[3:]
            if angle > -3:
                assert min(abs(found - before).max(), abs(found + before).max()) < 0.06
            largest.add(int(np.argmax(abs(found))))
            before = found
    assert largest == {0, 1, 2, 3}


def test_the_jacobian_is_the_derivative_of_the_pose(seven: Path) -> None:
    arm = control.Kinematics(seven, "grip", frame="torso", joints=JOINTS)
    q, h = np.random.default_rng(5).uniform(-2, 2, 7), 1e-6
    found = arm.jacobian(q)
    for k in range(7):
        step = h * np.eye(7)[k]
        above, below = arm.pose(q + step), arm.pose(q - step)
        assert (above - below)[:3] / (2 * h) == pytest.approx(found[:3, k], abs=1e-8)
        spin = (matrix(above[3:]) - matrix(below[3:])) / (2 * h) @ matrix(arm.pose(q)[3:]).T
        assert [spin[2, 1], spin[0, 2], spin[1, 0]] == pytest.approx(found[3:, k], abs=1e-8)


def test_joints_that_are_not_axes_stay_at_their_initial_positions(seven: Path) -> None:
    """The waist is at its reference of 0.4 rad, which is its initial position."""
    with_waist = control.Kinematics(seven, "grip", frame="base", joints=["waist", *JOINTS])
    without = control.Kinematics(seven, "grip", frame="base", joints=JOINTS)
    q = np.linspace(-1, 1, 7)
    assert without.pose(q) == pytest.approx(with_waist.pose([0.4, *q]), abs=1e-12)


URDF_TOOL = URDF.replace(
    "</robot>",
    """  <link name="tool"/>
  <joint name="mount" type="fixed">
    <parent link="lower"/><child link="tool"/><origin xyz="0.1 0 -0.4" rpy="0.2 -0.4 1.1"/>
  </joint>
</robot>""",
)


def test_a_urdf_equals_pinocchio(tmp_path: Path) -> None:
    """The tool is a fixed link, which MuJoCo merges with its parent by default."""
    pinocchio = pytest.importorskip("pinocchio", reason="judge of a URDF: pip install pin")
    path = tmp_path / "two.urdf"
    path.write_text(URDF_TOOL)
    arm = control.Kinematics(path, "tool", axes=2)
    model = pinocchio.buildModelFromXML(URDF_TOOL)
    data, frame = model.createData(), model.getFrameId("tool")
    assert list(model.names[1:]) == list(arm.joints)
    for q in np.random.default_rng(2).uniform(-2, 2, (10, 2)):
        expected = pinocchio.computeFrameJacobian(
            model, data, q, frame, pinocchio.LOCAL_WORLD_ALIGNED
        )
        pinocchio.framesForwardKinematics(model, data, q)
        pose = arm.pose(q)
        assert pose[:3] == pytest.approx(data.oMf[frame].translation, abs=1e-12)
        assert matrix(pose[3:]) == pytest.approx(data.oMf[frame].rotation, abs=1e-12)
        assert arm.jacobian(q) == pytest.approx(expected, abs=1e-12)


def test_a_urdf_of_two_links_by_hand(tmp_path: Path) -> None:
    path = tmp_path / "two.urdf"
    path.write_text(URDF_TOOL.replace('rpy="0.2 -0.4 1.1"', ""))
    arm = control.Kinematics(path, "tool", joints=["elbow", "shoulder"])
    assert arm.pose([0, 0]) == pytest.approx([0.1, 0, -1.0, 1, 0, 0, 0])
    assert arm.pose([0, np.pi / 2])[:3] == pytest.approx([-1.0, 0, -0.1])
    assert arm.jacobian([0, 0])[:, 0] == pytest.approx([-0.4, 0, -0.1, 0, 1, 0])


@pytest.mark.parametrize(
    ("point", "options", "message"),
    [
        ("foot", {}, r"no point 'foot'\n.*bodies world, base, torso.*and the sites grip"),
        ("grip", {"frame": "legs"}, "no point 'legs'"),
        ("grip", {"frame": "head"}, r"'head' does not carry 'grip'\n.*base, torso, upper.*hand"),
        ("grip", {}, r"'float' between 'world' and 'grip' is neither hinge nor slide.*\n.*frame="),
        ("head", {"frame": "base", "joints": ["wrist"]}, "none of the joints wrist moves 'head'"),
        ("grip", {"frame": "torso", "joints": ["knee"]}, "no joint 'knee'"),
        ("grip", {"frame": "torso", "axes": 6}, "7 joints .* for 6 axes"),
        ("grip", {"frame": "torso", "joints": None}, "joint 'float' is neither hinge nor slide"),
    ],
)
def test_wrong_names_and_a_floating_base_are_explained(
    seven: Path, point: str, options: dict, message: str
) -> None:
    with pytest.raises(ConfigurationError, match=f"(?s){message}"):
        control.Kinematics(seven, point, **{"joints": JOINTS, **options})


def test_wrong_lengths_and_the_wrong_memory(seven: Path) -> None:
    arm = control.Kinematics(seven, "grip", frame="torso", joints=JOINTS)
    with pytest.raises(ValueError, match=r"position has shape \(2,\); .* 7 joints \(pitch, roll"):
        arm.pose([0.0, 0.0])
    with pytest.raises(ValueError, match="the number of joints of the model differs"):
        control.pose(arm.memory, np.zeros(6), np.zeros(7))
    with pytest.raises(ValueError, match="not the memory of a Kinematics"):
        control.jacobian(np.zeros(300), np.zeros(7), np.zeros(42))


def test_another_process_gets_the_same_kinematics(seven: Path) -> None:
    arm = control.Kinematics(seven, "grip", frame="torso", joints=JOINTS)
    assert pickle.loads(pickle.dumps(arm)).memory.tolist() == arm.memory.tolist()
