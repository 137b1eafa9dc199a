"""Segments from TOML: what is read, and how errors name the file and the field."""

from __future__ import annotations

from pathlib import Path

import pytest

from catenary.errors import ConfigurationError
from catenary.virtual import AnalogInputs, Segment, Servo

GOOD = """
[[device]]
kind = "coupler"

[[device]]
kind = "servo"
name = "shoulder"
alias = 10
axes = 2
counts_per_turn = 4096
position_limits = [-1.5, 1.5]

[[device]]
kind = "analog_inputs"
channels = 4
"""


def test_a_segment_is_read(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(GOOD)
    segment = Segment.from_toml(path)
    assert [device.kind for device in segment] == ["coupler", "servo", "analog_inputs"]
    servo, analog = segment[1], segment[2]
    assert isinstance(servo, Servo)
    assert isinstance(analog, AnalogInputs)
    assert (servo.name, servo.alias, servo.axes) == ("shoulder", 10, 2)
    assert (servo.counts_per_turn, servo.position_limits) == (4096, (-1.5, 1.5))
    assert analog.channels == 4


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('[[device]]\nkind = "servo"\naxis = 2', "axis"),
        ('[[device]]\nkind = "motor"', "motor"),
        ('[[device]]\nkind = "servo"\naxes = "two"', r"device\[0\].axes"),
        ('[[device]]\nkind = "servo"\naxes = 9', "1 to 8 axes"),
        ('[[device]]\nkind = "digital_outputs"\nbits = 17', "1 to 16 bits"),
        ('[[device]]\nkind = "servo"\ninertia = -1.0', "inertia"),
        ('[[device]]\nname = "x"', "kind"),
        ("device = []", "at least one"),
        ("[[device", "cell.toml"),
        ("", "device"),
    ],
)
def test_errors_name_the_file_and_the_field(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(text)
    with pytest.raises(ConfigurationError, match=says) as caught:
        Segment.from_toml(path)
    assert "cell.toml" in caught.value.message


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="No such file"):
        Segment.from_toml(tmp_path / "none.toml")
