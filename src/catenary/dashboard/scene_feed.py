"""Poses of the 3D scene from the newest cycles of one or more shares."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from catenary.dashboard.scene import Scene, Values
from catenary.errors import CatenaryError, ConfigurationError
from catenary.share import Reader

ACTUAL, TARGET = "position", "target_position"
BASE = {"position": (3,), "quaternion": (4,)}  # fields of the share of a base, and their shapes


class SceneFeed:
    """Scene of the present runs of loops. The model is read once for each set of runs.

    Args:
        model: MJCF or URDF file.
        joints: joint of the model by axis; empty: see `Scene`.
        moves: True if a share has the pose of the robot's base.
        shares: number of shares with axes. While fewer exist, joints of unknown axes are ignored.
    """

    def __init__(
        self, model: Path, joints: Mapping[str, str], *, moves: bool = False, shares: int = 1
    ) -> None:
        self.problem = ""  # reason for a missing scene
        self._model = model
        self._joints = joints
        self._moves = moves
        self._shares = shares
        self._runs: tuple[str, ...] = ()
        self._reading = threading.Lock()  # requests and poses come from several threads
        self._scene: Scene | None = None

    def scene(self, readers: Sequence[Reader]) -> Scene | None:
        """Return the scene for the axes of shares; None if the model cannot be shown."""
        runs = tuple(each.layout.run for each in readers)
        with self._reading:
            if runs != self._runs:
                axes = [axis for each in readers for axis in each.layout.axes]
                self._read(axes, complete=len(readers) >= self._shares)
                self._runs = runs
            return self._scene

    def _read(self, axes: Sequence[str], *, complete: bool) -> None:
        self._scene, self.problem = None, ""
        joints = {axis: joint for axis, joint in self._joints.items() if complete or axis in axes}
        try:
            check_distinct(axes)
            self._scene = Scene(self._model, axes, joints or None, moves=self._moves)
        except CatenaryError as error:
            self.problem = error.message

    def poses(self, readers: Sequence[Reader], base: Reader | None = None) -> bytes:
        """Return the message with the poses of the newest cycles; b"" without a scene.

        Args:
            readers: readers of the shares, in the order of `scene`. The first sets the time.
            base: reader of the pose of the base; None: the base stays where it is.
        """
        scene = self.scene(readers)
        rows = [each.read() if each.number else None for each in readers]
        first = rows[0]
        if scene is None or first is None or not any(each.layout.axes for each in readers):
            return b""
        actual, target = (
            np.concatenate([values_of(*each, name) for each in zip(readers, rows, strict=True)])
            for name in (ACTUAL, TARGET)
        )
        time = float(first["scheduled_ns"]) * 1e-9
        return scene.poses(time, actual, target, None if base is None else pose_of(base))


def values_of(reader: Reader, row: np.void | None, name: str) -> Values:
    """Return a field with one value for each axis; NaN before the first cycle.

    Args:
        reader: reader of the share.
        row: its newest cycle; None before the first.
        name: name of the field.
    """
    count = len(reader.layout.axes)
    return np.full(count, np.nan) if row is None or not count else np.asarray(row[name], float)


def pose_of(reader: Reader) -> Values | None:
    """Return position [m] and quaternion (w, x, y, z) of a base, (7,).

    None if the share has no such fields, or no valid value yet.
    """
    shapes = {field.name: field.shape for field in reader.layout.fields}
    if any(shapes.get(name) != shape for name, shape in BASE.items()) or not reader.number:
        return None
    row = reader.read()
    pose = np.concatenate([np.asarray(row[name], float) for name in BASE])
    return pose if np.isfinite(pose).all() else None


def check_distinct(axes: Sequence[str]) -> None:
    """Raise ConfigurationError if two axes have the same name."""
    twice = sorted({axis for axis in axes if axes.count(axis) > 1})
    if twice:
        raise ConfigurationError(
            f"two shares have an axis with the same name: {', '.join(twice)}",
            hint="name the axes: cat.Drives(..., names=[...])",
        )
