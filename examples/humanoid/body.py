"""Joints of the humanoid in `humanoid.xml`: networks, motors, gears, gains and limits.

The joints have a fixed order: first the 18 of the upper network, then the 15 of the lower one.
Arrays of all joints have the shape (33,) and this order.

Sizes of the motors and gains are chosen for a robot of 100 kg. The peak torques of the legs are
similar to those of TOCABI, a humanoid of the same mass. The torque limits of its public controllers
are 166 to 333 N·m for the legs. Their joint stiffness is higher than ours: 3200 N·m/rad at the
ankles, and 2000 to 5000 N·m/rad in the rest of the legs (repositories tocabi_cc of its authors).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from pathlib import Path
from typing import Any, Literal

import numpy as np

MODEL = Path(__file__).with_name("humanoid.xml")
SIDES = ("left", "right")
PEAK_RATIO = 3.0  # peak torque of a motor divided by its rated torque


@dataclass(frozen=True, slots=True)
class Motor:
    """Motor with its gear. The values are those of the motor shaft.

    Attributes:
        gear: Gear ratio, motor angle per joint angle.
        rated_torque: Rated torque [N·m].
        inertia: Inertia of rotor and gear [kg·m²].
        viscous_friction: Viscous friction [N·m·s/rad].
        coulomb_friction: Dry friction [N·m].
        max_velocity: Maximum velocity [rad/s].
    """

    gear: float
    rated_torque: float
    inertia: float
    viscous_friction: float
    coulomb_friction: float
    max_velocity: float

    @property
    def peak_torque(self) -> float:
        """Peak torque at the joint [N·m]."""
        return PEAK_RATIO * self.rated_torque * self.gear


LARGE = Motor(100.0, 1.10, 9e-5, 3e-4, 0.030, 800.0)  # 330 N·m, 8 rad/s at the joint
MEDIUM = Motor(100.0, 0.80, 5e-5, 2e-4, 0.022, 800.0)  # 240 N·m
ARM = Motor(100.0, 0.30, 2e-5, 1e-4, 0.010, 700.0)  # 90 N·m
SMALL = Motor(80.0, 0.12, 6e-6, 5e-5, 0.006, 700.0)  # 29 N·m


@dataclass(frozen=True, slots=True)
class Joint:
    """Joint of the model, and the motor that drives it.

    Attributes:
        name: Name of the joint in the model and of its axis.
        network: Network of the drive.
        motor: The motor with its gear.
        stiffness: Stiffness of the joint impedance [N·m/rad].
        damping: Damping of the joint impedance [N·m·s/rad].
        low: Lower position limit [rad].
        high: Upper position limit [rad].
        stand: Position in the standing pose [rad].
    """

    name: str
    network: Literal["upper", "lower"]
    motor: Motor
    stiffness: float
    damping: float
    low: float
    high: float
    stand: float


# Name, motor, stiffness, damping, lower limit [degrees], upper limit, standing pose. The signs of
# roll and yaw joints are those of the left side.
ARM_TABLE = (
    ("clavicle", ARM, 400.0, 15.0, -25, 25, 0),
    ("shoulder_pitch", ARM, 300.0, 15.0, -160, 60, 0),
    ("shoulder_roll", ARM, 300.0, 15.0, -15, 150, 10),
    ("shoulder_yaw", ARM, 200.0, 8.0, -100, 100, 0),
    ("elbow", ARM, 200.0, 8.0, -135, 0, -25),
    ("forearm", SMALL, 60.0, 2.0, -120, 120, 0),
    ("wrist_pitch", SMALL, 40.0, 1.5, -60, 60, 0),
    ("wrist_roll", SMALL, 40.0, 1.5, -50, 50, 0),
)
NECK_TABLE = (
    ("neck_yaw", SMALL, 60.0, 2.0, -80, 80, 0),
    ("neck_pitch", SMALL, 60.0, 2.0, -35, 45, 0),
)
WAIST_TABLE = (
    ("waist_yaw", LARGE, 2000.0, 80.0, -60, 60, 0),
    ("waist_pitch", LARGE, 4000.0, 120.0, -20, 60, 0),
    ("waist_roll", LARGE, 4000.0, 120.0, -25, 25, 0),
)
LEG_TABLE = (
    ("hip_yaw", MEDIUM, 2000.0, 40.0, -40, 40, 0),
    ("hip_roll", LARGE, 3000.0, 90.0, -35, 35, 0),
    ("hip_pitch", LARGE, 3000.0, 90.0, -115, 40, -20),
    ("knee", LARGE, 3000.0, 90.0, 0, 130, 40),
    ("ankle_pitch", MEDIUM, 1000.0, 45.0, -50, 45, -20),
    ("ankle_roll", MEDIUM, 1000.0, 45.0, -30, 30, 0),
)
MIRRORED = ("_roll", "_yaw")


def _make(
    table: tuple[tuple[Any, ...], ...], network: Literal["upper", "lower"], side: str = ""
) -> tuple[Joint, ...]:
    """Return the joints of one table; `side` is the prefix of their names, or empty."""
    joints = []
    for name, motor, stiffness, damping, *angles in table:
        low, high, stand = (radians(angle) for angle in angles)
        if side == "right" and name.endswith(MIRRORED):
            low, high, stand = -high, -low, -stand + 0.0
        full = f"{side}_{name}" if side else name
        joints.append(Joint(full, network, motor, stiffness, damping, low, high, stand))
    return tuple(joints)


UPPER = (
    *(joint for side in SIDES for joint in _make(ARM_TABLE, "upper", side)),
    *_make(NECK_TABLE, "upper"),
)
LOWER = (
    *_make(WAIST_TABLE, "lower"),
    *(joint for side in SIDES for joint in _make(LEG_TABLE, "lower", side)),
)
JOINTS = UPPER + LOWER
NAMES = tuple(joint.name for joint in JOINTS)
INDEX = {name: number for number, name in enumerate(NAMES)}

STIFFNESS = np.array([joint.stiffness for joint in JOINTS])  # [N·m/rad]
DAMPING = np.array([joint.damping for joint in JOINTS])  # [N·m·s/rad]
TORQUE = np.array([joint.motor.peak_torque for joint in JOINTS])  # [N·m]
LOW = np.array([joint.low for joint in JOINTS])  # [rad]
HIGH = np.array([joint.high for joint in JOINTS])  # [rad]
STAND = np.array([joint.stand for joint in JOINTS])  # [rad]
# Dry friction at the joint [N·m] and viscous friction at the joint [N·m·s/rad].
COULOMB = np.array([joint.motor.coulomb_friction * joint.motor.gear for joint in JOINTS])
VISCOUS = np.array([joint.motor.viscous_friction * joint.motor.gear**2 for joint in JOINTS])
ARMATURE = np.array([joint.motor.inertia * joint.motor.gear**2 for joint in JOINTS])  # [kg·m²]

SENSORS = {  # sensors of the model and their number of values
    "imu_orientation": 4,
    "imu_gyro": 3,
    "imu_acceleration": 3,
    "left_foot_force": 3,
    "left_foot_torque": 3,
    "right_foot_force": 3,
    "right_foot_torque": 3,
}


def load_model(path: str | Path = MODEL, *, step: float = 250e-6) -> Any:
    """Return the mjModel with the inertia and friction of the motors.

    The virtual plant of Catenary adds the same values to the joints.

    Args:
        path: MJCF file with the joints of `NAMES`.
        step: Time step [s].

    Raises:
        ValueError: A joint or sensor is missing, or the model has other joints.
    """
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(path))
    check_model(model, str(path))
    model.opt.timestep = step
    dofs = velocity_indices(model)
    model.dof_armature[dofs] += ARMATURE
    model.dof_damping[dofs] += VISCOUS
    model.dof_frictionloss[dofs] += COULOMB
    model.dof_solref[dofs] = 2 * step, 1.0
    model.dof_solimp[dofs] = 0.9999, 0.9999, 0.001, 0.5, 2.0
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def check_model(model: Any, path: str) -> None:
    """Raise ValueError if the model does not have the joints and sensors of this humanoid.

    Args:
        model: The mjModel.
        path: Name of its file, for the message.
    """
    found = {model.joint(n).name for n in range(model.njnt)}
    expected = {"base", *NAMES}
    if found != expected:
        missing, more = sorted(expected - found), sorted(found - expected)
        raise ValueError(
            f"{path} is not this humanoid: missing joints {missing}, unknown joints {more};"
            " the table of the joints is in examples/humanoid/body.py"
        )
    sensors = {model.sensor(n).name for n in range(model.nsensor)}
    if missing := sorted(SENSORS.keys() - sensors):
        raise ValueError(f"{path} has no sensors {missing}; see SENSORS in body.py")


def position_indices(model: Any) -> np.ndarray:
    """Return the indices of the joints in qpos, (33,), in the order of `NAMES`."""
    return np.array([int(model.joint(name).qposadr[0]) for name in NAMES])


def velocity_indices(model: Any) -> np.ndarray:
    """Return the indices of the joints in qvel, (33,), in the order of `NAMES`."""
    return np.array([int(model.joint(name).dofadr[0]) for name in NAMES])
