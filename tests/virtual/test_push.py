"""Pushes on bodies of a plant, compared with formulas."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from catenary.virtual import Segment, Servo
from tests.virtual.plants import GRAVITY, LENGTH, MASS, Time, frictionless, pendulum

RATE = math.sqrt(GRAVITY / LENGTH)  # of small swings [rad/s]
TIP = (0.0, 0.0, -LENGTH)


def velocity(segment: Segment) -> float:
    assert segment.plant is not None
    return float(segment.plant.data.qvel[0])


def test_a_push_accelerates_the_body_while_it_lasts(tmp_path: Path) -> None:
    segment = pendulum(tmp_path, frictionless())
    time, force, duration = Time(segment), 0.1, 0.2
    segment.push("rod", (force, 0.0, 0.0), point=TIP, for_=duration)
    time.pass_by(duration)
    expected = -force / (MASS * LENGTH * RATE) * math.sin(RATE * duration)
    assert velocity(segment) == pytest.approx(expected, rel=0.01)
    assert segment.plant is not None
    time.pass_by(0.001)
    assert not segment.plant.data.xfrc_applied.any()


def test_a_later_push_replaces_an_earlier_one(tmp_path: Path) -> None:
    segment = pendulum(tmp_path, frictionless())
    time = Time(segment)
    segment.push("rod", (1.0, 0.0, 0.0), for_=0.1)
    time.pass_by(0.05)
    segment.push("rod", (0.0, 2.0, 0.0), for_=0.2)
    time.pass_by(0.1)  # the end of the first push has no effect
    assert segment.plant is not None
    assert segment.plant.data.xfrc_applied[1, 1] == 2.0
    assert segment.plant.data.xfrc_applied[1, 0] == 0.0


@pytest.mark.parametrize(
    ("body", "force", "duration", "message"),
    [
        ("arm", (0, 0, 0), 0.1, "has no body 'arm'; its bodies are rod"),
        ("world", (0, 0, 0), 0.1, "has no body"),
        ("rod", (0, 0), 0.1, "three finite numbers"),
        ("rod", (0, 0, math.nan), 0.1, "three finite numbers"),
        ("rod", (0, 0, 0), 0.0, "above 0"),
        ("rod", (0, 0, 0), 11.0, "at most 10 s"),
    ],
)
def test_invalid_pushes(
    tmp_path: Path, body: str, force: tuple[float, ...], duration: float, message: str
) -> None:
    segment = pendulum(tmp_path, frictionless())
    with pytest.raises(ValueError, match=message):
        segment.push(body, force, for_=duration)


def test_a_segment_without_a_plant_cannot_be_pushed() -> None:
    with pytest.raises(ValueError, match="no plant"):
        Segment([Servo()]).push("rod", (0, 0, 0))
