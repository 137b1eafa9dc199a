"""A hand follows poses of an operator, with Cartesian impedance: τ = Jᵀ (K Δx + B Δẋ).

Poses are relative to the pelvis. The goal moves to a new pose with limited speed, so that a distant
pose does not jerk the arm. A pose that is not finite, in another frame or too far from the shoulder
is refused. Without a new pose, the hand holds the last one.
"""

from __future__ import annotations

import math
from pathlib import Path

import body
import numpy as np
import numpy.typing as npt

from catenary import control
from catenary.control.cartesian import cartesian_impedance

Row = npt.NDArray[np.float64]

JOINTS = 8  # of an arm
ROWS = tuple(
    slice(first, first + JOINTS) for first in (body.INDEX[f"{s}_clavicle"] for s in body.SIDES)
)  # of the left and the right arm
FRAME = "pelvis"
SPEED, TURN = 0.3, 1.0  # [m/s], [rad/s] of the goal
REACH = 0.75  # [m] from the shoulder
SHOULDERS = np.array([[0.0, 0.18, 0.53], [0.0, -0.18, 0.53]])  # [m] in the frame
STIFFNESS = (400.0, 400.0, 400.0, 20.0, 20.0, 20.0)  # [N/m], [N·m/rad]
DAMPING = (40.0, 40.0, 40.0, 2.0, 2.0, 2.0)  # [N·s/m], [N·m·s/rad]
IMPEDANCE = control.CartesianImpedance(
    len(body.JOINTS), STIFFNESS, DAMPING, force=60.0, moment=10.0, null_damping=2.0
)


def refusal(side: int, frame: str, pose: Row) -> str | None:
    """Return the reason why a pose (7,) is refused; None if the hand may follow it.

    Args:
        side: 0 for the left hand, 1 for the right hand.
        frame: frame of the pose.
        pose: x, y, z [m], quaternion w, x, y, z.
    """
    if frame != FRAME:
        return f"the pose is in the frame {frame!r}; use {FRAME!r}"
    if not np.isfinite(pose).all():
        return "the pose is not finite"
    if not math.isclose(float(np.linalg.norm(pose[3:])), 1.0, abs_tol=0.01):
        return "the orientation is not a unit quaternion"
    distance = float(np.linalg.norm(pose[:3] - SHOULDERS[side]))
    if distance > REACH:
        return f"the pose is {distance:.2f} m from the shoulder; at most {REACH} m are possible"
    return None


class Hand:
    """Owner of the goal of a hand.

    Args:
        side: 0 for the left hand, 1 for the right hand.
        model: MJCF file of the body.
        position: present positions of all joints (33,) [rad], at which the goal begins.
    """

    def __init__(self, side: int, model: str | Path, position: Row) -> None:
        name = f"{body.SIDES[side]}_hand"
        point = control.Kinematics(model, name, frame=FRAME, joints=body.NAMES)
        self._rows = ROWS[side]
        self._memory, self._parameters = point.memory, IMPEDANCE.parameters
        self.goal = point.pose(position)
        self._torque = np.zeros(len(body.JOINTS))

    def step(self, pose: Row, position: Row, velocity: Row, dt: float) -> Row:
        """Return the torques of the joints of the arm (8,) [N·m].

        Args:
            pose: pose (7,) of the operator.
            position: measured positions (33,) [rad].
            velocity: measured velocities (33,) [rad/s].
            dt: time since the previous step [s].
        """
        rate = self._move(pose, dt)
        cartesian_impedance(
            self._memory, self._parameters, self.goal, rate, position, velocity, self._torque
        )
        return self._torque[self._rows]

    def _move(self, pose: Row, dt: float) -> Row:
        """Move the goal towards the pose. Return its velocity (6,)."""
        way = pose[:3] - self.goal[:3]
        length = float(np.linalg.norm(way))
        step = way * min(1.0, SPEED * dt / length) if length > 0 else way
        self.goal[:3] += step
        self.goal[3:] = turned(self.goal[3:], pose[3:], TURN * dt)
        return np.concatenate([step / dt, np.zeros(3)])


def turned(start: Row, end: Row, most: float) -> Row:
    """Return `start` turned towards `end` by at most `most` [rad]; both are unit quaternions."""
    end = end if start @ end >= 0 else -end
    angle = 2 * math.acos(min(1.0, float(start @ end)))
    share = 1.0 if angle <= most else most / angle
    between = (1 - share) * start + share * end  # the steps are small
    return between / np.linalg.norm(between)
