"""The program of the README's first lines."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pytest

from catenary.drive import Drives
from catenary.virtual import Segment, Servo

RunProgram = Callable[[str, Segment | str], Mapping[str, object]]


def test_first_motion(run_program: RunProgram) -> None:
    names = run_program("first_motion", Segment([Servo(), Servo(), Servo()]))
    arm = names["arm"]
    assert isinstance(arm, Drives)
    assert arm.actual.position == pytest.approx(np.full(3, 0.1 * np.sin(2.0)), abs=2e-3)
