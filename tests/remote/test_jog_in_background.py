"""A jog of an axis whose loop runs in the background."""

from __future__ import annotations

import time

import pytest

import catenary as cat
from catenary.share import JogStatus
from tests.remote.programs import program

WAY, END = 0.05, 60.0  # rad, s


def test_an_axis_is_jogged_and_returns_to_the_program() -> None:
    with program() as own, cat.attach(own.name) as reader, reader.lease(for_=3600.0) as lease:
        jog = lease.jog(0, 0.5, distance=WAY)
        end = time.monotonic() + END
        while jog.status is not JogStatus.DONE and time.monotonic() < end:
            if jog.status.over:  # a loaded machine can miss its deadline
                moved = reader.read()["commanded_position"][0]
                jog = lease.jog(0, 0.5, distance=WAY - moved)
            jog.beat()
            time.sleep(0.01)
        assert jog.status is JogStatus.DONE
        wait_until(lambda: bool(own.arm.enabled.all()))
        assert reader.read()["commanded_position"][0] == pytest.approx(WAY, abs=1e-9)
        with own.loop.update():
            pass  # an update without a new target moves nothing
        move = own.arm.move_by(0.01)
        own.loop.wait(move)
        assert own.arm.actual.position[0] == pytest.approx(WAY + 0.01, abs=1e-3)


def test_an_update_during_a_jog_does_not_move_the_axis_afterwards() -> None:
    with program() as own, cat.attach(own.name) as reader, reader.lease(for_=3600.0) as lease:
        jog = lease.jog(0, -0.5)
        wait_until(lambda: bool(own.arm.jogged.any()) or jog.status.over)
        with own.loop.update():
            own.arm.target.position[:] = 0.001
        wait_until(lambda: jog.status.over)  # no heartbeat follows
        wait_until(lambda: bool(own.arm.enabled.all()))
        at = reader.read()["commanded_position"][0]
        number = reader.number
        wait_until(lambda: reader.number > number + 200)
        assert at < 0
        assert reader.read()["commanded_position"][0] == at


def wait_until(condition) -> None:  # type: ignore[no-untyped-def]
    """Wait for a condition that the thread of the loop brings about."""
    end = time.monotonic() + END
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)
