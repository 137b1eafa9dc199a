"""Drives are enabled at arbitrary positions, with arbitrary values in the target arrays.
They hold their positions. Targets that were written before have no effect.
"""

import numpy as np
import pytest

import catenary as cat
from catenary.virtual import Coupler, Servo
from tests.scenario.cell import Cell, cell_of


def moved(cell: Cell, places: np.ndarray) -> float:
    """Return the largest distance of an axis from its start [rad]."""
    return float(np.max(np.abs([s.position_rad for s in cell.servos] - places)))


def test_entering_holds_every_axis_where_it_stands(cell: Cell) -> None:
    places = np.array([1.25, -40.0])
    for servo, place in zip(cell.servos, places, strict=True):
        servo.move_to(place)
    arm = cell.drives()
    with cat.Loop(arm) as loop:
        assert set(cell.drive_states) == {"OPERATION ENABLED"}
        assert arm.enabled.all()
        assert arm.actual.position == pytest.approx(places, abs=1e-3)
        for cycle in loop:  # without targets
            assert moved(cell, places) < 1e-3
            if cycle.number == 100:
                break
    assert moved(cell, places) < 1e-3


def test_what_was_written_while_disabled_is_ignored(cell: Cell) -> None:
    places = np.array([0.5, -0.5])
    for servo, place in zip(cell.servos, places, strict=True):
        servo.move_to(place)
    arm = cell.drives()
    with cat.Loop(arm, enable=False) as loop:
        for cycle in loop:
            if not arm.enabled.all():
                arm.target.position[:] = 100.0
            if cycle.number == 20:
                assert "OPERATION ENABLED" not in cell.drive_states
                arm.enable()
            assert moved(cell, places) < 1e-3
            if cycle.number == 100:
                break
        assert arm.enabled.all()
        assert arm.target.position == pytest.approx(places, abs=1e-3)


@pytest.mark.parametrize("junk", [np.nan, np.inf, -np.inf, 1e300])
def test_invalid_targets_move_nothing(cell: Cell, junk: float) -> None:
    arm = cell.drives(velocity_limit=1.0)
    with cat.Loop(arm, enable=False) as loop:
        for cycle in loop:
            arm.target.position[:] = junk
            if cycle.number == 10:
                arm.enable()
            if cycle.number == 30:
                break
        assert moved(cell, np.zeros(2)) < 0.05
    cell.assert_safe()


def test_a_position_counter_is_followed_across_its_overflow() -> None:
    with cell_of(Coupler(), Servo(counts_per_turn=2**24)) as cell:
        turn = 2 * np.pi
        cell.servos[0].move_to(127.9 * turn)  # the counter wraps at 128 turns
        arm = cell.drives(counts_per_turn=2**24)
        with cat.Loop(arm) as loop:
            home = arm.actual.position.copy()
            for cycle in loop:
                arm.target.position[:] = home + 4.0 * cycle.time
                if cycle.time > 1.0:
                    break
            assert arm.actual.position[0] == pytest.approx(home[0] + 4.0, abs=0.1)
            assert cell.servos[0].position_rad == pytest.approx(127.9 * turn + 4.0, abs=0.1)


def test_enable_false_does_not_enable_the_drives(cell: Cell) -> None:
    arm = cell.drives()
    with cat.Loop(arm, enable=False) as loop:
        for cycle in loop:
            if cycle.number == 50:
                break
        assert set(cell.drive_states) == {"SWITCH ON DISABLED"}
