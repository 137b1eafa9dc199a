"""Twins of SIIs in segment files."""

from __future__ import annotations

from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import ConfigurationError
from catenary.virtual import Servo, Twin, read_segment

LINE = """
[[device]]
kind = "coupler"

[[device]]
kind = "sii"
sii = "vendor/drive.bin"
name = "elbow"
{more}
"""


def write(folder: Path, more: str = "") -> Path:
    (folder / "vendor").mkdir()
    (folder / "vendor" / "drive.bin").write_bytes(Servo(serial=4, alias=3).sii_image())
    path = folder / "line.toml"
    path.write_text(LINE.format(more=more))
    return path


def test_the_image_gives_the_numbers(tmp_path: Path) -> None:
    with cat.MainDevice(read_segment(write(tmp_path))) as main:
        sub = main.scan()[1]
        assert (sub.alias, sub.identity.serial) == (3, 4)


def test_the_file_gives_numbers_motor_and_quirks(tmp_path: Path) -> None:
    more = """serial = 7
motor = { counts_per_turn = 4096, max_velocity = 100.0 }
quirks = { bit_12 = "never" }
mailbox_quirks = { counter = "echoed" }
mapping_quirks = { fixed_pdos = "silent" }
crystal = { ppm = 20.0 }
"""
    segment = read_segment(write(tmp_path, more))
    twin = segment["elbow"]
    assert isinstance(twin, Twin)
    assert [motor.counts_per_turn for motor in twin.motors] == [4096]
    assert (twin.quirks.bit_12, twin.mailbox_quirks.counter) == ("never", "echoed")
    assert twin.mapping_quirks.fixed_pdos == "silent"
    assert twin.crystal.ppm == 20.0
    with cat.MainDevice(segment) as main:
        assert main.scan()[1].identity.serial == 7


@pytest.mark.parametrize(
    ("more", "text"),
    [
        ("serial = -1", "serial must be 0"),
        ("motor = { inertia = 0.0 }", "inertia must be positive"),
        ("motor = { inertial = 1.0 }", "inertial"),
        ("modules = []", "modules"),
    ],
)
def test_a_wrong_value_is_refused(tmp_path: Path, more: str, text: str) -> None:
    with pytest.raises(ConfigurationError, match=text):
        read_segment(write(tmp_path, more))


def test_a_missing_image_names_the_place(tmp_path: Path) -> None:
    path = write(tmp_path)
    (tmp_path / "vendor" / "drive.bin").unlink()
    with pytest.raises(ConfigurationError, match=r"device\[1\]: .*drive\.bin: No such file"):
        read_segment(path)
