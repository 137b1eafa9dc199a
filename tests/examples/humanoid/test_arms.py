"""Presets of the arms: they reach their poses within the limits, and may follow each other."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("ruckig", reason="motions are made by ruckig: pip install 'catenary[traj]'")

import arms
import body

PERIOD = 2e-3


def references(motion: arms.Arms, most: int = 20_000) -> np.ndarray:
    """Return the positions until the motion ends, (n, 18)."""
    rows = []
    while motion.moving and len(rows) < most:
        rows.append(motion.step().position)
    return np.array(rows)


@pytest.mark.parametrize("preset", arms.NAMES)
def test_a_preset_visits_its_poses_within_the_limits_and_ends_at_rest(preset: str) -> None:
    start = arms.HOME + 0.05
    motion = arms.Arms(start, PERIOD)
    motion.run(preset)
    rows = references(motion)
    for goal in arms.goals(preset):
        assert abs(rows - goal).max(axis=1).min() < 0.01
    assert not motion.moving
    assert motion.reference.velocity == pytest.approx(np.zeros(arms.AXES), abs=1e-6)
    assert (rows >= body.LOW[: arms.AXES]).all()
    assert (rows <= body.HIGH[: arms.AXES]).all()
    assert abs(np.diff(rows, axis=0)).max() <= 1.5 * PERIOD * 1.001
    assert abs(rows[0] - start).max() < 1e-3


def test_every_preset_ends_at_home_so_that_the_balance_knows_its_pose() -> None:
    for preset in arms.NAMES:
        assert arms.goals(preset)[-1] == pytest.approx(arms.HOME)


def test_a_preset_may_begin_during_another_one_without_a_jump() -> None:
    motion = arms.Arms(arms.HOME, PERIOD)
    motion.run("reach")
    first = [motion.step().position for _ in range(300)]
    motion.run("home")
    rows = np.array([*first, *references(motion)])
    assert abs(np.diff(rows, 2, axis=0)).max() <= 4.0 * PERIOD**2 * 1.01
    assert rows[-1] == pytest.approx(arms.HOME)
