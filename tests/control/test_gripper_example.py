"""examples/gripper: the printed results agree with the model."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "gripper"


@pytest.fixture(scope="module")
def printed() -> dict[str, list[float]]:
    """Return the numbers of the printed lines, by the first word of the line."""
    return run(FOLDER / "gripper.py")


def run(program: Path) -> dict[str, list[float]]:
    pytest.importorskip("numba", reason="laws are compiled by Numba: pip install 'catenary[law]'")
    done = subprocess.run(
        [sys.executable, str(program)],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, list[float]] = {}
    for line in done.stdout.splitlines():
        numbers = [float(number) for number in re.findall(r"-?\d+\.\d+", line)]
        found.setdefault(line.split()[0], []).extend(numbers)
    return found


def test_homing_finds_the_joints_ranges_and_where_the_fingers_meet(printed) -> None:
    assert printed["open"] == pytest.approx([-0.8, -0.8], abs=0.01)
    assert printed["closed"] == pytest.approx([0.6, 0.6], abs=0.01)
    # tips of 8 mm meet where 100 mm · sin(angle) = 40 mm - 8 mm
    assert printed["meeting"] == pytest.approx([0.326, 0.326], abs=0.01)


def test_the_measured_stiffness_is_the_configured_one(printed) -> None:
    first, second = printed["stiffness"][:3], printed["stiffness"][3:]
    assert first == pytest.approx([2.0, 2.0, 2.0], rel=0.03)
    assert second == pytest.approx([4.0, 4.0, 4.0], rel=0.03)


def test_the_observer_compensates_the_friction(printed, tmp_path: Path) -> None:
    """Without the observer, a pushed finger does not return to its goal.

    Dry friction holds the spring at up to 0.01 N·m / 4 N·m/rad.
    """
    text = (FOLDER / "gripper.py").read_text()
    bandwidth = "VISCOUS, 100.0, COULOMB"
    assert bandwidth in text
    program = tmp_path / "gripper.py"
    program.write_text(text.replace(bandwidth, "VISCOUS, 0.0, COULOMB"))
    shutil.copy(FOLDER / "gripper.xml", tmp_path)
    without = run(program)["offset"]
    assert all(1.0 < abs(x) <= 2.5 for x in without)
    assert all(abs(x) < 0.2 for x in printed["offset"])


def test_the_object_is_detected_soon_and_at_its_place(printed) -> None:
    after, *places = printed["felt"]
    assert 0.5 <= after <= 10.0  # [ms]
    assert places == pytest.approx([0.17, 0.17], abs=0.02)  # 100 mm · sin = 40 - 15 - 8 mm


def test_it_is_short() -> None:
    files = [FOLDER / "gripper.py", FOLDER / "gripper.xml"]
    assert sum(len(file.read_text().splitlines()) for file in files) <= 120
