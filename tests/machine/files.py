"""Machine files and virtual segments for tests."""

from __future__ import annotations

from pathlib import Path

from catenary.virtual import AnalogInputs, Coupler, DigitalOutputs, Segment, Servo

SMALL = """\
format = "catenary-machine/1"
target = "virtual:line.toml"

[loop]
period = "1 ms"
priority = 80

[clocks]
lead = "reference"
reference = "coupler"

[[device]]
name = "coupler"
position = 0
identity = { vendor = 0x43544E59, product = 0x10001 }

[[device]]
name = "valves"
position = 1
identity = { vendor = 0x43544E59, product = 0x20004 }

[[device]]
name = "gauge"
position = 2
identity = { vendor = 0x43544E59, product = 0x40002 }
start_up = [{ object = "0x8000:01", type = "USINT", value = 3, comment = "filter" }]

[[device]]
name = "j1"
alias = 11
identity = { vendor = 0x43544E59, product = 0x50001 }

[[device]]
name = "wrist"
alias = 12
identity = { vendor = 0x43544E59, product = 0x50002 }
start_up = [{ object = "0x605A:00", value = 6 }]

[[device]]
name = "hand"
alias = 20
identity = { vendor = 0x43544E59, product = 0x50001 }
required = false

[drives.arm]
axes = ["j1", "wrist/0", "wrist/1"]
names = ["base", "roll", "pitch"]
mode = "csp"
other_modes = ["csv"]
counts_per_turn = 1048576
gear_ratio = [1, 1, 2]
offset = ["0 deg", "90 deg", "0 deg"]
position_min = "-170 deg"
velocity_limit = ["90 deg/s", "180 deg/s", "30 rpm"]
acceleration_limit = "400 deg/s2"
torque_limit = [4, 4, 8]
columns = ["following_error"]
clock = { op_mode = "DC Sync0", shift = "250 us" }

[drives.gripper]
axes = ["hand"]
counts_per_turn = 1048576
velocity_limit = 1.0

[process_data.valves]
device = "valves"
outputs = { clamp = "0x7000:01", vacuum = "0x7010:01" }
safe = { vacuum = true }

[process_data.gauge]
device = "gauge"
divider = 2
[process_data.gauge.inputs]
force = { object = "0x6000:11", type = "INT", scale = 1e-3, unit = "N" }
"""

LINE = """\
[[device]]
kind = "coupler"
[[device]]
kind = "digital_outputs"
[[device]]
kind = "analog_inputs"
[[device]]
kind = "servo"
alias = 11
[[device]]
kind = "servo"
alias = 12
axes = 2
[[device]]
kind = "servo"
alias = 20
"""


def write_small(folder: Path, text: str = SMALL) -> Path:
    """Write a machine file and its virtual line. Return the path of the machine file."""
    (folder / "line.toml").write_text(LINE)
    path = folder / "machine.toml"
    path.write_text(text)
    return path


def small_segment(*, hand: bool = True) -> Segment:
    """Return the line of the file as a segment."""
    hands = [Servo(alias=20)] if hand else []
    return Segment(
        [
            Coupler(),
            DigitalOutputs(),
            AnalogInputs(),
            Servo(alias=11),
            Servo(alias=12, axes=2),
            *hands,
        ]
    )
