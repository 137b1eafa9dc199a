"""The machine file of the shared examples, against a virtual segment with its devices."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from catenary.errors import MachineFileError
from catenary.machine import Machine, compare, read_machine
from catenary.target import MainDevice
from tests.machine.example_line import example_segment

ESI = 'esi = "esi/acme_imu.xml"'


@pytest.fixture
def example(shared_data: Path) -> Path:
    """Return the path of the example."""
    return shared_data.parent / "examples" / "machine.toml"


def without_esi(example: Path, folder: Path) -> Path:
    """Write the example without its ESI file, which is not shared. Return its path."""
    text = example.read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if not line.startswith(ESI)]
    assert len(lines) == len(text.splitlines()) - 1
    path = folder / "machine.toml"
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def test_the_example_can_be_read(example: Path) -> None:
    tables = read_machine(example).tables
    assert tables.name == "cell 3"
    assert [device.name for device in tables.device][-3:] == ["wrist_a", "wrist_b", "hand"]


def test_the_segment_agrees_with_the_example(example: Path) -> None:
    with MainDevice(example_segment()) as main:
        found = compare(read_machine(example).tables.device, main.passive_scan())
    assert {each.verdict for each in found} == {"same"}


def test_the_missing_esi_file_of_the_example_is_refused_with_its_line(example: Path) -> None:
    machine = Machine(example, target=example_segment())
    with pytest.raises(
        MachineFileError, match=r"there is no file or folder .*acme_imu\.xml"
    ) as caught:
        machine.open()
    line = example.read_text(encoding="utf-8").splitlines()[(caught.value.line or 0) - 1]
    assert line.startswith(ESI)


def test_the_example_runs(example: Path, tmp_path: Path) -> None:
    with Machine(without_esi(example, tmp_path), target=example_segment()) as machine:
        arm, valves = machine.drives["arm"], machine.process_data["valves"]
        assert arm.names == ("base", "shoulder", "elbow", "roll", "pitch", "yaw")
        assert machine.drives["gripper"].names == ("jaw",)
        with machine.loop() as loop:
            start = arm.actual.position.copy()
            assert start == pytest.approx([0, math.pi / 2, 0, 0, 0, 0], abs=1e-3)
            for cycle in loop:
                arm.target.position[:] = start + 0.1 * math.sin(cycle.time)
                valves["clamp"] = True
                if cycle.time > 0.2:
                    break
            assert machine.process_data["imu"]["rate_z"] == 0.0
            assert machine.segment[1].outputs == 0b001
        assert machine.subs["imu_terminal"].sdo.read(0x8000, 6) == b"\xc8\x00"
