"""Conversion of quantities from text."""

from __future__ import annotations

import math

import pytest

from catenary.machine.units import Dimension, to_si


@pytest.mark.parametrize(
    ("text", "dimension", "value"),
    [
        ("170 deg", "position", math.radians(170)),
        ("-170deg", "position", -math.radians(170)),
        ("1 turn", "position", 2 * math.pi),
        ("500 us", "time", 500e-6),
        ("500 µs", "time", 500e-6),
        ("1e-3 s", "time", 1e-3),
        ("90 rpm", "velocity", 3 * math.pi),
        ("90 deg/s", "velocity", math.pi / 2),
        ("90 °/s", "velocity", math.pi / 2),
        ("inf rad/s", "velocity", math.inf),
        ("400 deg/s2", "acceleration", math.radians(400)),
        ("400 deg/s²", "acceleration", math.radians(400)),
        ("400 deg/s^2", "acceleration", math.radians(400)),
        ("20 Nm", "torque", 20.0),
        ("20 N·m", "torque", 20.0),
        (".5 kN*m", "torque", 500.0),
    ],
)
def test_text_with_a_unit_is_converted(text: str, dimension: Dimension, value: float) -> None:
    assert to_si(text, dimension) == pytest.approx(value)


@pytest.mark.parametrize(
    ("text", "dimension", "value"),
    [
        ("50 mm", "position", 0.05),
        ("80 mm/s", "velocity", 0.08),
        ("1 m/s2", "acceleration", 1.0),
        ("0.06 kN", "torque", 60.0),
    ],
)
def test_linear_axes_have_lengths_and_forces(text: str, dimension: Dimension, value: float) -> None:
    assert to_si(text, dimension, linear=True) == pytest.approx(value)


def test_a_number_is_in_si_units() -> None:
    assert to_si(3, "position") == 3.0
    assert to_si(math.inf, "velocity") == math.inf


@pytest.mark.parametrize(
    ("value", "dimension", "message"),
    [
        ("90 deg", "velocity", r"'90 deg' is an angle; expected an angular velocity \(rad/s, "),
        ("50 mm", "position", r"'50 mm' is a length; expected an angle \(rad, mrad, deg, turn\)"),
        ("170 degs", "position", r"unknown unit 'degs'; did you mean 'deg'\? Expected an angle"),
        ("3 furlong", "position", "unknown unit 'furlong'; expected an angle"),
        ("170", "position", "'170' has no unit; expected an angle .* without quotes"),
        ("a lot", "time", "'a lot' is not a number with a unit; expected a time"),
        ("", "time", "'' is not a number with a unit"),
        (math.nan, "time", "nan is not a number"),
    ],
)
def test_an_invalid_quantity_is_refused(
    value: float | str, dimension: Dimension, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        to_si(value, dimension)


def test_a_linear_axis_refuses_angles() -> None:
    with pytest.raises(ValueError, match="'90 deg/s' is an angular velocity; expected a velocity"):
        to_si("90 deg/s", "velocity", linear=True)
