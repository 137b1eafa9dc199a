"""Moves that end at the edge of a touch probe: `move_to(..., until=probe)`."""

from __future__ import annotations

from itertools import pairwise

import pytest

from catenary.errors import MoveError
from catenary.virtual import ProbeOptions, Servo
from tests.drive.test_probe import STEP, cycles, opened, probed_servo


@pytest.mark.parametrize("mode", ["csp", "pp"])
def test_a_move_stops_at_the_edge(mode: str) -> None:
    servo = probed_servo()
    with opened(servo, mode=mode, acceleration_limit=50.0) as (arm, loop):
        servo.place_probe_switch(1, 0.4)
        probe = arm.probe()
        move = arm.move_to(1.0, velocity=1.0, until=probe)
        loop.wait(move)
        assert probe.position == pytest.approx(0.4, abs=STEP)
        assert 0.4 < arm.actual.position[0] < 0.6
        cycles(loop, 50)
        assert arm.actual.velocity[0] == pytest.approx(0.0, abs=1e-2)
        loop.wait(arm.move_to(0.0, velocity=1.0))
        assert arm.actual.position[0] == pytest.approx(0.0, abs=1e-2)


def test_a_move_without_an_edge_fails_at_its_goal() -> None:
    with opened(probed_servo()) as (arm, loop):
        probe = arm.probe()
        with pytest.raises(MoveError, match=r"reached its goal without an edge of <Probe 1"):
            loop.wait(arm.move_by(0.1, velocity=1.0, until=probe))
        next(loop)
        assert probe.outcome == "stopped"


def test_an_axis_that_arrives_first_waits_for_the_others() -> None:
    servo = Servo(axes=2, touch_probe=ProbeOptions())
    with opened(servo) as (arm, loop):
        servo.place_probe_switch(1, 0.8, axis=0)
        probe = arm.probe(axis=0)
        loop.wait(arm.move_to([1.0, 0.1], velocity=1.0, until=probe))
        assert probe.position == pytest.approx(0.8, abs=STEP)
        assert arm.actual.position[1] == pytest.approx(0.1, abs=1e-2)
        again = arm.probe(axis=0)
        with pytest.raises(MoveError, match="reached its goal without an edge"):
            loop.wait(arm.move_to([1.0, 0.2], velocity=1.0, until=again))


def test_an_axis_that_moves_decelerates_while_the_probe_is_being_armed() -> None:
    with opened(probed_servo(), acceleration_limit=50.0) as (arm, loop):
        arm.move_to(5.0, velocity=5.0)
        loop.run_for(0.3)
        targets = [arm.target.position[0]]
        probe = arm.probe()
        move = arm.move_to(5.0, velocity=5.0, until=probe)
        while not probe.armed:
            next(loop)
            targets.append(arm.target.position[0])
        cycles(loop, 5)
        steps = [b - a for a, b in pairwise(targets)]
        assert min(steps) > 0.003  # 5 mrad per cycle before, and no jump to standstill
        move.stop()
        loop.wait(move)


def test_a_probe_that_fails_fails_the_move() -> None:
    with opened(probed_servo(one_edge=True)) as (arm, loop):
        move = arm.move_to(1.0, until=arm.probe(edge="both"))
        with pytest.raises(MoveError, match="was not enabled within 1 s"):
            loop.wait(move)
        assert arm.actual.position[0] == pytest.approx(0.0, abs=1e-2)


def test_the_end_of_a_move_stops_its_probe() -> None:
    with opened(probed_servo()) as (arm, loop):
        probe = arm.probe()
        move = arm.move_to(1.0, velocity=1.0, until=probe)
        cycles(loop, 50)
        move.stop()
        loop.wait(move)
        next(loop)
        assert probe.outcome == "stopped"


def test_a_probe_that_cannot_end_a_move_is_refused() -> None:
    with opened(probed_servo()) as (arm, loop):
        probe = arm.probe(continuous=True)
        with pytest.raises(ValueError, match="a continuous probe does not end"):
            arm.move_to(1.0, until=probe)
        probe.stop()
        loop.wait(probe)
        probe = arm.probe()
        probe.stop()
        loop.wait(probe)
        with pytest.raises(ValueError, match="has already ended; arm a new one"):
            arm.move_to(1.0, until=probe)
