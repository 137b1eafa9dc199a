"""`sii build`: EEPROM images from ESI files."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from catenary.cli.main import main
from catenary.wire.sii import decode_sii
from catenary.wire.sii_check import objections

ESI = """<?xml version="1.0" encoding="utf-8"?>
<EtherCATInfo>
  <Vendor><Id>#x1234</Id><Name>Example</Name></Vendor>
  <Descriptions>
    <Devices>
      <Device Physics="YY">
        <Type ProductCode="#x10" RevisionNo="#x2">DR10</Type>
        <Name>Antrieb 驱动器</Name>
        <Fmmu>Outputs</Fmmu>
        <Sm StartAddress="#x1200" ControlByte="#x64" Enable="1">Outputs</Sm>
        <RxPdo Sm="0" Fixed="1">
          <Index>#x1600</Index><Name>Outputs</Name>
          <Entry>
            <Index>#x6040</Index><SubIndex>0</SubIndex><BitLen>16</BitLen>
            <Name>Controlword</Name><DataType>UINT</DataType>
          </Entry>
        </RxPdo>
        <Eeprom><ByteSize>{size}</ByteSize><ConfigData>050E03440A00000034120000</ConfigData></Eeprom>
      </Device>
      <Device Physics="YY">
        <Type ProductCode="#x20" RevisionNo="#x1">DR20</Type>
        <Name>Drive 20</Name>
        <Eeprom><ByteSize>2048</ByteSize><ConfigData>050E</ConfigData></Eeprom>
      </Device>
    </Devices>
  </Descriptions>
</EtherCATInfo>
"""


@pytest.fixture
def esi(tmp_path: Path) -> Path:
    path = tmp_path / "drives.xml"
    path.write_text(ESI.format(size=2048), encoding="utf-8")
    return path


def call(line: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    status = main(shlex.split(line))
    printed = capsys.readouterr()
    return status, printed.out, printed.err


def test_the_image_has_the_wanted_numbers(
    esi: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "dr10.bin"
    options = "--device DR10 --serial 0x11 --alias 9"
    status, out, err = call(f"sii build {esi} {options} -o {path}", capsys)
    image = path.read_bytes()
    header = decode_sii(image).header
    assert (status, len(image), objections(image)) == (0, 2048, ())
    assert (header.vendor, header.product, header.revision) == (0x1234, 0x10, 2)
    assert (header.serial, header.station_alias) == (0x11, 9)
    assert "DR10" in out
    assert "of 2048 bytes used" in out
    assert "note: " in err
    assert "drives.xml:6" in err
    assert "Latin-1" in err


def test_the_alias_of_the_file_is_the_default(
    esi: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "dr10.bin"
    call(f"sii build {esi} --device 0x10:2 -o {path}", capsys)
    assert decode_sii(path.read_bytes()).header.station_alias == 0x1234


def test_show_explains_the_built_image(
    esi: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "dr10.bin"
    call(f"sii build {esi} --device DR10 -o {path}", capsys)
    status, out, err = call(f"sii show {path}", capsys)
    assert (status, err) == (0, "")
    for line in (
        "vendor 0x00001234",
        "order 'DR10'",
        "FMMU 0: use 1",
        "RxPDO 0x1600   0x6040:00 16 bits UINT 'Controlword'",
    ):
        assert line in out.splitlines()


def test_several_devices_need_a_choice(
    esi: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "x.bin"
    status, _, err = call(f"sii build {esi} -o {path}", capsys)
    assert status != 0
    assert "DR10 (0x00000010:0x00000002), DR20" in err
    assert not path.exists()


def test_a_small_eeprom_may_leave_names_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    esi, path = tmp_path / "drives.xml", tmp_path / "x.bin"
    esi.write_text(ESI.format(size=242), encoding="utf-8")
    status, _, err = call(f"sii build {esi} --device DR10 -o {path}", capsys)
    assert status != 0
    assert "--pdos unnamed" in err
    assert not path.exists()
    assert call(f"sii build {esi} --device DR10 --pdos unnamed -o {path}", capsys)[0] == 0
    assert len(path.read_bytes()) == 242


def test_a_serial_number_out_of_range_is_refused(
    esi: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = f"sii build {esi} --device DR10 --serial 0x1FFFFFFFF -o {tmp_path}/x.bin"
    status, _, err = call(line, capsys)
    assert status != 0
    assert "serial must be 0 to" in err


def test_a_missing_file_is_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, _, err = call(f"sii build {tmp_path}/none.xml -o {tmp_path}/x.bin", capsys)
    assert status != 0
    assert "none.xml" in err
