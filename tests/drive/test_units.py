"""Conversion of raw numbers to SI units and back."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.drive.objects import Unit
from catenary.drive.units import AxisUnits, per_axis
from catenary.plan.cycle import Number, NumberKind

RAW = Number(bit_offset=24, bit_length=32, kind=NumberKind.SIGNED)


def si(number: Number, raw: int) -> float:
    return raw * number.scale + number.offset


def test_one_motor_turn_is_one_turn_at_a_joint_without_gear() -> None:
    position = AxisUnits(counts_per_turn=2**20).apply(RAW, Unit.POSITION)
    assert si(position, 2**20) == pytest.approx(2 * math.pi)
    assert (position.bit_offset, position.bit_length) == (24, 32)


def test_gear_direction_and_offset() -> None:
    units = AxisUnits(counts_per_turn=1000, gear_ratio=50, direction=-1, offset=0.5)
    assert si(units.apply(RAW, Unit.POSITION), 50_000) == pytest.approx(0.5 - 2 * math.pi)
    assert si(units.apply(RAW, Unit.DISTANCE), 50_000) == pytest.approx(-2 * math.pi)


def test_velocity_is_in_counts_per_second_by_default() -> None:
    units = AxisUnits(counts_per_turn=1000, gear_ratio=10)
    assert si(units.apply(RAW, Unit.VELOCITY), 10_000) == pytest.approx(2 * math.pi)


def test_velocity_may_have_another_unit() -> None:
    rpm = AxisUnits(counts_per_turn=1000, gear_ratio=10, velocity_unit=2 * math.pi / 60)
    assert si(rpm.apply(RAW, Unit.VELOCITY), 600) == pytest.approx(2 * math.pi)


def test_torque_is_a_thousandth_of_the_rated_torque_times_the_gear() -> None:
    units = AxisUnits(counts_per_turn=1000, gear_ratio=100, direction=-1, rated_torque=0.64)
    assert si(units.apply(RAW, Unit.TORQUE), 1000) == pytest.approx(-64.0)


def test_torque_without_a_rated_torque_is_refused() -> None:
    with pytest.raises(ValueError, match="rated torque"):
        AxisUnits(counts_per_turn=1000).apply(RAW, Unit.TORQUE)


@pytest.mark.parametrize(
    "wrong",
    [
        {"counts_per_turn": 0},
        {"counts_per_turn": math.nan},
        {"gear_ratio": -5},
        {"direction": 0},
        {"offset": math.inf},
        {"velocity_unit": 0},
        {"rated_torque": -1},
    ],
)
def test_invalid_units_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        AxisUnits(**{"counts_per_turn": 1000, **wrong})


@given(
    counts=st.floats(1, 2**32),
    gear=st.floats(0.01, 1000),
    direction=st.sampled_from([1, -1]),
    offset=st.floats(-10, 10),
    raw=st.integers(-(2**31), 2**31 - 1),
)
def test_positions_round_trip(
    counts: float, gear: float, direction: int, offset: float, raw: int
) -> None:
    number = AxisUnits(counts, gear, direction, offset).apply(RAW, Unit.POSITION)
    assert (si(number, raw) - number.offset) / number.scale == pytest.approx(raw, abs=0.5)


def test_per_axis_repeats_one_value_or_takes_one_each() -> None:
    assert per_axis("gear_ratio", 2.0, 3) == (2.0, 2.0, 2.0)
    assert per_axis("gear_ratio", [1.0, 2.0], 2) == (1.0, 2.0)
    with pytest.raises(ValueError, match="gear_ratio has 2 values for 3 axes"):
        per_axis("gear_ratio", [1.0, 2.0], 3)


def test_a_linear_axis_has_metres_per_turn_of_the_gear_output() -> None:
    units = AxisUnits(counts_per_turn=4096, gear_ratio=2, metres_per_turn=0.01, rated_torque=0.5)
    assert si(units.apply(RAW, Unit.POSITION), 2 * 4096) == pytest.approx(0.01)
    assert si(units.apply(RAW, Unit.VELOCITY), 2 * 4096) == pytest.approx(0.01)
    force = 0.5 * 2 * 2 * math.pi / 0.01  # the work is the same: F · 0.01 m = M · 2 turns
    assert si(units.apply(RAW, Unit.TORQUE), 1000) == pytest.approx(force)
    assert units.names.torque == "N"
    assert units.defaults.velocity_limit == 0.1


def test_a_velocity_unit_of_the_motor_is_in_radians_on_a_linear_axis_too() -> None:
    units = AxisUnits(counts_per_turn=1, velocity_unit=2 * math.pi / 60, metres_per_turn=0.06)
    assert si(units.apply(RAW, Unit.VELOCITY), 60) == pytest.approx(0.06)


def test_magnitudes_have_no_direction() -> None:
    units = AxisUnits(counts_per_turn=1000, direction=-1, rated_torque=1.0)
    assert units.apply(RAW, Unit.SPEED).scale > 0 > units.apply(RAW, Unit.VELOCITY).scale
    assert units.apply(RAW, Unit.EFFORT).scale > 0 > units.apply(RAW, Unit.TORQUE).scale
