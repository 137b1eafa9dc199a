"""The model for gravity compensation belongs to another arm: too many joints, wrong names or types.
The error lists the joints before a drive is enabled.
A law with a model of another size stops the drives instead of reading out of bounds.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import catenary as cat
from catenary import control
from catenary.errors import ConfigurationError, LawError
from tests.control.arm import THREE
from tests.scenario.cell import cell_of

JOINTS = ["turn", "shoulder", "elbow"]


@cat.law
def float_free(actual, target, memory):
    gravity = control.part(memory, 1)
    control.gravity(control.part(memory, 0), actual.position, gravity)
    for i in range(actual.n):
        target.torque[i] = gravity[i]


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "three.xml"
    path.write_text(THREE)
    return path


@pytest.mark.parametrize(
    ("joints", "message"),
    [
        (JOINTS, r"3 joints \(turn, shoulder, elbow\) for 2 axes"),
        (["turn", "elbov"], r"no joint 'elbov'\n.*turn, shoulder, elbow, ball"),
        (["turn", "ball"], "joint 'ball' is neither hinge nor slide"),
    ],
)
def test_the_model_is_refused_before_a_drive_is_enabled(
    model: Path, joints: list[str], message: str
) -> None:
    with cell_of() as cell:
        arm = cell.drives(mode="cst")
        with pytest.raises(ConfigurationError, match=message):
            control.Dynamics(model, joints=joints, axes=len(arm))
        cell.assert_safe()


def test_a_law_with_a_wrong_model_stops_the_drives(model: Path) -> None:
    pytest.importorskip("numba", reason="laws are compiled by Numba: pip install 'catenary[law]'")
    dynamics = control.Dynamics(model, joints=JOINTS)
    with cell_of() as cell:
        arm = cell.drives(mode="cst")
        with (
            pytest.raises(LawError, match="number of joints of the model differs"),
            cat.Loop(arm, period=1e-3) as loop,
        ):
            loop.run(float_free, control.join(dynamics.memory, [0.0, 0.0]))
        cell.assert_safe()
