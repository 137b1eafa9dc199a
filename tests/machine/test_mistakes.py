"""Files with common mistakes: each error names file, line and key."""

from __future__ import annotations

from pathlib import Path

import pytest

from catenary.errors import MachineFileError
from catenary.machine import Machine, read_machine
from tests.machine.files import SMALL, write_small


def line_of(text: str, part: str) -> int:
    """Return the line number of a part of a text."""
    return text[: text.index(part)].count("\n") + 1


# Edits of a valid file: old text, new text, key and message of the error. The error names the line
# of the new text, or that of the fifth text if there is one.
MISTAKES: dict[str, tuple[str, ...]] = {
    "unknown key at the top": (
        'target = "',
        'targt = "',
        "targt",
        'unknown key "targt"; did you mean "target"?',
    ),
    "unknown table": ("[loop]", "[lop]", "lop", 'unknown key "lop"; did you mean "loop"?'),
    "unknown key of the loop": ("period =", "perod =", "loop.perod", 'did you mean "period"?'),
    "key of another table": (
        "priority = 80",
        "late_limit = 0.05",
        "loop.late_limit",
        r"late_limit is a key of \[loop.stop\]",
    ),
    "unknown key of a device": (
        "alias = 11",
        "alais = 11",
        "device[3].alais",
        'did you mean "alias"?',
    ),
    "unknown key of drives": (
        "position_min",
        "postion_min",
        "drives.arm.postion_min",
        'did you mean "position_min"?',
    ),
    "unknown key of identity": (
        "product = 0x50002",
        "produkt = 0x50002",
        "device[4].identity.produkt",
        'did you mean "product"?',
    ),
    "number as text": (
        "priority = 80",
        'priority = "high"',
        "loop.priority",
        'expected a whole number, found "high"',
    ),
    "text as number": ('name = "j1"', "name = 1", "device[3].name", "expected text, found 1"),
    "true as number": (
        "counts_per_turn = 1048576\ngear",
        "counts_per_turn = true\ngear",
        "drives.arm.counts_per_turn",
        "expected a number or a list, found true",
    ),
    "list where a table belongs": (
        "[clocks]\n",
        "[[clocks]]\n",
        "clocks",
        "expected a table, found a list",
    ),
    "a table where a list belongs": (
        '[[device]]\nname = "coupler"',
        '[device]\nname = "coupler"',
        None,
        "not TOML",
        'name = "valves"',
    ),
    "number out of range": (
        "priority = 80",
        "priority = 180",
        "loop.priority",
        "expected a whole number <= 99, found 180",
    ),
    "no identity": (
        "identity = { vendor = 0x43544E59, product = 0x20004 }\n",
        "",
        "device[1]",
        'key "identity" is missing',
        'name = "valves"',
    ),
    "no product": (
        ", product = 0x20004",
        "",
        "device[1].identity",
        'key "product" is missing',
        "{ vendor = 0x43544E59 }",
    ),
    "no name": ('name = "j1"\n', "", "device[3]", 'key "name" is missing', "alias = 11"),
    "no counts per turn": (
        "counts_per_turn = 1048576\nvelocity",
        "velocity",
        "drives.gripper",
        'key "counts_per_turn" is missing',
        "[drives.gripper]",
    ),
    "neither alias nor position": (
        "alias = 11\n",
        "",
        "device[3]",
        'device "j1" has neither alias nor position',
        'name = "j1"',
    ),
    "alias and position": (
        "alias = 11",
        "alias = 11\nposition = 3",
        "device[3].position",
        'device "j1" has both alias and position',
        "position = 3",
    ),
    "duplicate name": (
        'name = "wrist"',
        'name = "j1"',
        "device[4].name",
        r'name "j1" is already used by device\[3\], "j1"',
        "alias = 12",
    ),
    "duplicate alias": (
        "alias = 12",
        "alias = 11",
        "device[4].alias",
        r'alias 11 is already used by device\[3\], "j1"',
        "product = 0x50002",
    ),
    "duplicate position": (
        "position = 1",
        "position = 0",
        "device[1].position",
        "position 0 is already used by",
        "product = 0x20004",
    ),
    "alias 0": (
        "alias = 11",
        "alias = 0",
        "device[3].alias",
        "expected a whole number >= 1, found 0",
    ),
    "name with a slash": (
        'name = "valves"',
        'name = "val/ves"',
        "device[1].name",
        'must not contain "/"',
    ),
    "unknown device in axes": (
        '"j1", "wrist/0"',
        '"j2", "wrist/0"',
        "drives.arm.axes[0]",
        'no device is named "j2"; known names are coupler, .* j1, wrist',
    ),
    "slot is not a number": (
        '"wrist/1"]',
        '"wrist/b"]',
        "drives.arm.axes[2]",
        '"wrist/b": the slot after the "/" must be a number from 0 to 7',
    ),
    "slot above 7": ('"wrist/1"]', '"wrist/8"]', "drives.arm.axes[2]", "number from 0 to 7"),
    "axis twice": (
        '"wrist/1"]',
        '"wrist/0"]',
        "drives.arm.axes[2]",
        'axis "wrist/0" is used twice',
    ),
    "axis in two roles": (
        'axes = ["hand"]',
        'axes = ["j1"]',
        "drives.gripper.axes[0]",
        r'axis "j1" is used in \[drives.arm\] too',
    ),
    "no axes": ('axes = ["hand"]', "axes = []", "drives.gripper.axes", "the list of axes is empty"),
    "list too short": (
        "torque_limit = [4, 4, 8]",
        "torque_limit = [4, 4]",
        "drives.arm.torque_limit",
        "2 values for 3 axes",
    ),
    "too many names": (
        '"roll", "pitch"]',
        '"roll", "pitch", "yaw"]',
        "drives.arm.names",
        "4 values for 3 axes",
    ),
    "names twice": (
        '"roll", "pitch"]',
        '"roll", "roll"]',
        "drives.arm.names[2]",
        'two axes are named "roll"',
    ),
    "unit of another dimension": (
        '"180 deg/s"',
        '"180 deg"',
        "drives.arm.velocity_limit[1]",
        "'180 deg' is an angle; expected an angular velocity",
    ),
    "unit misspelt": (
        '"-170 deg"',
        '"-170 degre"',
        "drives.arm.position_min",
        "unknown unit 'degre'; did you mean 'deg'",
    ),
    "text without unit": ('"1 ms"', '"1"', "loop.period", "'1' has no unit; expected a time"),
    "time as an angle": (
        '"250 us"',
        '"250 deg"',
        "drives.arm.clock.shift",
        "'250 deg' is an angle; expected a time",
    ),
    "angle at a linear axis": (
        "velocity_limit = 1.0",
        'metres_per_turn = 0.004\nvelocity_limit = "1 rad/s"',
        "drives.gripper.velocity_limit",
        "expected a velocity .m/s",
        "1 rad/s",
    ),
    "period of 0": ('"1 ms"', '"0 ms"', "loop.period", "period"),
    "negative limit": (
        "torque_limit = [4, 4, 8]",
        "torque_limit = [4, -4, 8]",
        "drives.arm.torque_limit",
        "wrist/0: torque_limit must be positive, not -4",
    ),
    "gear ratio of 0": (
        "gear_ratio = [1, 1, 2]",
        "gear_ratio = [1, 1, 0]",
        "drives.arm.gear_ratio",
        "gear_ratio must be positive",
    ),
    "limits the wrong way round": (
        "velocity_limit = 1.0",
        "velocity_limit = 1.0\nposition_min = 1\nposition_max = 0",
        "drives.gripper.position_min",
        "must be below position_max",
        "position_min = 1",
    ),
    "direction of 2": (
        "velocity_limit = 1.0",
        "velocity_limit = 1.0\ndirection = 2",
        "drives.gripper.direction",
        "2 is not one of 1, -1",
        "direction = 2",
    ),
    "unknown mode": (
        'mode = "csp"',
        'mode = "cps"',
        "drives.arm.mode",
        '"cps" is not one of "csp", "csv", "cst", ',
    ),
    "unknown mode in a list": (
        '["csv"]',
        '["cvs"]',
        "drives.arm.other_modes[0]",
        '"cvs" is not one of',
    ),
    "CSV without a limit": (
        "velocity_limit = 1.0",
        'mode = "csv"',
        "drives.gripper",
        "velocity_limit= .* is required in CSV",
        "[drives.gripper]",
    ),
    "unknown column": (
        '["following_error"]',
        '["folowing_error"]',
        "drives.arm.columns[0]",
        "'folowing_error'; known",
    ),
    "unknown on_loss": (
        "velocity_limit = 1.0",
        'velocity_limit = 1.0\non_loss = "stop"',
        "drives.gripper.on_loss",
        '"stop" is not one of "quick_stop"',
        "on_loss",
    ),
    "object with a letter that is not hexadecimal": (
        '"0x8000:01"',
        '"0x8000:6G"',
        "device[2].start_up[0].object",
        r'"0x8000:6G" is not an object; expected "0xINDEX:SUBINDEX"',
    ),
    "object without 0x": (
        'clamp = "0x7000:01"',
        'clamp = "7000:01"',
        "process_data.valves.outputs.clamp",
        '"7000:01" is not an object',
    ),
    "unknown type": (
        'type = "USINT"',
        'type = "USINTT"',
        "device[2].start_up[0].type",
        '"USINTT" is not a data type; did you mean "USINT"',
    ),
    "value that the type cannot hold": (
        "value = 3,",
        "value = 300,",
        "device[2].start_up[0].value",
        "300 is not in 0 to 255",
    ),
    "type of text for a channel": (
        'type = "INT"',
        'type = "VISIBLE_STRING"',
        "process_data.gauge.inputs.force.type",
        "is not a numeric type",
    ),
    "scale of 0": (
        "scale = 1e-3",
        "scale = 0",
        "process_data.gauge.inputs.force.scale",
        "scale 0.0 must be finite and not 0",
    ),
    "safe name that is not an output": (
        "{ vacuum = true }",
        "{ vacum = true }",
        "process_data.valves.safe.vacum",
        '"vacum" is not an output; did you mean "vacuum"',
    ),
    "unknown device of process data": (
        'device = "valves"',
        'device = "valve"',
        "process_data.valves.device",
        'did you mean "valves"',
    ),
    "divider of 0": (
        "divider = 2",
        "divider = 0",
        "process_data.gauge.divider",
        "expected a whole number >= 1, found 0",
    ),
    "pdos without the name": (
        "divider = 2",
        'pdos = { "0x1A00" = ["forc"] }',
        "process_data.gauge.pdos.0x1A00[0]",
        '"forc" is not an input or output; did you mean "force"',
    ),
    "pdos that are not PDOs": (
        "divider = 2",
        'pdos = { "0x6000" = ["force"] }',
        "process_data.gauge.pdos.0x6000",
        '"0x6000" is not a PDO',
    ),
    "reference that is not there": (
        'reference = "coupler"',
        'reference = "couplr"',
        "clocks.reference",
        'did you mean "coupler"',
    ),
    "op_mode of a device that no role uses": (
        "product = 0x10001 }",
        'product = 0x10001 }\nop_mode = "DC Sync0"',
        "device[0].op_mode",
        r'no drives or process data use "coupler"(?s:.*)\[process_data\.NAME\]',
        "op_mode",
    ),
    "table that is not there": ("[drives.arm]", "[drive.arm]", "drive", 'did you mean "drives"'),
    "drives without a name": (
        "[drives.arm]",
        "[drives]",
        "drives.axes",
        r"expected a table, found a list(?s:.*)name of your choice to the header: \[drives\.NAME\]",
        'axes = ["j1"',
    ),
    "lead that is not there": (
        'lead = "reference"',
        'lead = "master"',
        "clocks.lead",
        '"master" is not one of "reference", "main"',
    ),
    "external clock without a path": (
        'lead = "reference"',
        'lead = "main"\nexternal = "ptp0"',
        "clocks.external",
        "must be a path such as",
        "external",
    ),
    "another format": (
        "catenary-machine/1",
        "catenary-machine/2",
        "format",
        'cannot read the format "catenary-machine/2"',
    ),
    "no format": ('format = "catenary-machine/1"\n', "", None, 'key "format" is missing', "target"),
    "not TOML": ('period = "1 ms"', "period = 1 ms", None, "not TOML"),
    "key twice": (
        'period = "1 ms"',
        'period = "1 ms"\nperiod = 2',
        None,
        "not TOML: .*",
        "period = 2",
    ),
    "quote that is not closed": ('name = "j1"', 'name = "j1', None, "not TOML"),
    "value of text in stop": (
        "priority = 80",
        'stop = { late_limit = "50 mm" }',
        "loop.stop.late_limit",
        "'50 mm' is a length; expected a time",
    ),
    "impossible value in stop": (
        "priority = 80",
        "stop = { late_limit = -1 }",
        "loop.stop.late_limit",
        "late_limit=-1.0 s: must be 0",
    ),
    "impossible value in scheduling": (
        "priority = 80",
        "scheduling = { collect_deadline = 2.0 }",
        "loop.scheduling.collect_deadline",
        "collect_deadline=2.0",
    ),
    "impossible clock": (
        '"250 us"',
        "inf",
        "drives.arm.clock.shift",
        "shift=inf s: must be finite",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_the_error_names_line_and_key(mistake: str, tmp_path: Path) -> None:
    old, new, key, message, *place = MISTAKES[mistake]
    assert SMALL.count(old) >= 1
    text = SMALL.replace(old, new, 1)
    path = write_small(tmp_path, text)
    with pytest.raises(MachineFileError, match=message) as caught:
        read_machine(path)
    error = caught.value
    line = line_of(text, place[0] if place else new)
    assert error.key == key
    assert error.line is not None
    # a missing key has the line of its table, and a table begins a line or two before its keys
    assert line - 2 <= error.line <= line
    assert error.message.startswith(f"{path}:{error.line}: ")


def test_there_are_at_least_30_mistakes() -> None:
    assert len(MISTAKES) >= 30


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(MachineFileError, match=r"nothing\.toml: No such file") as caught:
        read_machine(tmp_path / "nothing.toml")
    assert "catenary init" in caught.value.hint


def test_a_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MachineFileError, match="Is a directory"):
        read_machine(tmp_path)


def test_text_that_is_not_utf_8_names_the_line(tmp_path: Path) -> None:
    path = tmp_path / "machine.toml"
    path.write_bytes(b'format = "catenary-machine/1"\nname = "Pr\xfcfstand"\n')
    with pytest.raises(MachineFileError, match=":2: not UTF-8 text: byte 0xFC"):
        read_machine(path)


def test_a_byte_order_mark_is_skipped(tmp_path: Path) -> None:
    """Windows editors write a byte order mark."""
    path = tmp_path / "machine.toml"
    path.write_bytes(b'\xef\xbb\xbfformat = "catenary-machine/1"\r\n')
    assert read_machine(path).tables.device == []


def test_an_empty_file_misses_its_format(tmp_path: Path) -> None:
    path = tmp_path / "machine.toml"
    path.write_text("")
    with pytest.raises(MachineFileError, match=':1: key "format" is missing'):
        read_machine(path)


def test_deep_nesting_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "machine.toml"
    path.write_text("format = " + "[" * 100_000)
    with pytest.raises(MachineFileError, match="nested too deeply"):
        read_machine(path)


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("et h0", "invalid target 'et h0'"),
        ("virtual:", "invalid target 'virtual:'"),
        ("virtual:nothing.toml", r"nothing\.toml: No such file"),
    ],
)
def test_an_invalid_target_has_its_line(target: str, message: str, tmp_path: Path) -> None:
    path = write_small(tmp_path, SMALL.replace("virtual:line.toml", target))
    with pytest.raises(MachineFileError, match=rf"machine\.toml:2: target: .*{message}"):
        Machine(path)
