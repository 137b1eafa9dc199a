"""A machine file on the IgH kernel master, which refuses a passive scan."""

from __future__ import annotations

from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import IdentityError
from catenary.igh import Master
from catenary.machine import Machine
from tests.igh.double import Double


def write(folder: Path, sub: cat.SubDevice, product: int) -> Path:
    """Write the machine file of one drive."""
    path = folder / "machine.toml"
    path.write_text(
        f"""
format = "catenary-machine/1"
target = "igh:0"

[[device]]
name = "j1"
position = {sub.position}
identity = {{ vendor = {sub.identity.vendor}, product = {product} }}

[drives.arm]
axes = ["j1"]
counts_per_turn = 1048576
velocity_limit = 1.0
"""
    )
    return path


def test_drives_by_name(double: Double, tmp_path: Path) -> None:
    source = Master(library=double.path, virtual_time=True)
    with cat.MainDevice(source) as main:
        drive = main.scan().drives[0]
        path = write(tmp_path, drive, drive.identity.product)
    with Machine(path, target=source) as machine, machine.loop() as loop:
        next(loop)
        assert machine.drives["arm"].names == ("j1",)


def test_another_device_is_refused(double: Double, tmp_path: Path) -> None:
    source = Master(library=double.path, virtual_time=True)
    with cat.MainDevice(source) as main:
        drive = main.scan().drives[0]
        path = write(tmp_path, drive, drive.identity.product + 1)
    with pytest.raises(IdentityError, match='device "j1"'), Machine(path, target=source):
        pass
