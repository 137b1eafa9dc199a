"""Segments from TOML files. Errors name the file and the field."""

from __future__ import annotations

from pathlib import Path

import pytest

from catenary.errors import ConfigurationError
from catenary.virtual import (
    AnalogInputs,
    Crystal,
    OversamplingTerminal,
    ProbeOptions,
    Servo,
    read_segment,
)

GOOD = """
[[device]]
kind = "coupler"

[[device]]
kind = "servo"
name = "shoulder"
alias = 10
axes = 2
counts_per_turn = 4096
crystal = { ppm = 40.0, jitter = 20e-9 }
clock_bits = 32
sync_missed_limit = 7
touch_probe = { counters = false, keeps_stored = true }
position_limits = [-1.5, 1.5]

[[device]]
kind = "analog_inputs"
channels = 4

[[device]]
kind = "oversampling"
direction = "outputs"
samples = 20
"""


def test_segment_is_read_from_toml(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(GOOD)
    segment = read_segment(path)
    kinds = ["coupler", "servo", "analog_inputs", "oversampling"]
    assert [device.kind for device in segment] == kinds
    servo, analog, terminal = segment[1], segment[2], segment[3]
    assert isinstance(terminal, OversamplingTerminal)
    assert (terminal.direction, terminal.channels, terminal.samples) == ("outputs", 2, 20)
    assert isinstance(servo, Servo)
    assert isinstance(analog, AnalogInputs)
    assert (servo.name, servo.alias, servo.axes) == ("shoulder", 10, 2)
    assert (servo.counts_per_turn, servo.position_limits) == (4096, (-1.5, 1.5))
    assert servo.touch_probe == ProbeOptions(counters=False, keeps_stored=True)
    assert analog.channels == 4
    assert (servo.crystal, analog.crystal) == (Crystal(ppm=40, jitter=20e-9), Crystal())
    assert (servo.clock_bits, analog.clock_bits, servo.sync_missed_limit) == (32, 64, 7)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('[[device]]\nkind = "servo"\naxis = 2', "axis"),
        ('[[device]]\nkind = "motor"', "motor"),
        ('[[device]]\nkind = "servo"\naxes = "two"', r"device\[0\].axes"),
        ('[[device]]\nkind = "servo"\naxes = 9', "axes must be 1 to 8"),
        ('[[device]]\nkind = "digital_outputs"\nbits = 17', "bits must be 1 to 16"),
        ('[[device]]\nkind = "servo"\ninertia = -1.0', "inertia"),
        ('[[device]]\nkind = "servo"\ncrystal = { ppm = 900.0 }', "at most 500 ppm"),
        ('[[device]]\nkind = "coupler"\ncrystal = { error = 1 }', r"device\[0\].crystal"),
        ('[[device]]\nkind = "servo"\nclock_bits = 16', "clock_bits"),
        ('[[device]]\nkind = "digital_inputs"\nclock_bits = 32', "clock_bits"),
        ('[[device]]\nkind = "servo"\nsync_missed_limit = 0', "sync_missed_limit"),
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
        read_segment(path)
    assert "cell.toml" in caught.value.message


def test_missing_file_is_reported(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="No such file"):
        read_segment(tmp_path / "none.toml")


FAULTS = """
ring = true
link_loss_detection = "standard"

[[device]]
kind = "coupler"

[[device]]
kind = "junction"

[[device]]
kind = "servo"
behind = [1, 3]

[[device]]
kind = "servo"
behind = [1, 1]

[[fault]]
kind = "power_cycle"
device = 2
at = 1.5
for = 0.8

[[fault]]
kind = "cut"
between = ["main", 0]
at = 2.0

[[fault]]
kind = "refuse_state"
device = 3
state = "OP"
code = 0x001B
times = 2

[[fault]]
kind = "swap"
device = 3
at = 3.0
with = {kind = "servo", serial = 7}
"""


def test_faults_and_wiring_are_read(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(FAULTS)
    segment = read_segment(path)
    assert segment.ring
    assert [event.fault.kind for event in segment.fault_log] == ["refuse_state"]
    with segment.open_link() as link:
        link.wait_until(4_000_000_000, False)
    events = [(event.time, event.fault.kind, event.what) for event in segment.fault_log[1:]]
    assert events == [
        (1.5, "power_cycle", "begins"),
        (2.0, "cut", "begins"),
        (2.3, "power_cycle", "ends"),
        (3.0, "swap", "begins"),
        (3.0, "swap", "ends"),
    ]
    assert segment[3].serial == 7


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('kind = "explode"', "explode"),
        ('kind = "power_cycle"', "device"),
        ('kind = "power_cycle"\ndevice = 1', r"fault\[0\].*device 1 does not exist"),
        ('kind = "power_cycle"\ndevice = 0\nfor = -1.0', "for must be above 0"),
        ('kind = "power_cycle"\ndevice = 0\nfor_ = 1.0', "for_"),
        ('kind = "cut"\nbetween = [0, 2]', "not neighbours"),
        ('kind = "cut"\nbetween = [0, "you"]', "between"),
        ('kind = "lose_frames"\nn = "two"', r"fault\[0\].n"),
        ('kind = "swap"\ndevice = 0\nwith = {kind = "robot"}', "robot"),
        ('kind = "refuse_state"\ndevice = 0\nstate = "OP"\ncode = 1', "has no application"),
    ],
)
def test_errors_of_faults_name_the_field(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(f'[[device]]\nkind = "coupler"\n\n[[fault]]\n{text}')
    with pytest.raises(ConfigurationError, match=says) as caught:
        read_segment(path)
    assert "cell.toml" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('kind = "servo"\nbehind = [0, 3]', "device 0 has no port 3"),
        ('kind = "servo"\nbehind = [1, 1]', "must be behind one of the devices 0 to 0"),
        ('kind = "junction"\nport_count = 5', "port_count"),
    ],
)
def test_errors_of_wiring_name_the_field(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(f'[[device]]\nkind = "coupler"\n\n[[device]]\n{text}')
    with pytest.raises(ConfigurationError, match=says):
        read_segment(path)
