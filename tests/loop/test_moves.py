"""Moves while a thread in the background iterates, and on several networks."""

from __future__ import annotations

import time
from itertools import count
from types import SimpleNamespace

import pytest

import catenary as cat
from catenary.drive import Drives
from catenary.errors import MoveError
from catenary.loop import Loop
from catenary.loop.moves import wait_for_move
from catenary.realtime import VirtualClock
from catenary.virtual import Segment, Servo

MOST = 60.0  # [s] of the machine; the segment's time is virtual


def test_moves_are_requested_and_stopped_while_another_thread_steps_them() -> None:
    with cat.MainDevice(Segment([Servo()])) as main:
        arm = Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)
        with Loop(arm) as loop:
            loop.run_in_background()
            moves = [arm.move_to(1.0 + 0.1 * k) for k in range(20)]
            moves[-1].stop()
            loop.wait(moves[-1], timeout=MOST)
            assert moves[-1].outcome in ("stopped", "reached")
            for move in moves[:-1]:  # how many are reached depends on the threads
                assert isinstance(move.error, MoveError) is (move.outcome == "replaced")


def test_an_update_does_not_write_the_targets_of_a_move() -> None:
    with cat.MainDevice(Segment([Servo(), Servo()])) as main:
        arm = Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)
        with Loop(arm) as loop:
            loop.run_in_background()
            move = arm.move_to(5.0, velocity=0.1, axes=0)
            while arm.target.position[0] == 0.0:
                time.sleep(1e-3)
            with loop.update():
                arm.target.position[:] = 0.05
            assert arm.target.position[0] < 0.05  # that of the move, in the committed set, too
            assert arm.target.position[1] == 0.05
            move.stop()
            loop.wait(move, timeout=MOST)


@pytest.mark.parametrize("wrong", [1.0, None])
def test_wait_takes_a_move(wrong: object) -> None:
    with cat.MainDevice(Segment([Servo()])) as main:
        arm = Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)
        with Loop(arm) as loop, pytest.raises(TypeError, match="needs a move"):
            loop.wait(wrong)  # type: ignore[arg-type]


def test_the_timeout_counts_while_the_first_network_stands_still() -> None:
    times = count(0.0, 0.1)
    dead = SimpleNamespace(time=5.0)
    move = SimpleNamespace(
        done=False, patience=2.0, stop=lambda: None, timeout_error=lambda timeout: TimeoutError()
    )
    cycles = (
        SimpleNamespace(time=5.0, networks=(dead, SimpleNamespace(time=5.0 + next(times))))
        for _ in range(100)
    )
    with pytest.raises(TimeoutError):
        wait_for_move(cycles, move, None)  # type: ignore[arg-type]


def test_moves_on_two_networks() -> None:
    clock = VirtualClock()
    first, second = (Segment([Servo()], clock=clock) for _ in range(2))
    with cat.MainDevice(first) as left, cat.MainDevice(second) as right:
        arms = [
            Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)
            for main in (left, right)
        ]
        with Loop(*arms) as loop:
            moves = [arm.move_to(0.2 * k) for k, arm in enumerate(arms, 1)]
            for move in moves:
                loop.wait(move)
            assert [arm.actual.position.item(0) for arm in arms] == pytest.approx(
                [0.2, 0.4], abs=1e-3
            )
