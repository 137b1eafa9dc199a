"""3D scenes: shapes and poses of MJCF and URDF models, and files that a model must not read."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from catenary.dashboard import model_file
from catenary.dashboard.scene import HEAD, MESH, POSE_HEAD, SHAPE, Scene
from catenary.errors import ConfigurationError

mujoco = pytest.importorskip("mujoco")

ARM = Path(__file__).resolve().parents[2] / "examples" / "cobot" / "arm.xml"
JOINTS = ["base", "shoulder", "elbow", "wrist1", "wrist2", "wrist3"]
TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
FACES = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
LINKS = """
<link name="base"/>
<link name="a">
  <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
  <visual><geometry><mesh filename="{mesh}"/></geometry>
    <material name="red"><color rgba="1 0 0 1"/></material></visual>
  <collision><geometry><sphere radius="2"/></geometry></collision>
</link>
<joint name="j" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
"""


def stl() -> bytes:
    triangles = [
        struct.pack("<12fH", 0, 0, 0, *TETRAHEDRON[list(face)].ravel(), 0) for face in FACES
    ]
    return bytes(80) + struct.pack("<I", len(FACES)) + b"".join(triangles)


def urdf(folder: Path, mesh: str) -> Path:
    path = folder / "robot.urdf"
    path.write_text(f'<robot name="r">{LINKS.format(mesh=mesh)}</robot>')
    return path


class Decoded:
    """Scene as the browser decodes it."""

    def __init__(self, data: bytes) -> None:
        magic, version, self.bodies, shapes, meshes, length, _ = HEAD.unpack_from(data)
        assert (magic, version) == (b"CATSCENE", 1)
        at = HEAD.size
        self.description = json.loads(data[at : at + length])
        at += length
        self.shapes = np.frombuffer(data, SHAPE, shapes, at)
        at += shapes * SHAPE.itemsize
        self.meshes = []
        for _ in range(meshes):
            vertices, faces = struct.unpack_from("<II", data, at)
            points = np.frombuffer(data, "<f4", 3 * vertices, at + 8).reshape(-1, 3)
            corners = np.frombuffer(data, "<u4", 3 * faces, at + 8 + points.nbytes)
            self.meshes.append((points, corners.reshape(-1, 3)))
            at += 8 + points.nbytes + corners.nbytes
        assert at == len(data)


def poses(message: bytes) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    _, _, contacts, bodies, _, _, time, _ = POSE_HEAD.unpack_from(message)
    values = np.frombuffer(message, "<f4", offset=POSE_HEAD.size)
    size = bodies * 7
    actual, ghost = values[:size].reshape(-1, 7), values[size : 2 * size].reshape(-1, 7)
    return actual, ghost, values[2 * size :].reshape(contacts, 6), time


def test_a_scene_has_the_shapes_of_the_model() -> None:
    scene = Decoded(Scene(ARM, JOINTS).data)
    model = mujoco.MjModel.from_xml_path(str(ARM))
    assert (SHAPE.itemsize, HEAD.size, POSE_HEAD.size) == (72, 32, 32)
    assert (scene.bodies, len(scene.shapes)) == (model.nbody, model.ngeom)
    assert scene.description["joints"] == JOINTS
    assert scene.description["bodies"][1] == "link0"
    assert np.array_equal(scene.shapes["type"], model.geom_type)
    assert np.allclose(scene.shapes["colour"], model.geom_rgba)
    assert np.allclose(scene.shapes["position"], model.geom_pos)


def test_poses_follow_axes_and_targets() -> None:
    scene = Scene(ARM, JOINTS)
    q, target = np.linspace(0.1, 0.6, 6), np.full(6, np.nan)
    target[1] = 1.0
    actual, ghost, contacts, time = poses(scene.poses(3.5, q, target))
    model = mujoco.MjModel.from_xml_path(str(ARM))
    data = mujoco.MjData(model)
    for expected, position in ((actual, q), (ghost, np.array([0.1, 1.0, *q[2:]]))):
        data.qpos[:] = position
        mujoco.mj_kinematics(model, data)
        assert np.allclose(expected[:, :3], data.xpos, atol=1e-6)
        assert np.allclose(expected[:, 3:], data.xquat, atol=1e-6)
    assert (time, len(contacts)) == (3.5, 0)


def test_axes_find_their_joints_by_name_by_order_or_by_a_mapping() -> None:
    assert Scene(ARM, [f"{n} Servo" for n in range(6)]).joints == tuple(JOINTS)
    assert Scene(ARM, ["elbow", "gripper"]).joints == ("elbow", None)
    assert Scene(ARM, ["a"], {"a": "wrist2"}).joints == ("wrist2",)
    with pytest.raises(ConfigurationError, match="joint 'x' cannot follow axis 'a'"):
        Scene(ARM, ["a"], {"a": "x"})


def test_contacts_are_sent(tmp_path: Path) -> None:
    path = tmp_path / "two.xml"
    path.write_text(
        '<mujoco><worldbody><geom type="plane" size="1 1 1"/><body><joint name="z" type="slide" '
        'axis="0 0 1"/><geom size=".1"/></body></worldbody></mujoco>'
    )
    scene = Scene(path, ["z"])
    assert len(poses(scene.poses(0.0, np.array([0.5]), np.array([np.nan])))[2]) == 0
    contacts = poses(scene.poses(0.0, np.array([0.09]), np.array([np.nan])))[2]
    assert len(contacts) == 1
    assert np.allclose(abs(contacts[0, 3:]), [0, 0, 1])


@pytest.mark.parametrize("mesh", ["meshes/a.stl", "package://pkg/meshes/a.stl"])
def test_a_urdf_shows_its_visual_meshes(tmp_path: Path, mesh: str) -> None:
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "a.stl").write_bytes(stl())
    scene = Decoded(Scene(urdf(tmp_path, mesh), ["j"]).data)
    assert [int(kind) for kind in scene.shapes["type"]] == [MESH]
    assert scene.shapes["colour"][0].tolist() == [1, 0, 0, 1]
    points, corners = scene.meshes[int(scene.shapes["mesh"][0])]
    assert (len(points), len(corners)) == (4, 4)


@pytest.mark.parametrize(
    "mesh", ["../outside.stl", "/etc/passwd", "package://p/../../outside.stl", "link.stl"]
)
def test_a_mesh_outside_of_the_folder_is_refused(tmp_path: Path, mesh: str) -> None:
    folder = tmp_path / "model"
    folder.mkdir()
    (tmp_path / "outside.stl").write_bytes(stl())
    (folder / "link.stl").symlink_to(tmp_path / "outside.stl")
    with pytest.raises(ConfigurationError, match="outside of the folder of the model"):
        Scene(urdf(folder, mesh), ["j"])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("<mujoco>", "not valid XML"),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]><mujoco/>", "DOCTYPE"),
        ('<mujoco><include file="../x.xml"/></mujoco>', "outside of the folder"),
        ('<mujoco><include file="m.xml"/></mujoco>', "includes more than 64 files"),
        ('<mujoco><asset><hfield name="h" file="h.png"/></asset></mujoco>', "<hfield> names"),
        ('<mujoco><asset><model name="h" file="h.xml"/></asset></mujoco>', "<model> names"),
        ('<mujoco><asset><mesh file="no.stl"/></asset></mujoco>', "No such file"),
        ('<mujoco><compiler meshdir=".."/><asset><mesh file="a"/></asset></mujoco>', "outside"),
        ("<mujoco><worldbody><geom/></worldbody></mujoco>", "MuJoCo rejects"),
    ],
)
def test_bad_models_are_refused(tmp_path: Path, content: str, message: str) -> None:
    path = tmp_path / "m.xml"
    path.write_text(content)
    with pytest.raises(ConfigurationError, match=message):
        Scene(path, [])


def test_includes_and_textures(tmp_path: Path) -> None:
    (tmp_path / "body.xml").write_text(
        '<mujoco><worldbody><geom size=".1" material="m"/></worldbody></mujoco>'
    )
    path = tmp_path / "m.xml"
    path.write_text(
        '<mujoco><asset><texture name="t" type="2d" file="/etc/passwd"/>'
        '<material name="m" texture="t" rgba="0 1 0 1"/></asset><include file="body.xml"/></mujoco>'
    )
    assert Decoded(Scene(path, []).data).shapes["colour"][0].tolist() == [0, 1, 0, 1]


def test_large_meshes_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.stl").write_bytes(stl())
    monkeypatch.setattr(model_file, "LARGEST_MESHES", 200)
    with pytest.raises(ConfigurationError, match="are larger than"):
        Scene(urdf(tmp_path, "a.stl"), ["j"])
