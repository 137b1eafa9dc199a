"""Presets of the arms and the neck: goals, and the motion to them with limited jerk."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import body
import numpy as np
import numpy.typing as npt

from catenary import control

Row = npt.NDArray[np.float64]

AXES = len(body.UPPER)
HOME = body.STAND[:AXES]  # [rad]
LIMITS = control.MotionLimits(
    1.5, 4.0, 40.0, body.LOW[:AXES], body.HIGH[:AXES]
)  # [rad/s], [rad/s²], [rad/s³], [rad], [rad]

RAISED = {"right_shoulder_roll": -110, "right_elbow": -70, "neck_yaw": -20}  # [degrees]
OUT = {"right_shoulder_roll": -130, "right_elbow": -35, "neck_yaw": -20}
FORWARD = {
    f"{side}_{name}": angle
    for side in body.SIDES
    for name, angle in (("shoulder_pitch", -60), ("elbow", -40))
}
PRESETS: Mapping[str, Sequence[Mapping[str, float]]] = {
    "home": [{}],
    "wave": [RAISED, OUT, RAISED, OUT, RAISED, {}],
    "reach": [FORWARD | {"neck_pitch": 15}, {}],
}
NAMES = tuple(PRESETS)


class Reference(NamedTuple):
    """Set-points of the joints of the upper network."""

    position: Row  # (18,) [rad]
    velocity: Row  # (18,) [rad/s]
    acceleration: Row  # (18,) [rad/s²]


def goals(preset: str) -> Row:
    """Return the poses of a preset, (number of poses, 18) [rad]. Other joints are at home."""
    poses = []
    for angles in PRESETS[preset]:
        pose = HOME.copy()
        for name, angle in angles.items():
            pose[body.INDEX[name]] = np.radians(angle)
        poses.append(pose)
    return np.array(poses)


class Arms:
    """Owner of the motion of the arms. It begins at `position` (18,) [rad], at rest."""

    def __init__(self, position: Row, period: float) -> None:
        self.reference = Reference(np.array(position), np.zeros(AXES), np.zeros(AXES))
        self._period = period
        self._motion: control.Trajectory | None = None
        self._row = 0

    @property
    def moving(self) -> bool:
        return self._motion is not None

    def run(self, preset: str) -> None:
        """Plan the motion to the poses of a preset, from the present reference."""
        begin = control.MotionState(*self.reference)
        self._motion = control.trajectory(begin, goals(preset), LIMITS, self._period)
        self._row = 0

    def step(self) -> Reference:
        """Return the reference one period later."""
        if self._motion is not None:
            self.reference = Reference(*self._motion.row(self._row))
            self._row += 1
            if self._row == len(self._motion):
                self._motion = None
        return self.reference
