"""Poses of the 3D scene from the newest cycle of a share."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
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
        self._reading = threading.Lock()  # requests and poses come from several threads
        self._scene: Scene | None = None

    def scene(self, reader: Reader) -> Scene | None:
        """Return the scene for the axes of a share; None if the model cannot be shown."""
        layout = reader.layout
        with self._reading:
            if layout.run != self._run:
                self._read(layout.axes)
                self._run = layout.run
            return self._scene

    def _read(self, axes: Sequence[str]) -> None:
        self._scene, self.problem = None, ""
        try:
            self._scene = Scene(self._model, axes, self._joints or None)
        except CatenaryError as error:
            self.problem = error.message

    def poses(self, reader: Reader) -> bytes:
        """Return the message with the poses of the newest cycle; b"" without a scene."""
        scene = self.scene(reader)
        if scene is None or not reader.layout.axes:
            return b""
        row = reader.read()
        actual, target = (row[name] for name in FIELDS)
        return scene.poses(float(row["scheduled_ns"]) * 1e-9, actual, target)
