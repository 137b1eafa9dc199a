"""The task that streams set-points falls behind. The axes continue, hold and follow the next rows.
An empty stream is an underrun: after the late limit, the axes are stopped.
"""

import numpy as np
import pytest

import catenary as cat
from catenary.plan.stop_reason import StopReason
from tests.scenario.cell import Cell


def test_the_axes_continue_and_follow_the_next_rows(cell: Cell) -> None:
    arm = cell.drives()
    with cat.Loop(arm) as loop:
        home = arm.actual.position.copy()
        stream = loop.stream(capacity=200)
        path = home + np.linspace(0.0, 0.2, 400)[:, None]
        assert stream.write(path) == 200
        dry = 0
        for cycle in loop:
            dry += cycle.dry
            if stream.taken == 400:
                break
            if dry == 30 and not stream.waiting:  # of 50 ms
                held = [servo.position_rad for servo in cell.servos]
                assert held == pytest.approx(path[199], abs=0.01)  # 10 ms further at 0.5 rad/s
                assert stream.write(path[200:]) == 200
        assert dry == stream.dry
        assert 30 <= dry <= 32
        stream.close()
        for cycle in loop:
            if cycle.number == 600:
                break
        assert arm.enabled.all()
        assert [servo.position_rad for servo in cell.servos] == pytest.approx(path[-1], abs=1e-3)
    cell.assert_safe()


def test_a_moving_axis_comes_to_rest_and_is_stopped(cell: Cell) -> None:
    arm = cell.drives(mode="csv")
    with cat.Loop(arm, stop=cat.StopPolicy(on_axis_stopped="event")) as loop:
        for cycle in loop:
            arm.target.velocity[:] = 0.0  # the load is held
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
        assert arm.stopped == (StopReason.UNDERRUN,) * 2
        assert "OPERATION ENABLED" not in cell.drive_states
    cell.assert_safe()
