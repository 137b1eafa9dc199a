"""Tables [[copy]] and [[fsoe]] of a machine file."""

from __future__ import annotations

from pathlib import Path

import pytest

from catenary.errors import MachineFileError
from catenary.machine import Machine
from catenary.virtual import DigitalInputs, DigitalOutputs, SafetyLogic, SafetyTerminal, Segment
from catenary.virtual.fsoe import SafetyState

MACHINE = """\
format = "catenary-machine/1"

[loop]
period = "1 ms"

[[device]]
name = "logic"
position = 0
identity = { vendor = 0x43544E59, product = 0x70012 }

[[device]]
name = "curtain"
position = 1
identity = { vendor = 0x43544E59, product = 0x80012 }
required = false

[[device]]
name = "buttons"
position = 2
identity = { vendor = 0x43544E59, product = 0x30004 }

[[device]]
name = "lamps"
position = 3
identity = { vendor = 0x43544E59, product = 0x20004 }
required = false

[[fsoe]]
main = "logic"
main_inputs = "FSoE main frame"
main_outputs = "0x1600"
sub = "curtain"
sub_inputs = 0x1A00
sub_outputs = "bytes 0 to 6"

[[copy]]
source = "buttons"
source_place = "0x6010:01"
destination = "lamps"
destination_place = "Channel 3"
comment = "button 2 is also lamp 3"
"""


def write(folder: Path, text: str = MACHINE) -> Path:
    path = folder / "machine.toml"
    path.write_text(text)
    return path


def test_the_tables_are_copied_while_the_loop_runs(tmp_path: Path) -> None:
    logic, curtain = SafetyLogic(), SafetyTerminal()
    buttons, lamps = DigitalInputs(), DigitalOutputs()
    segment = Segment([logic, curtain, buttons, lamps])
    curtain.safe_inputs = b"\x12\x34"
    with Machine(write(tmp_path), target=segment) as machine, machine.loop() as loop:
        buttons.inputs = 0b0010
        loop.run_for(0.2)
        assert logic.states == [SafetyState.DATA]
        assert curtain.safe_outputs == b"\x12\x34"
        assert lamps.outputs == 0b0100
        assert machine.copies is not None
        [frames] = machine.copies.fsoe_frames
        assert frames.main[-2:] == frames.sub[-2:] == b"\x01\x00"


def test_copies_of_absent_devices_are_left_out(tmp_path: Path) -> None:
    segment = Segment([SafetyLogic(), SafetyTerminal(), DigitalInputs()])
    with Machine(write(tmp_path), target=segment) as machine:
        assert machine.copies is not None
        assert [sub.position for sub in machine.copies.subs] == [0, 1]
        required = machine.copies.pdos(1_000_000)
        assert [required[k].required for k in (0, 1)] == [True, False]
    without = MACHINE[: MACHINE.index("[[fsoe]]")]
    segment = Segment([SafetyLogic(), SafetyTerminal(), DigitalInputs()])
    with Machine(write(tmp_path, without), target=segment) as machine:
        assert machine.copies is None


def test_a_role_may_continue_without_its_device(tmp_path: Path) -> None:
    role = '\n[process_data.logic]\ndevice = "logic"\noutputs = {}\nrequired = false\ndivider = 4\n'
    segment = Segment([SafetyLogic(), SafetyTerminal(), DigitalInputs(), DigitalOutputs()])
    with Machine(write(tmp_path, MACHINE + role), target=segment) as machine:
        units = machine.main.plan(*machine.requests).cycle.sync_units
    found = {unit.devices: (unit.optional, unit.divider) for unit in units}
    assert found[0,] == (True, 4)
    assert found[2,] == (False, 1)


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ('source = "buttons"', 'source = "botons"', 37, 'no device is named "botons"'),
        ('"0x6010:01"', '"Chanel 9"', 36, "has the name 'Chanel 9'"),
        ('"Channel 3"', '"bytes 3 to 1"', 36, "must have at least one byte"),
        ("sub_inputs = 0x1A00", "sub_inputs = 0x1B00", 28, "no PDO 0x1B00 for inputs"),
        ('destination = "lamps"', 'destination = "buttons"', 36, "no object of its outputs"),
    ],
)
def test_errors_name_the_line(tmp_path: Path, old: str, new: str, line: int, message: str) -> None:
    path = write(tmp_path, MACHINE.replace(old, new))
    segment = Segment([SafetyLogic(), SafetyTerminal(), DigitalInputs(), DigitalOutputs()])
    with pytest.raises(MachineFileError, match=message) as caught:
        Machine(path, target=segment).open()
    assert caught.value.line == line
