"""Moves while another thread iterates, and on several networks."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

import catenary as cat
from catenary.drive import Drives
from catenary.errors import MoveError
from catenary.loop import Loop
from catenary.realtime import VirtualClock
from catenary.virtual import Segment, Servo

MOST = 60.0  # [s] of the machine; the segment's time is virtual


@contextmanager
def iterated_by_a_thread(loop: Loop) -> Iterator[None]:
    end = threading.Event()

    def iterate() -> None:
        for _ in loop:
            if end.is_set():
                return

    thread = threading.Thread(target=iterate)
    thread.start()
    try:
        yield
    finally:
        end.set()
        thread.join()


def test_another_thread_iterates() -> None:
    with cat.MainDevice(Segment([Servo()])) as main:
        arm = Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)
        with Loop(arm) as loop, iterated_by_a_thread(loop):
            assert arm.move_to(0.3).wait_done(MOST)
            assert arm.actual.position[0] == pytest.approx(0.3, abs=1e-3)

            async def program() -> bool:
                return await asyncio.to_thread(arm.move_to(0.0).wait_done, MOST)

            assert asyncio.run(program())
            assert arm.actual.position[0] == pytest.approx(0.0, abs=1e-3)


def test_moves_are_requested_and_stopped_from_another_thread() -> None:
    with cat.MainDevice(Segment([Servo()])) as main:
        arm = Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)
        with Loop(arm) as loop, iterated_by_a_thread(loop):
            moves = [arm.move_to(1.0 + 0.1 * k) for k in range(20)]
            moves[-1].stop()
            assert moves[-1].wait_done(MOST)
            assert all(move.done for move in moves)
            assert {move.outcome for move in moves[:-1]} <= {"replaced", "reached"}
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
