"""Devices from ESIs in segment files."""

from __future__ import annotations

from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import ConfigurationError
from catenary.virtual import from_esi, read_segment
from tests.cli.test_sii_build import ESI

LINE = """
[[device]]
kind = "coupler"

[[device]]
kind = "esi"
esi = "vendor/drives.xml"
device = "{device}"
name = "valve"
alias = 9
serial = 4
crystal = {{ ppm = 5.0 }}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "vendor").mkdir()
    (tmp_path / "vendor" / "drives.xml").write_text(ESI.format(size=2048), encoding="utf-8")
    (tmp_path / "line.toml").write_text(LINE.format(device="DR10"))
    return tmp_path


def test_the_path_is_relative_to_the_segment_file(folder: Path) -> None:
    with cat.MainDevice(read_segment(folder / "line.toml")) as main:
        sub = main.scan()[1]
        assert (sub.identity.product, sub.identity.serial, sub.alias) == (0x10, 4, 9)


@pytest.mark.parametrize(
    ("device", "text"),
    [("", "several devices"), ("DR30", "no device for 'DR30'")],
)
def test_a_wrong_device_names_the_place_in_the_file(folder: Path, device: str, text: str) -> None:
    file = folder / "line.toml"
    file.write_text(LINE.format(device=device))
    with pytest.raises(ConfigurationError, match=r"device\[1\]: .*drives\.xml") as caught:
        read_segment(file)
    assert text in caught.value.message
    assert "order code" in caught.value.hint


def test_a_missing_file_names_the_place(folder: Path) -> None:
    (folder / "vendor" / "drives.xml").unlink()
    with pytest.raises(ConfigurationError, match=r"device\[1\]: .*drives\.xml"):
        read_segment(folder / "line.toml")


def test_a_fault_may_swap_in_a_device_from_an_esi(folder: Path) -> None:
    file = folder / "line.toml"
    fault = """
[[fault]]
kind = "swap"
device = 1
at = 0.0
with = { kind = "esi", esi = "vendor/drives.xml", device = "DR20" }
"""
    file.write_text(LINE.format(device="DR10") + fault)
    segment = read_segment(file)
    with cat.MainDevice(segment) as main:
        assert main.scan()[1].identity.product == 0x20


def test_modules_of_another_file_are_found(tmp_path: Path) -> None:
    module = """<EtherCATModule><Vendor><Id>#x1234</Id><Name>Example</Name></Vendor><Modules>
    <Module><Type ModuleIdent="#x5">M5</Type><Name>Input</Name>
    <TxPdo Sm="0" Fixed="1"><Index>#x1A00</Index><Name>In</Name><Entry><Index>#x6000</Index>
    <SubIndex>1</SubIndex><BitLen>8</BitLen><Name>In</Name><DataType>USINT</DataType></Entry>
    </TxPdo></Module></Modules></EtherCATModule>"""
    device = """<EtherCATInfo><InfoReference>modules.xml</InfoReference>
    <Vendor><Id>#x1234</Id><Name>Example</Name></Vendor><Descriptions><Devices>
    <Device Physics="YY"><Type ProductCode="#x30" RevisionNo="1">DR30</Type><Name>Gate</Name>
    <Sm StartAddress="#x1400" ControlByte="#x20" Enable="1">Inputs</Sm>
    <Slots SlotPdoIncrement="1" SlotIndexIncrement="16"><Slot MinInstances="1" MaxInstances="1">
    <Name>Slot</Name><ModuleIdent Default="1">#x5</ModuleIdent></Slot></Slots>
    <Eeprom><ByteSize>2048</ByteSize><ConfigData>800C</ConfigData></Eeprom>
    </Device></Devices></Descriptions></EtherCATInfo>"""
    (tmp_path / "modules.xml").write_text(module)
    (tmp_path / "device.xml").write_text(device)
    [pdo] = from_esi(tmp_path / "device.xml").esi.pdos
    assert pdo.index == 0x1A00
