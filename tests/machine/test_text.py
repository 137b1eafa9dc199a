"""Machine files written from a segment."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from catenary import types
from catenary.cli.init import read_encoders
from catenary.errors import MachineFileError
from catenary.machine import Machine, read_machine
from catenary.machine.channels import make_channels
from catenary.machine.text import FILL_IN, machine_text
from catenary.model.device import Assignment, Entry, Pdo
from catenary.target import MainDevice
from catenary.virtual import (
    AnalogInputs,
    Coupler,
    DigitalInputs,
    DigitalOutputs,
    Segment,
    Servo,
)
from catenary.virtual.devices import Device
from tests.plan.devices import demo


def written(devices: list[Device]) -> str:
    """Return the text for a segment of these devices."""
    with MainDevice(Segment(devices)) as main:
        subs = main.scan()
        encoders = read_encoders(subs)
    return machine_text([sub.description for sub in subs], "eth0", encoders)


def filled_in(text: str) -> str:
    """Return the text with the marked lines completed, as a user does it."""
    marked = f"# {FILL_IN}"
    return "\n".join(
        line.removeprefix("# ") if marked in line else line for line in text.splitlines()
    )


def everything() -> list[Device]:
    """Return one device of each kind, and two that are alike."""
    return [
        Coupler(),
        DigitalOutputs(),
        DigitalOutputs(bits=16),
        DigitalInputs(),
        AnalogInputs(second_pdo="twice"),
        Servo(alias=11),
        Servo(alias=12, axes=2),
        Servo(),
        Servo(alias=11),
        AnalogInputs(channels=4),
    ]


def test_a_file_of_terminals_is_complete(tmp_path: Path) -> None:
    devices = [Coupler(), DigitalOutputs(), DigitalInputs(), AnalogInputs()]
    path = tmp_path / "machine.toml"
    path.write_text(written(devices))
    segment = Segment([Coupler(), DigitalOutputs(), DigitalInputs(), AnalogInputs()])
    with Machine(path, target=segment) as machine, machine.loop() as loop:
        assert list(machine.process_data) == ["cvo004", "cvi004", "cva002"]
        machine.process_data["cvo004"]["channel_2_output"] = True
        for cycle in loop:
            if cycle.number == 10:
                break
        assert segment[1].outputs == 0b10


def test_drives_need_their_marked_lines(tmp_path: Path) -> None:
    path = tmp_path / "machine.toml"
    text = written(everything())
    path.write_text(text)
    with pytest.raises(MachineFileError, match='key "counts_per_turn" is missing'):
        read_machine(path)
    path.write_text(filled_in(text))
    with Machine(path, target=Segment(everything())) as machine:
        assert len(machine.drives["axes"]) == 5
        with machine.loop() as loop:
            next(loop)


def test_the_encoder_of_the_drives_is_proposed() -> None:
    counts = [line for line in written(everything()).splitlines() if "counts_per_turn" in line]
    assert len(counts) == 1
    assert counts[0].startswith("# counts_per_turn = 1048576 ")
    assert FILL_IN in counts[0]


def test_drives_with_different_encoders_get_a_list() -> None:
    text = written([Servo(counts_per_turn=1000), Servo(counts_per_turn=4096)])
    assert "# counts_per_turn = [1000, 4096] " in text


def test_devices_have_alias_or_position_and_their_own_names(tmp_path: Path) -> None:
    devices = tomllib.loads(written(everything()))["device"]
    names = [device["name"] for device in devices]
    assert len(set(names)) == len(names)
    assert names[:2] == ["cvk100", "cvo004"]
    assert [device.get("alias") for device in devices] == [None] * 6 + [12] + [None] * 3
    assert [device.get("position") for device in devices] == [0, 1, 2, 3, 4, 5, None, 7, 8, 9]


def test_text_of_a_device_stays_in_its_comment() -> None:
    """A device may send any characters; a line break would make its name a line of the file."""
    text = written([DigitalOutputs(name='evil\n[loop]\nperiod = "')])
    assert tomllib.loads(text)["loop"] == {"period": "1 ms"}


def test_devices_without_a_name_are_named_by_their_numbers() -> None:
    class Nameless(Coupler):
        def sii_image(self) -> bytes:
            return super().sii_image()[:0x80] + b"\xff\xff" + bytes(0x7E)

    names = [
        device["name"] for device in tomllib.loads(written([Nameless(), Nameless()]))["device"]
    ]
    assert names == ["0x43544e59_0x00010001_1", "0x43544e59_0x00010001_2"]


def test_a_target_with_quotes_is_escaped() -> None:
    assert tomllib.loads(machine_text([], 'a"b\\', {}))["target"] == 'a"b\\'


def test_the_same_name_of_an_input_and_an_output_is_numbered() -> None:
    value = Entry(0x6000, 1, 16, "Value", types.UINT.index)
    device = replace(
        demo()[1],
        outputs=(Assignment(0, (Pdo(0x1600, (value,), 0, name="Set"),)),),
        inputs=(Assignment(1, (Pdo(0x1A00, (value,), 1, name="Read"),)),),
    )
    table = tomllib.loads(machine_text([device], "eth0", {}))["process_data"]
    [found] = table.values()
    assert list(found["outputs"]) == ["set_value"]
    assert list(found["inputs"]) == ["read_value"]


@pytest.mark.parametrize("bits", range(1, 65))
def test_numbers_of_any_length_can_be_read_again(bits: int, tmp_path: Path) -> None:
    entries = (
        Entry(0x6000, 1, bits, "unknown", 0),
        Entry(0x6000, 2, bits, "signed", types.INT.index),
        Entry(0x6000, 3, bits, "text", types.VISIBLE_STRING.index),
    )
    inputs = (Assignment(1, (Pdo(0x1A00, entries, 1),)),)
    path = tmp_path / "machine.toml"
    path.write_text(machine_text([replace(demo()[1], inputs=inputs)], "eth0", {}))
    file = read_machine(path)
    [role] = file.tables.process_data
    given = file.tables.process_data[role].inputs
    assert isinstance(given, dict)
    device = replace(demo()[1], inputs=inputs, input_pdos=inputs[0].pdos)
    made = make_channels(file, ("process_data", role, "inputs"), given, device)
    assert [channel.bit_length for channel in made.values()] == [bits, bits, bits]
