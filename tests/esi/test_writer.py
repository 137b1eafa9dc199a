"""ESI files that are made from devices: read back, compared with the device, and used."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import catenary as cat
from catenary.bus.eeprom import read_eeprom
from catenary.cli.main import main
from catenary.esi.reader import read_esi
from catenary.esi.writer import esi_text
from catenary.model.device import DeviceDescription, Direction
from catenary.model.process_data import Entry, Pdo
from catenary.virtual import (
    AnalogInputs,
    Coupler,
    Device,
    DigitalInputs,
    DigitalOutputs,
    Segment,
    Servo,
    ServoQuirks,
    from_esi,
)
from catenary.wire.sii import Sii, decode_sii

DEVICES = {
    "coupler": Coupler,
    "outputs": DigitalOutputs,
    "inputs": DigitalInputs,
    "analogue": lambda: AnalogInputs(channels=2, second_pdo="compact"),
    "servo": lambda: Servo(axes=2),
}


def described(device: Device) -> tuple[DeviceDescription, Sii, bytes]:
    with cat.MainDevice(Segment([device])) as main_device:
        sub = main_device.scan()[0]
        image = read_eeprom(main_device, sub.station, 2048)
        return sub.description, decode_sii(image), image


@pytest.mark.parametrize("kind", DEVICES)
def test_the_file_agrees_with_the_device(kind: str, tmp_path: Path) -> None:
    description, sii, image = described(DEVICES[kind]())
    (tmp_path / "made.xml").write_text(esi_text(description, sii, image))
    file = read_esi(tmp_path / "made.xml")
    (made,) = file.devices
    assert (made.warnings, made.unknown, file.warnings) == ((), (), ())
    assert made.key == description.identity[:3]
    assert (made.type, made.name) == (description.order, description.name)
    pdos = {
        Direction.OUTPUT: description.output_pdos,
        Direction.INPUT: description.input_pdos,
    }
    for direction, expected in pdos.items():
        found = made.pdos_of(direction)
        assert [each.index for each in found] == [each.index for each in expected]
        assert [each.sync_manager for each in found] == [each.sync_manager for each in expected]
        for ours, theirs in zip(found, expected, strict=True):
            places = [(e.index, e.subindex if e.index else 0, e.bit_length) for e in ours.entries]
            assert places == [each.place for each in theirs.entries]
    assert [(s.start, s.control, s.use) for s in made.sync_managers] == [
        (each.start, each.control, each.use) for each in description.sync_managers
    ]
    assert made.eeprom is not None
    assert made.eeprom.config_data == image[:14]


def test_clock_modes_are_written(tmp_path: Path) -> None:
    modes = Servo(quirks=ServoQuirks(sync_signal="sync1"))
    description, sii, image = described(modes)
    (tmp_path / "made.xml").write_text(esi_text(description, sii, image))
    (made,) = read_esi(tmp_path / "made.xml").devices
    assert [each.assign_activate for each in made.op_modes] == [
        each.assign_activate for each in description.op_modes
    ]


def test_a_virtual_device_from_the_file_exchanges_the_same_process_data(tmp_path: Path) -> None:
    description, sii, image = described(AnalogInputs(channels=2))
    (tmp_path / "made.xml").write_text(esi_text(description, sii, image))
    twin = from_esi(tmp_path / "made.xml")
    with cat.MainDevice(Segment([twin])) as main_device:
        sub = main_device.scan()[0]
        assert [row.bit_offset for row in sub.pdos] == [
            row.bit_offset for row in cat_rows(description)
        ]
        data = cat.ProcessData(sub)
        with cat.Loop(data, period=1e-3) as loop:
            assert next(loop).ok


def cat_rows(description: DeviceDescription) -> tuple[object, ...]:
    from catenary.bus.pdo_table import PdoTable

    return tuple(PdoTable(description))


def test_unknown_types_and_hostile_names(tmp_path: Path) -> None:
    description, sii, image = described(DigitalOutputs())
    entries = tuple(
        Entry(0x7000, n, bits, "a\x00<b>&\ud800", 0x7FF) for n, bits in enumerate((1, 3, 8, 24, 80))
    )
    pdo = Pdo(0x1600, entries, 0, fixed=True, mandatory=True, name="\x1b[2J")
    odd = replace(description, output_pdos=(pdo,), name="x" * 10 + "\x07")
    (tmp_path / "made.xml").write_text(esi_text(odd, sii, image), encoding="utf-8")
    (made,) = read_esi(tmp_path / "made.xml").devices
    (found,) = made.pdos
    assert (found.fixed, found.mandatory, found.name) == (True, True, "?[2J")
    assert [each.bit_length for each in found.entries] == [1, 3, 8, 24, 80]
    assert found.entries[0].name == "a?<b>&?"


def test_the_command_agrees_with_check(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for position in ("0", "1", "2"):
        assert main(["esi", "make", "virtual", position, "-o", "made.xml"]) == 0
        command = ["check", "virtual", "--against", "made.xml", "--position", position]
        assert main(command) == 0
    out = capsys.readouterr().out
    assert out.count("no difference") == 3


def test_the_command_prints_the_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["esi", "make", "virtual", "2"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("<?xml")
    assert "<Index>#x607A</Index>" in out
    assert main(["esi", "make", "virtual", "2", "--json"]) == 2


def test_an_impossible_file_is_refused_before_the_scan(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["esi", "make", "no-such-interface", "2", "-o", str(tmp_path / "no" / "x.xml")])
    assert caught.value.code == 2
    assert "does not exist" in capsys.readouterr().err
