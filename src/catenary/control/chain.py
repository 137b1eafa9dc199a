"""Chain of joints between a body and a point of a model, as fixed steps and joint axes.

Each joint of MuJoCo turns about, or slides along, an axis through an anchor of its body. Joints
that are not axes stay at their initial positions, and become part of the fixed steps.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from catenary.control.compiles import Row
from catenary.control.model import HINGE, SLIDE, Model
from catenary.errors import ConfigurationError

Matrix = npt.NDArray[np.float64]
WORLD = 0  # body of MuJoCo


@dataclass(frozen=True, slots=True)
class Step:
    """Fixed pose relative to the previous step: rotation (3, 3) and translation (3,) [m]."""

    rotation: Matrix
    translation: Row

    def then(self, rotation: Matrix, translation: Row) -> Step:
        """Return the pose after a second step."""
        return Step(self.rotation @ rotation, self.translation + self.rotation @ translation)

    @property
    def row(self) -> Row:
        """Rotation by rows, then translation, (12,)."""
        return np.concatenate([self.rotation.ravel(), self.translation])


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint of the chain: the fixed step to its anchor, and its axis.

    `axis` is the number of the axis, `reference` its position without displacement, and `direction`
    (3,) a unit vector in the frame of the step.
    """

    axis: int
    slides: bool
    reference: float
    step: Step
    direction: Row

    @property
    def row(self) -> Row:
        """All values of the joint, (18,)."""
        return np.concatenate(
            [[self.axis, self.slides, self.reference], self.step.row, self.direction]
        )


@dataclass(frozen=True, slots=True)
class Chain:
    """Joints from a frame to a point, and the fixed step from the last joint to the point."""

    joints: tuple[Joint, ...]
    end: Step


def read_chain(model: Model, path: Path, point: str, frame: str) -> Chain:
    """Read the chain of a model between a frame and a point.

    Args:
        model: loaded model with its axes.
        path: file of the model, for messages.
        point: name of a site or body.
        frame: name of a body that carries the point, or "world".

    Raises:
        ConfigurationError: A name is missing, the frame does not carry the point, the chain has a
            free or ball joint, or no axis moves the point.
    """
    native = model.native
    body, offset = _point(native, path, point)
    joints: list[Joint] = []
    here = Step(np.eye(3), np.zeros(3))
    for link in _bodies(native, path, point, body, frame):
        here = here.then(_rotation(native.body_quat[link]), np.array(native.body_pos[link]))
        for joint in _joints(native, link):
            _check_kind(joint, path, point, frame)
            if joint.name in model.joints:
                anchor = np.array(joint.pos)
                axis = model.joints.index(joint.name)
                joints.append(_joint(native, joint, axis, here.then(np.eye(3), anchor)))
                here = Step(np.eye(3), -anchor)
    if not joints:
        raise ConfigurationError(
            f"{path}: none of the joints {', '.join(model.joints)} moves {point!r} relative to "
            f"{frame!r}",
            hint="name the joints between frame and point: joints=[...]",
        )
    return Chain(tuple(joints), here.then(offset.rotation, offset.translation))


def _point(native: Any, path: Path, name: str) -> tuple[int, Step]:
    """Return the body of a point, and the pose of the point on this body."""
    sites = [native.site(k).name for k in range(native.nsite)]
    if name in sites:
        site = sites.index(name)
        rotation = _rotation(native.site_quat[site])
        return int(native.site_bodyid[site]), Step(rotation, np.array(native.site_pos[site]))
    return _body(native, path, name, sites), Step(np.eye(3), np.zeros(3))


def _body(native: Any, path: Path, name: str, sites: Sequence[str] = ()) -> int:
    bodies = [native.body(k).name for k in range(native.nbody)]
    if name not in bodies:
        known = f"the model has the bodies {', '.join(filter(None, bodies))}"
        if named := list(filter(None, sites)):
            known += f", and the sites {', '.join(named)}"
        raise ConfigurationError(f"{path}: the model has no point {name!r}", hint=known)
    return bodies.index(name)


def _bodies(native: Any, path: Path, point: str, body: int, frame: str) -> list[int]:
    """Return the bodies after `frame`, up to the body of the point."""
    first = WORLD if frame == "world" else _body(native, path, frame)
    chain = []
    while body not in (first, WORLD):
        chain.append(body)
        body = int(native.body_parentid[body])
    if body != first:
        names = ", ".join(native.body(each).name for each in reversed(chain))
        raise ConfigurationError(
            f"{path}: the frame {frame!r} does not carry {point!r}",
            hint=f'use "world", or a body between the world and the point: {names}',
        )
    return chain[::-1]


def _joints(native: Any, body: int) -> Iterator[Any]:
    first = int(native.body_jntadr[body])
    for k in range(int(native.body_jntnum[body])):
        yield native.joint(first + k)


def _check_kind(joint: Any, path: Path, point: str, frame: str) -> None:
    if int(joint.type[0]) not in (SLIDE, HINGE):
        raise ConfigurationError(
            f"{path}: joint {joint.name!r} between {frame!r} and {point!r} is neither hinge nor "
            "slide, so its position is not among the axes",
            hint="give the pose relative to a body after this joint, such as the pelvis of a "
            "floating base: frame='...'",
        )


def _joint(native: Any, joint: Any, axis: int, step: Step) -> Joint:
    reference = float(native.qpos0[int(joint.qposadr[0])])
    slides = int(joint.type[0]) == SLIDE
    return Joint(axis, slides, reference, step, np.array(joint.axis))


def _rotation(quaternion: Row) -> Matrix:
    """Return the rotation matrix (3, 3) of a unit quaternion (w, x, y, z)."""
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
