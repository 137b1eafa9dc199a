"""Initial values of the rates in the process data."""

from __future__ import annotations

from typing import Any

import pytest

import catenary as cat
from catenary import types
from catenary.drive import Drives
from catenary.loop import Loop
from catenary.virtual import Segment, Servo

COLUMNS: dict[str, Any] = {"counts_per_turn": 2**20, "velocity_limit": 2.0}


def presets(names: object, **options: Any) -> dict[str, float]:
    """Return what written columns have before the first iteration."""
    with cat.MainDevice(Segment([Servo(rated_torque=2.0)])) as main:
        arm = Drives(main.scan().drives, columns=names, **{**COLUMNS, **options})
        with Loop(arm):
            return {name: arm.target[name].item(0) for name in list(names)}  # type: ignore[call-overload]


def test_rates_are_initialised_with_the_limits() -> None:
    names = ["profile_velocity", "profile_acceleration", "profile_deceleration"]
    found = presets(names, mode="pp", acceleration_limit=4.0)
    assert found == pytest.approx(dict(zip(names, (2.0, 4.0, 4.0), strict=True)))


@pytest.mark.parametrize(
    ("options", "torque"),
    [
        ({"torque_limit": 0.5}, 0.5),
        ({}, 6.0),  # 0x6072 of the drive: three times the rated torque
        ({"torque_limit": 0.5, "direction": -1}, 0.5),
    ],
)
def test_max_torque_is_initialised_with_the_torque_limit(
    options: dict[str, Any], torque: float
) -> None:
    assert presets(["max_torque"], **options) == pytest.approx({"max_torque": torque})


def test_an_object_with_another_type_is_not_initialised() -> None:
    own = {"max_torque": (0x6072, 0, types.UINT)}
    assert presets(own) == {"max_torque": 0}
