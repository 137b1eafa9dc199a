"""Small models for plants with known physics, and a clock that runs without a MainDevice."""

from __future__ import annotations

from pathlib import Path

from catenary.virtual import Joint, Plant, Segment, Servo

MASS, LENGTH, GRAVITY = 2.0, 0.5, 9.81  # point mass on a massless rod
INERTIA = MASS * LENGTH**2
STEP = 250e-6

PENDULUM = f"""
<mujoco model="pendulum">
  <option gravity="0 0 -{GRAVITY}"/>
  <worldbody>
    <body name="rod">
      <joint name="swing" axis="0 1 0"/>
      <inertial pos="0 0 -{LENGTH}" mass="{MASS}" diaginertia="1e-9 1e-9 1e-9"/>
    </body>
  </worldbody>
</mujoco>
"""

# Two hinges about y, point masses at the elbow and at the hand, hanging along -x at zero.
DOUBLE = """
<mujoco model="double">
  <compiler angle="radian"/>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0"/>
      <geom type="sphere" size=".02" pos=".4 0 0" mass="1.5" contype="0" conaffinity="0"/>
      <body name="lower" pos=".4 0 0">
        <joint name="elbow" axis="0 1 0" range="-2 2" limited="true"/>
        <geom type="sphere" size=".02" pos=".3 0 0" mass="1" contype="0" conaffinity="0"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""

URDF = """<?xml version="1.0"?>
<robot name="two">
  <link name="base"/>
  <link name="upper">
    <visual><geometry><mesh filename="package://two/meshes/upper.stl"/></geometry></visual>
    <collision><geometry><mesh filename="package://two/meshes/upper.stl"/></geometry></collision>
    <inertial><origin xyz="0 0 -0.3"/><mass value="3"/>
      <inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <link name="lower">
    <inertial><origin xyz="0 0 -0.2"/><mass value="1"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.005" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="100" velocity="3"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="upper"/><child link="lower"/><origin xyz="0 0 -0.6"/><axis xyz="0 1 0"/>
    <limit lower="-1.5" upper="1.5" effort="50" velocity="3"/>
  </joint>
</robot>
"""


def frictionless(**options: object) -> Servo:
    """Return a servo that adds neither friction nor inertia, except as `options` specify."""
    given = {"inertia": 1e-12, "viscous_friction": 0.0, "coulomb_friction": 0.0, **options}
    return Servo(**given)  # type: ignore[arg-type]


def model(folder: Path, text: str, name: str = "arm.xml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def pendulum(folder: Path, servo: Servo, **joint: object) -> Segment:
    """Return a pendulum on one servo. It has no brake unless `joint` specifies one."""
    options = {"brake": 0.0, **joint}
    path = model(folder, PENDULUM)
    return Segment([servo], plant=Plant(path, [Joint("swing", **options)]))  # type: ignore[arg-type]


class Time:
    """Link that only lets the time of a segment pass."""

    def __init__(self, segment: Segment) -> None:
        self._link = segment.open_link()

    def pass_by(self, seconds: float) -> None:
        self._link.wait_until(self._link.now() + round(seconds * 1e9), False)
