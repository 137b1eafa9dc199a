"""Program 6: everything by name from a machine file."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from catenary.drive import Drives
from catenary.virtual import Segment

RunProgram = Callable[[str, Segment | str], Mapping[str, object]]
HERE = Path(__file__).resolve().parent


def test_machine_file(run_program: RunProgram, tmp_path: Path) -> None:
    for name in ("machine.toml", "line.toml"):
        shutil.copy(HERE / name, tmp_path / name)
    names = run_program("machine_file", "virtual")
    arm, gripper = names["arm"], names["gripper"]
    assert isinstance(arm, Drives)
    assert isinstance(gripper, Drives)
    assert arm.actual.position[:5] == pytest.approx(np.array([0, -0.5, 1.2, 0, 0.6]), abs=1e-3)
    assert gripper.actual.position == pytest.approx([0.020], abs=1e-4)
