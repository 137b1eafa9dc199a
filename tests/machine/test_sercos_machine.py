"""A machine file with a SERCOS drive as an axis."""

from __future__ import annotations

from pathlib import Path

import pytest

from catenary.machine import Machine
from catenary.virtual import SercosDrive

FILE = """\
format = "catenary-machine/1"
target = "virtual:line.toml"

[[device]]
name = "coupler"
position = 0
identity = { vendor = 0x43544E59, product = 0x10001 }

[[device]]
name = "spindle"
position = 1
identity = { vendor = 0x43544E59, product = 0x80001 }

[drives.arm]
axes = ["spindle"]
mode = "csv"
counts_per_turn = 1048576
velocity_limit = "90 rpm"
"""


def test_a_sercos_drive_is_an_axis_of_a_machine(tmp_path: Path) -> None:
    (tmp_path / "line.toml").write_text(
        '[[device]]\nkind = "coupler"\n[[device]]\nkind = "sercos_drive"\n'
    )
    (tmp_path / "machine.toml").write_text(FILE)
    with Machine(tmp_path / "machine.toml") as machine:
        arm = machine.drives["arm"]
        assert machine.segment is not None
        drive = machine.segment[1]
        assert isinstance(drive, SercosDrive)
        with machine.loop() as loop:
            for cycle in loop:
                arm.target.velocity[:] = 3.0
                if cycle.time > 0.3:
                    break
            assert drive.velocity_rad_s == pytest.approx(3.0, rel=0.02)
