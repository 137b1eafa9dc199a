"""Files that the server shows in addition to the values of a share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Panels:
    """Files of the 3D view and of the recordings.

    `model`: MJCF or URDF file; None: no 3D view. `joints`: joint of the model by axis; empty: see
    `Scene`. `recordings`: folder of MCAP files; None: no recordings.
    """

    model: Path | None = None
    joints: Mapping[str, str] = field(default_factory=dict)
    recordings: Path | None = None
