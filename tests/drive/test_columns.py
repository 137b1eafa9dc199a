"""Columns: additional objects of drives, read and written by name."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import catenary as cat
from catenary import types
from catenary.bus import MainDevice
from catenary.drive import Channel, Drives
from catenary.drive.arguments import named_columns
from catenary.drive.objects import NAMED_COLUMNS
from catenary.errors import ConfigurationError
from catenary.virtual import Coupler, Segment
from tests.force_sensor import TunedServo


@pytest.fixture
def servo() -> TunedServo:
    return TunedServo()


@pytest.fixture
def main(servo: TunedServo) -> Iterator[MainDevice]:
    with MainDevice(Segment([Coupler(), servo])) as main:
        main.scan()
        yield main


def arm_of(main: MainDevice) -> Drives:
    return Drives(
        main.subs.drives,
        counts_per_turn=2**20,
        velocity_limit=1.0,
        columns={
            "torque_offset": NAMED_COLUMNS["torque_offset"],
            "temperature": (0x2020, 0, types.INT, 0.1),
            "lamp": Channel(0x2021, 0, types.UINT, output=True),
        },
    )


def test_columns_are_read_and_written_by_name(main: MainDevice, servo: TunedServo) -> None:
    arm = arm_of(main)
    servo.warm_up(-55)
    with cat.Loop(arm) as loop:
        arm.target["lamp"] = 3
        arm.target["torque_offset"] = 0.01
        for _ in range(4):
            next(loop)
        assert arm.actual["temperature"] == pytest.approx([-5.5])
        assert servo.lamp == 3
        assert arm.target["torque_offset"].tolist() == [0.01]


def test_columns_of_one_direction_are_not_in_the_other(main: MainDevice) -> None:
    arm = arm_of(main)
    with pytest.raises(RuntimeError, match=r"target\['lamp'\] has no values before a Loop"):
        arm.target["lamp"] = 1
    with cat.Loop(arm):
        with pytest.raises(TypeError, match="actual values are read-only"):
            arm.actual["temperature"] = 1.0
        with pytest.raises(KeyError, match="no column 'lamp' in actual"):
            _ = arm.actual["lamp"]


def test_objects_of_the_standard_have_a_direction() -> None:
    columns = named_columns({"offset": (0x60B2, 0, types.INT), "error": (0x60F4, 0, types.DINT)})
    assert columns["offset"].output
    assert not columns["error"].output


def test_columns_by_name_or_with_an_object() -> None:
    columns = named_columns(["following_error", ("heat", (0x2020, 0, types.INT))])
    assert list(columns) == ["following_error", "heat"]
    with pytest.raises(ValueError, match="unknown name 'folowing'; known names are error_code"):
        named_columns(["folowing"])
    with pytest.raises(TypeError, match=r"columns\['heat'\] is .* \(index, subindex, type"):
        named_columns({"heat": (0x2020, 0)})  # type: ignore[dict-item]


@pytest.mark.parametrize(
    ("index", "kind", "what"),
    [
        (0x6040, types.UINT, "controlword"),
        (0x607A, types.DINT, "target_position"),
        (0x60FF, types.DINT, "target_velocity"),
        (0x6071, types.INT, "target_torque"),
        (0x6060, types.SINT, "mode_target"),
    ],
)
def test_an_object_that_the_axis_writes_cannot_be_a_column(
    main: MainDevice, index: int, kind: types.Integer, what: str
) -> None:
    arm = Drives(
        main.subs.drives,
        other_modes=["csv", "cst"],
        counts_per_turn=2**20,
        velocity_limit=1.0,
        torque_limit=1.0,
        columns={"mine": (index, 0, kind)},
    )
    with pytest.raises(ConfigurationError, match=rf"\.mine' would overwrite {what}, which"):
        main.plan(arm)


def test_the_velocity_offset_is_a_column(main: MainDevice) -> None:
    """The core writes 0x60B1 only while it replaces the set-points."""
    arm = Drives(
        main.subs.drives,
        counts_per_turn=2**20,
        velocity_limit=1.0,
        columns={"offset": (0x60B1, 0, types.DINT)},
    )
    with cat.Loop(arm) as loop:
        arm.target["offset"] = 5
        next(loop)
        assert arm.target["offset"].tolist() == [5]
