"""A plant in real time: its own thread steps it, frames never wait for it."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import pytest

from catenary.errors import ConfigurationError
from catenary.virtual import Joint, Plant, Segment, Server, Servo
from catenary.wire.datagram import Command
from tests.virtual.main_device import MainDevice
from tests.virtual.plants import PENDULUM, frictionless, model
from tests.virtual.test_server import BRD, answer, wire

PATIENCE = 20.0  # s


def swinging(folder: Path) -> Segment:
    plant = Plant(model(folder, PENDULUM), [Joint("swing", brake=0, start=0.5)])
    return Segment([frictionless()], plant=plant, clock="monotonic")


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(1e-3)


def steps(segment: Segment) -> int:
    assert segment.plant is not None
    return segment.plant.steps


def test_it_swings_while_nobody_sends(tmp_path: Path) -> None:
    segment = swinging(tmp_path)
    servo = segment[0]
    assert isinstance(servo, Servo)
    link = segment.open_link()
    until(lambda: servo.position_rad < 0.4)
    until(lambda: steps(segment) > 400)
    link.close()
    after = steps(segment)
    assert segment.plant is not None
    assert segment.plant.data.time == pytest.approx(after * 250e-6)


def test_a_frame_is_answered_without_a_step(tmp_path: Path) -> None:
    """The plant's thread stands still: nobody else does its work, and frames come back."""
    segment = swinging(tmp_path)
    main = MainDevice(segment)
    until(lambda: steps(segment) > 10)
    assert segment.plant is not None
    segment.plant.stop()
    before = steps(segment)
    for _ in range(50):
        answer = main.exchange(Command.BRD, 0, 0x0130, bytes(2))
        assert answer.working_counter == 1
    assert steps(segment) == before
    segment.plant.start()
    until(lambda: steps(segment) > before)
    main.link.close()


def test_a_served_arm_swings(tmp_path: Path, veth: tuple[str, str]) -> None:
    segment = swinging(tmp_path)
    with Server(segment, veth[1]), wire(veth[0]) as near:
        for _ in range(20):
            near.send(BRD)
            assert answer(near) == 1
        until(lambda: steps(segment) > 400)
    ended = steps(segment)
    assert ended > 400


def test_a_simulation_beyond_all_bounds_stops_and_says_so(tmp_path: Path) -> None:
    segment = Segment(
        [frictionless()], plant=Plant(model(tmp_path, PENDULUM), [Joint("swing", brake=0)])
    )
    servo = segment[0]
    assert isinstance(servo, Servo)
    link = segment.open_link()
    servo.apply_load(3e9)
    with pytest.raises(
        ConfigurationError, match=r"joint 'swing' went beyond all bounds after 0\.000"
    ):
        link.wait_until(link.now() + 10_000_000, False)
