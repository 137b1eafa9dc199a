"""examples/teleoperation: figures of the table, and gains that are refused."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.examples.two_devices import FOLDER, load

pytest.importorskip("numba", reason="laws are compiled by Numba: pip install 'catenary[law]'")
pytest.importorskip("mujoco", reason="the devices move in MuJoCo: pip install 'catenary[sim]'")


def figures_of(folder: Path, only: str) -> list[dict[str, float]]:
    """Run networks in virtual time. Return the figures of their rows."""
    words = ["--headless", "--out", str(folder), "--only", only]
    program = [sys.executable, str(FOLDER / "teleoperation.py")]
    subprocess.run([*program, *words], check=True, timeout=300)
    rows: list[dict[str, float]] = json.loads((folder / "teleoperation.json").read_text())
    return rows


@pytest.mark.parametrize(
    ("name", "delay"), [("0 ms", 0), ("100 ms", 200), ("20 ms, 5", 40), ("5 to 45", 50)]
)
def test_the_contact_is_felt_without_drift_or_energy(
    tmp_path: Path, name: str, delay: float
) -> None:
    row = figures_of(tmp_path, name)[0]
    assert row["bound"] > delay
    assert row["stiffness"] == pytest.approx(2.0, rel=0.03)
    assert row["felt"] == pytest.approx(1.0, abs=0.03)
    assert row["resting"] < 3.0  # [mrad]: dry friction of 2 mN·m at 2 N·m/rad, on both sides
    assert row["drift"] < 2.0  # [mrad]
    assert row["energy"] >= row["tolerance"]
    assert row["losses"] == 0


def test_gains_beyond_the_condition_create_energy_which_the_controller_bounds(
    tmp_path: Path,
) -> None:
    alone, controlled = figures_of(tmp_path, "B of")
    assert alone["energy"] < 1000 * alone["tolerance"]
    assert controlled["energy"] > alone["energy"] / 10


def test_a_link_that_is_off_for_a_second_is_lost_once(tmp_path: Path) -> None:
    [row] = figures_of(tmp_path, "20 ms, off")
    assert row["losses"] == 1
    assert row["resting"] < 3.0


def test_a_damping_that_is_too_small_is_refused_with_a_better_one() -> None:
    device = load("device")
    with pytest.raises(ValueError, match=r"raise the damping to 0\.\d+ N·m·s/rad"):
        device.gains_for(0.2, damping=0.05)
    device.gains_for(0.2)


def test_the_damping_that_the_program_chooses_always_fulfils_the_condition() -> None:
    device = load("device")
    for delay in (0.001, 0.01, 0.1, 0.5):
        assert device.gains_for(delay).longest_delay.min() > delay
