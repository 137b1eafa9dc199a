"""Moves while a thread in the background iterates, and on several networks."""

from __future__ import annotations

import pytest

import catenary as cat
from catenary.drive import Drives
from catenary.errors import MoveError
from catenary.loop import Loop
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
