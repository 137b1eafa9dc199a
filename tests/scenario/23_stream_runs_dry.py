"""The slower task that writes set-points ahead falls behind: the axes hold, it is said, and the
next rows are followed."""

import numpy as np
import pytest

import catenary as cat
from tests.scenario.cell import Cell


def test_the_axes_hold_and_go_on(cell: Cell) -> None:
    arm = cell.drives()
    with cat.Loop(arm) as loop:
        home = arm.actual.position.copy()
        stream = loop.stream(capacity=200)
        path = home + np.linspace(0.0, 0.2, 400)[:, None]
        assert stream.write(path) == 200
        dry = 0
        for cycle in loop:
            dry += cycle.dry
            if cycle.number == 500:
                held = [servo.position_rad for servo in cell.servos]
                assert held == pytest.approx(path[199], abs=1e-3)
                assert stream.write(path[200:]) == 200
            if cycle.number == 900:
                break
        assert dry == stream.dry > 400
        assert arm.enabled.all()
        assert [servo.position_rad for servo in cell.servos] == pytest.approx(path[-1], abs=1e-3)
    cell.assert_safe()


def test_a_moving_axis_comes_to_rest(cell: Cell) -> None:
    arm = cell.drives(mode="csv")
    with cat.Loop(arm) as loop:
        for cycle in loop:
            arm.target.velocity[:] = 0.0  # somebody holds the load
            if cycle.number == 100:
                break
        stream = loop.stream()
        stream.write(velocity=np.full((100, 2), 2.0))
        for cycle in loop:
            if stream.taken == 100 and not cycle.dry:
                assert all(servo.velocity_rad_s > 1.0 for servo in cell.servos)
            if cycle.number == 600:
                break
        assert all(abs(servo.velocity_rad_s) < 1e-3 for servo in cell.servos)
        assert set(cell.drive_states) == {"OPERATION ENABLED"}
    cell.assert_safe()
