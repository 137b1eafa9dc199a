"""A probe touches a part while the axis moves, at a slow and at a fast cycle. The measured position
is that of the edge, not that of the cycle that reads it. The time of the edge is that of the
drive's clock. A measuring move stops at the part. A lost frame does not lose the edge.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

import catenary as cat
from catenary.errors import MoveError
from catenary.virtual import Coupler, Crystal, ProbeOptions, Servo
from tests.scenario.cell import Cell, cell_of

COUNT = 2 * math.pi / 2**20  # [rad] resolution of the drive
SPEED = 8.0  # [rad/s]: 8 mrad per cycle of 1 ms, 16 mrad per cycle of 2 ms


@contextmanager
def probing_cell(**crystal: float) -> Iterator[Cell]:
    servo = Servo(touch_probe=ProbeOptions(), crystal=Crystal(**crystal))
    with cell_of(Coupler(), servo) as cell:
        yield cell


@pytest.mark.parametrize("period", [2e-3, 1e-3, 0.5e-3])
@pytest.mark.parametrize("part", [0.7, 0.7031, 0.7064])
def test_the_position_is_that_of_the_edge(period: float, part: float) -> None:
    with probing_cell() as cell:
        [servo] = cell.servos
        arm = cell.drives(touch_probe=True)
        with cat.Loop(arm, period=period) as loop:
            servo.place_probe_switch(1, part)
            probe = arm.probe(edge="rising")
            move = arm.move_to(2.0, velocity=SPEED)
            seen = math.nan
            for _ in loop:
                if probe.done:
                    seen = arm.actual.position[0]
                    break
            assert probe.position == pytest.approx(part, abs=COUNT)
            assert seen - part > COUNT  # the axis is already further when the loop reads the edge
            loop.wait(move)


def test_the_time_is_that_of_the_edge_on_drifting_clocks() -> None:
    with probing_cell(ppm=60.0, jitter=0.2e-6) as cell:
        [servo] = cell.servos
        arm = cell.drives(touch_probe=True, dc=True)
        with cat.Loop(arm, period=1e-3) as loop:
            loop.wait_locked()
            servo.place_probe_switch(1, 1.0, 3.0)
            probe = arm.probe(edge="both")
            loop.wait(arm.move_to(4.0, velocity=SPEED))
            rising, falling = sorted(probe.events, key=lambda event: event.position)
            assert rising.time is not None
            assert falling.time is not None
            # 2 rad at a constant velocity
            assert falling.time - rising.time == pytest.approx(2.0 / SPEED, abs=1e-4)
            assert falling.cycle_time > falling.time > rising.time


def test_a_measuring_move_stops_after_the_edge() -> None:
    with probing_cell() as cell:
        [servo] = cell.servos
        arm = cell.drives(touch_probe=True, acceleration_limit=50.0)
        with cat.Loop(arm, period=1e-3) as loop:
            servo.place_probe_switch(1, 0.5)
            probe = arm.probe()
            loop.wait(arm.move_to(2.0, velocity=1.0, until=probe))
            assert probe.position == pytest.approx(0.5, abs=COUNT)
            # cycles until the loop reads the edge and the drive brakes, then v²/2a
            way = 1.0 * 20e-3 + 1.0**2 / (2 * 50.0)
            assert 0.5 < servo.position_rad < 0.5 + way
            servo.place_probe_switch(1, 9.0)
            again = arm.probe()
            with pytest.raises(MoveError, match="without an edge"):
                loop.wait(arm.move_to(1.0, velocity=1.0, until=again))
            assert arm.enabled.all()


def test_lost_frames_do_not_lose_the_edge() -> None:
    with probing_cell() as cell:
        [servo] = cell.servos
        arm = cell.drives(touch_probe=True)
        with cat.Loop(arm, period=1e-3) as loop:
            servo.place_probe_switch(1, 0.6)
            probe = arm.probe()
            move = arm.move_to(2.0, velocity=SPEED)
            for cycle in loop:
                if move.done:
                    break
                if cycle.number % 2 and 0.5 < servo.position_rad < 0.7:
                    cell.spoil("lose", 1)
            assert probe.position == pytest.approx(0.6, abs=COUNT)
