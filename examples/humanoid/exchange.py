"""Values that the loop and the tasks of the humanoid exchange, as NumPy records.

The loop writes a `STATE` in every cycle. Each other record has one task as its writer.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from catenary import realtime

JOINTS, UPPER_JOINTS, FEET, HANDS = 33, 18, 2, 2


class Mode(IntEnum):
    """Operating mode of the robot, in the order of `MODES`."""

    DAMPING = 0  # the joints only brake
    STAND = 1  # joint positions and static torque, without feedback of the body
    BALANCE = 2  # as STAND, and the centre of mass is controlled


MODES = tuple(mode.name.lower() for mode in Mode)


class Verdict(IntEnum):
    """Decision of the safety task."""

    GO = 0
    DAMP = 1  # the joints brake
    STOP = 2  # the drives stop, and the program ends


class Cause(IntEnum):
    """Reason of a decision of the safety task."""

    NONE = 0
    FALLEN = 1
    SILENT_ESTIMATOR = 2
    SILENT_BALANCE = 3
    SILENT_LOOP = 4
    LOST_DRIVE = 5  # a drive does not answer, or is in fault
    LOST_IMU = 6
    SILENT_SAFETY = 7  # found by the loop, as the next one
    NOT_READY = 8  # the drives were not enabled in time, or a task sent no values

    @property
    def text(self) -> str:
        return self.name.lower().replace("_", " ")


STATE = np.dtype(
    [
        ("number", "i8"),  # of the cycle
        ("time", "f8"),  # [s] of the loop
        ("mode", "i8"),  # a `Mode`
        ("held", "i8"),  # 1: the robot hangs in its gantry
        ("position", "f8", JOINTS),  # [rad]
        ("velocity", "f8", JOINTS),  # [rad/s]
        ("torque", "f8", JOINTS),  # [N·m] of the drives, at the joints
        ("orientation", "f8", 4),  # of the IMU, quaternion w, x, y, z
        ("gyro", "f8", 3),  # [rad/s]
        ("acceleration", "f8", 3),  # [m/s²]
        ("feet", "f8", (FEET, 6)),  # force [N] and torque [N·m] of the left and the right foot
        ("feet_valid", "i8", FEET),  # 0: the sensor is lost
        ("imu_valid", "i8"),
        ("drives_valid", "i8", 2),  # of each network: all drives answer, and none is in fault
    ]
)

ESTIMATE = np.dtype(
    [  # the fields of estimate.Estimate
        ("position", "f8", JOINTS),
        ("velocity", "f8", JOINTS),
        ("base_position", "f8", 3),
        ("base_velocity", "f8", 3),
        ("orientation", "f8", 4),
        ("gyro", "f8", 3),
        ("com", "f8", 3),
        ("com_velocity", "f8", 3),
        ("load", "f8", FEET),
        ("reliable", "i8"),
        ("fallen", "i8"),
        ("tilt", "f8"),  # [rad]
        ("time", "f8"),  # [s] of the state
    ]
)

COMMAND = np.dtype(
    [
        ("position", "f8", JOINTS),  # [rad]
        ("velocity", "f8", JOINTS),  # [rad/s]
        ("torque", "f8", JOINTS),  # [N·m] feed-forward
        ("scale", "f8", JOINTS),  # of the stiffness, 0 to 1
        ("policy", "i8"),  # 1: by the policy, 0: by the balance
    ]
)

ARMS = np.dtype(
    [
        ("moving", "i8"),  # 1: a preset is running
        ("position", "f8", UPPER_JOINTS),
        ("velocity", "f8", UPPER_JOINTS),
    ]
)

HAND = np.dtype(
    [
        ("active", "i8", HANDS),  # 1: the hand follows poses of an operator; left, right
        ("torque", "f8", (HANDS, 8)),  # [N·m] of the joints of its arm
    ]
)

SAFETY = np.dtype([("verdict", "i8"), ("cause", "i8")])


def record(dtype: np.dtype) -> realtime.Value:
    """Return a Value of one record."""
    return realtime.Value(dtype, ())


@dataclass(frozen=True)
class Exchange:
    """All Values of the program. Each has one writer."""

    state: realtime.Value = field(default_factory=lambda: record(STATE))  # loop
    estimate: realtime.Value = field(default_factory=lambda: record(ESTIMATE))
    gravity: realtime.Value = field(default_factory=lambda: realtime.Value("f8", JOINTS))
    arms: realtime.Value = field(default_factory=lambda: record(ARMS))
    command: realtime.Value = field(default_factory=lambda: record(COMMAND))  # balance
    policy: realtime.Value = field(default_factory=lambda: realtime.Value("f8", JOINTS))
    hand: realtime.Value = field(default_factory=lambda: record(HAND))
    safety: realtime.Value = field(default_factory=lambda: record(SAFETY))
    preset: realtime.Value = field(default_factory=lambda: realtime.Value("i8", 2))
    """Serial number and number of the newest requested preset, from the loop."""
