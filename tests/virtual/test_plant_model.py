"""Models for plants: MJCF, URDF, TOML and the example arm. Errors list the existing names."""

from __future__ import annotations

import builtins
import math
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from catenary.errors import ConfigurationError
from catenary.virtual import DigitalOutputs, Joint, Plant, Segment, Servo, read_segment
from tests.virtual.plants import DOUBLE, GRAVITY, PENDULUM, URDF, Time, frictionless, model

COBOT = Path(__file__).resolve().parents[2] / "examples" / "cobot"
DEGREE = math.pi / 180

TOUCHING = """
<mujoco><worldbody><geom name="wall" type="box" size=".1 .1 .1"/>
  <body name="finger" pos=".15 0 0"><joint name="grip" type="slide" axis="1 0 0"/>
  <geom type="sphere" size=".1" mass="1"/></body></worldbody></mujoco>
"""


def test_urdf_is_read_without_meshes(tmp_path: Path) -> None:
    """Both links hang. With the elbow at 30 degrees, the motors hold m g l sin(30°)."""
    angle = 30 * DEGREE
    path = model(tmp_path, URDF, "two.urdf")
    joints = [Joint("shoulder", brake=0), Joint("elbow", brake=0, start=angle)]
    servo = frictionless(axes=2)
    segment = Segment([servo], plant=Plant(path, joints, contacts=False))
    torque = 1.0 * GRAVITY * 0.2 * math.sin(angle)
    servo.apply_load(torque, axis=0)
    servo.apply_load(torque, axis=1)
    Time(segment).pass_by(0.05)
    assert servo.axis_position(0) == pytest.approx(0, abs=1e-6)
    assert servo.axis_position(1) == pytest.approx(angle, abs=1e-6)


def test_urdf_with_contacts_needs_its_meshes(tmp_path: Path) -> None:
    path = model(tmp_path, URDF, "two.urdf")
    with pytest.raises(ConfigurationError, match=r"upper.stl does not exist(.|\n)*contacts=False"):
        Plant(path)


def test_meshes_are_found_below_the_package(tmp_path: Path) -> None:
    """A tetrahedron; only collision shapes are used."""
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "upper.stl").write_bytes(stl())
    (tmp_path / "urdf").mkdir()
    plant = Plant(model(tmp_path / "urdf", URDF, "two.urdf"))
    assert plant.model.nmesh == 1


def stl() -> bytes:
    """Return the corner of a cube as binary STL."""
    facets = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)]
    corners = [(0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.1)]
    body = b"".join(
        struct.pack("<12fH", 0, 0, 0, *(x for k in facet for x in corners[k]), 0)
        for facet in facets
    )
    return bytes(80) + struct.pack("<I", len(facets)) + body


def test_all_joints_of_the_model_are_the_default(tmp_path: Path) -> None:
    plant = Plant(model(tmp_path, DOUBLE))
    assert [(joint.name, joint.gear) for joint in plant.joints] == [("shoulder", 1), ("elbow", 1)]
    segment = Segment([DigitalOutputs(), Servo(axes=2)], plant=plant)
    Time(segment).pass_by(0.01)
    assert plant.steps == 40


@pytest.mark.parametrize(
    ("joints", "passive", "says"),
    [
        ([Joint("shoulder"), Joint("elbwo")], (), "no joint 'elbwo'; its joints are sh"),
        ([Joint("shoulder"), Joint("shoulder")], (), "'shoulder' is used twice"),
        ([Joint("shoulder")], (), r"'elbow' has no motor(.|\n)*passive=\['elbow'\]"),
        ([Joint("shoulder"), Joint("elbow")], ("elbow",), "'elbow' is used twice"),
        ([Joint("shoulder")], ("wrist",), "no joint 'wrist'"),
        ([Joint("shoulder"), Joint("elbow", start=3.0)], (), "start at 3; its range is -2 to 2"),
    ],
)  # fmt: skip
def test_unknown_joints_are_refused_with_a_list(
    tmp_path: Path, joints: list[Joint], passive: tuple[str, ...], says: str
) -> None:
    with pytest.raises(ConfigurationError, match=says):
        Plant(model(tmp_path, DOUBLE), joints, passive=passive)


@pytest.mark.parametrize(
    ("joints", "axes", "says"),
    [
        ([Joint("shoulder"), Joint("elbow")], 1, r"no axis for joint 'elbow'; .* \(1, 0\)"),
        ([Joint("shoulder"), Joint("elbow")], 3, "2 joints have motors, but .* has 3 axes"),
        ([Joint("shoulder", axis=(0, 0)), Joint("elbow")], 2, r"no axis \(0, 0\) for joint"),
        ([Joint("shoulder", axis=(1, 0)), Joint("elbow", axis=(1, 0))], 1, r"two joints .*1, 0"),
    ],
)  # fmt: skip
def test_unknown_axes_are_refused_with_a_list(
    tmp_path: Path, joints: list[Joint], axes: int, says: str
) -> None:
    plant = Plant(model(tmp_path, DOUBLE), joints)
    with pytest.raises(ConfigurationError, match=says):
        Segment([DigitalOutputs(), Servo(axes=axes)], plant=plant)


def test_axes_without_a_joint_keep_their_own_motors(tmp_path: Path) -> None:
    joints = [Joint("shoulder", axis=(0, 1), brake=20.0), Joint("elbow", axis=(1, 0))]
    alone = frictionless(inertia=1e-3, axes=2)
    segment = Segment([alone, Servo()], plant=Plant(model(tmp_path, DOUBLE), joints))
    alone.apply_load(0.1, axis=0)
    Time(segment).pass_by(0.1)
    assert alone.axis_position(0) == pytest.approx(0.5 * 0.1 / 1e-3 * 0.1**2, rel=0.01)
    assert abs(alone.axis_position(1)) < 1e-4  # its brake holds


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("arm.xml", None, "No such file"),
        ("arm.xml", "<mujoco><worldbody>", "is not valid XML"),
        ("arm.xacro", "<html/>", r"<html> is neither MJCF(.|\n)*expand the xacro"),
        ("arm.xml", "<mujoco><worldbody><body/><tendon/></worldbody></mujoco>", "MuJoCo rejects"),
        ("arm.urdf", URDF.replace('<mass value="1"/>', '<mass value="0"/>'), "MuJoCo rejects"),
    ],
)
def test_invalid_model_files_are_refused(
    tmp_path: Path, name: str, text: str | None, says: str
) -> None:
    if text is not None:
        model(tmp_path, text, name)
    with pytest.raises(ConfigurationError, match=says):
        Plant(tmp_path / name, contacts=False)


def test_bodies_that_overlap_at_the_start_are_named(tmp_path: Path) -> None:
    path = model(tmp_path, TOUCHING)
    with pytest.raises(ConfigurationError, match=r"'finger' and body 'world' overlap by 50.0 mm"):
        Plant(path)
    Plant(path, contacts=False)
    Plant(path, [Joint("grip", start=0.05)])  # just touching


@pytest.mark.parametrize(
    "wrong",
    [
        {"gear": 0.0},
        {"gear": math.inf},
        {"direction": 2},
        {"zero": math.nan},
        {"start": math.inf},
        {"brake": -1.0},
        {"brake_delay": -0.1},
    ],
)
def test_invalid_joints_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="joint 'elbow'"):
        Joint("elbow", **wrong)  # type: ignore[arg-type]


def test_too_long_step_is_refused_with_the_reason(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="dead time"):
        Plant(model(tmp_path, PENDULUM), step=2e-3)


def test_plant_belongs_to_one_segment(tmp_path: Path) -> None:
    plant = Plant(model(tmp_path, PENDULUM))
    Segment([Servo()], plant=plant)
    with pytest.raises(ValueError, match="another segment"):
        Segment([Servo()], plant=plant)


def test_error_without_mujoco_names_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    imports = builtins.__import__

    def without(name: str, *arguments: object, **options: object) -> object:
        if name == "mujoco":
            raise ImportError(name)
        return imports(name, *arguments, **options)  # type: ignore[arg-type]

    monkeypatch.delitem(sys.modules, "mujoco")
    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ConfigurationError, match=r"not installed\n.*'catenary\[sim\]'"):
        Plant(model(tmp_path, PENDULUM))


def test_importing_the_virtual_segment_imports_neither_mujoco_nor_numpy() -> None:
    program = "import sys, catenary.virtual; sys.exit(bool({'mujoco', 'numpy'} & {*sys.modules}))"
    assert subprocess.run([sys.executable, "-c", program], timeout=60).returncode == 0


# -- TOML --------------------------------------------------------------------------------------

GOOD = """
[plant]
model = "arm.xml"
step = 500e-6

[[plant.joint]]
name = "shoulder"
gear = 50.0
brake_delay = 0.02

[[plant.joint]]
name = "elbow"
direction = -1
start = 0.5

[[device]]
kind = "servo"
axes = 2
"""


def test_plant_is_read_from_a_segment_file(tmp_path: Path) -> None:
    model(tmp_path, DOUBLE)
    segment = read_segment(model(tmp_path, GOOD, "cell.toml"))
    assert segment.plant is not None
    assert (segment.plant.step, segment.plant.path) == (500e-6, tmp_path / "arm.xml")
    assert segment.plant.joints == (
        Joint("shoulder", gear=50.0, brake_delay=0.02),
        Joint("elbow", direction=-1, start=0.5),
    )


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("gear = 50.0", "ratio = 50.0"), r"ratio.*plant\.joint\[0\]"),
        (("gear = 50.0", "gear = 0.0"), r"cell.toml.*gear must be positive.*plant\.joint\[0\]"),
        (("arm.xml", "leg.xml"), r"leg.xml: No such file"),
        (('"elbow"', '"knee"'), r"cell.toml: plant: .*no joint 'knee'; its joints are"),
        (("500e-6", "0.5"), r"cell.toml: .*the step of a plant"),
        (("axes = 2", "axes = 1"), r"cell.toml: .*no axis for joint 'elbow'"),
    ],
)
def test_invalid_plant_table_is_refused(tmp_path: Path, change: tuple[str, str], says: str) -> None:
    model(tmp_path, DOUBLE)
    path = model(tmp_path, GOOD.replace(*change), "cell.toml")
    with pytest.raises(ConfigurationError, match=says):
        read_segment(path)


# -- robots ------------------------------------------------------------------------------------


def test_example_arm_has_the_limits_of_an_indy7() -> None:
    """Values of its joint_limits.yaml: N·m, degrees per second, degrees."""
    segment = read_segment(COBOT / "segment.toml")
    assert segment.plant is not None
    efforts = [431.97, 431.97, 197.23, 79.79, 79.79, 79.79]
    speeds, ranges = [150.0] * 3 + [180.0] * 3, [175.0] * 5 + [215.0]
    for k, joint in enumerate(segment.plant.joints):
        servo, there = segment[k], segment.plant.model.joint(joint.name)
        assert isinstance(servo, Servo)
        assert there.range.tolist() == pytest.approx([-ranges[k] * DEGREE, ranges[k] * DEGREE])
        assert segment.plant.model.jnt_actfrcrange[k].tolist() == [-efforts[k], efforts[k]]
        most = servo.rated_torque * servo.max_torque_ratio * joint.gear
        assert 0.998 * efforts[k] < most <= efforts[k] + 1e-9
        assert servo.max_velocity / joint.gear == pytest.approx(speeds[k] * DEGREE, rel=1e-3)
        assert servo.position_limits is not None
        assert 0.99 < servo.position_limits[1] / joint.gear / (ranges[k] * DEGREE) <= 1
    assert sum(segment.plant.model.body_mass) == pytest.approx(26.38, rel=0.01)  # as an Indy7's


def test_indy7_description_is_loaded_in_place(shared_data: Path) -> None:
    path = shared_data / "robots" / "indy7" / "derived_indy7_flat.urdf"
    servos = [Servo(name=f"joint{k}") for k in range(6)]
    plant = Plant(path, [Joint(f"joint{k}", gear=100.0) for k in range(6)], contacts=False)
    segment = Segment(servos, plant=plant)
    Time(segment).pass_by(0.1)
    assert max(abs(plant.data.qpos)) < 1e-4  # upright, held by its brakes
    assert plant.model.jnt_range[5].tolist() == pytest.approx([-215 * DEGREE, 215 * DEGREE])
