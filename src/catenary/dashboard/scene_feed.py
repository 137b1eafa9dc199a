"""Poses of the 3D scene from the newest cycle of a share."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from catenary.dashboard.scene import Scene
from catenary.errors import CatenaryError
from catenary.share import Reader

FIELDS = ("position", "target_position")


class SceneFeed:
    """Scene of the present run of a loop. The model is read once for each run.

    Args:
        model: MJCF or URDF file.
        joints: joint of the model by axis; empty: see `Scene`.
    """

    def __init__(self, model: Path, joints: Mapping[str, str]) -> None:
        self.problem = ""  # reason for a missing scene
        self._model = model
        self._joints = joints
        self._run = ""
        self._scene: Scene | None = None

    def scene(self, reader: Reader) -> Scene | None:
        """Return the scene for the axes of a share; None if the model cannot be shown."""
        layout = reader.layout
        if layout.run != self._run:
            self._run, self._scene, self.problem = layout.run, None, ""
            try:
                self._scene = Scene(self._model, layout.axes, self._joints or None)
            except CatenaryError as error:
                self.problem = error.message
        return self._scene

    def poses(self, reader: Reader) -> bytes:
        """Return the message with the poses of the newest cycle; b"" without a scene."""
        scene = self.scene(reader)
        if scene is None or not reader.layout.axes:
            return b""
        row = reader.read()
        actual, target = (row[name] for name in FIELDS)
        return scene.poses(float(row["scheduled_ns"]) * 1e-9, actual, target)
