"""Modules of a modular device in a machine file."""

from __future__ import annotations

from pathlib import Path

import pytest

from catenary.errors import MachineFileError
from catenary.machine import Machine

SEGMENT = """
[[device]]
kind = "esi"
esi = "{esi}"
modules = ["csp - axis", "csv,csp - axis"]
"""
MACHINE = """
format = "catenary-machine/1"
target = "virtual:line.toml"
esi = "{esi}"

[[device]]
name = "block"
position = 0
identity = {{ vendor = 0x48504D, product = 3 }}
modules = {modules}

[process_data.raw]
device = "block"
"""


def write(folder: Path, shared_data: Path, modules: str) -> Path:
    esi = shared_data / "esi" / "hpm_ECAT_CIA402.xml"
    (folder / "line.toml").write_text(SEGMENT.format(esi=esi))
    (folder / "machine.toml").write_text(MACHINE.format(esi=esi, modules=modules))
    return folder / "machine.toml"


def test_the_modules_of_the_file_are_configured(tmp_path: Path, shared_data: Path) -> None:
    path = write(tmp_path, shared_data, '["csp - axis", "csv,csp - axis"]')
    with Machine(path) as machine:
        assert len(machine.process_data["raw"].names) == 12
        with machine.loop() as loop:
            next(loop)
            modules = loop.plan.devices[0].modules
            assert modules is not None
            assert (modules.source, modules.idents) == ("as requested", (0x219800, 0x119800))


def test_an_unknown_module_is_reported_with_its_line(tmp_path: Path, shared_data: Path) -> None:
    path = write(tmp_path, shared_data, '["csp - axis", "csx - axis"]')
    with pytest.raises(MachineFileError, match=r"machine.toml:10.*unknown module 'csx - axis'"):
        Machine(path).open()
