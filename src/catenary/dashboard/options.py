"""Files and further shares that the server shows in addition to the values of a share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Panels:
    """Files of the 3D view and of the recordings, and further shares.

    `model`: MJCF or URDF file; None: no 3D view. `joints`: joint of the model by axis; empty: see
    `Scene`. `recordings`: folder of MCAP files; None: no recordings. `also`: shares of further
    networks, which the 3D view shows and the stop includes. `base`: share with the pose of the
    base; None: it does not move.
    """

    model: Path | None = None
    joints: Mapping[str, str] = field(default_factory=dict)
    recordings: Path | None = None
    also: tuple[str, ...] = ()
    base: str | None = None
