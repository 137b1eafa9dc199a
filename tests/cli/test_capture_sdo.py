"""`catenary capture sdo`: the printed list loads in a machine file, and as Python code."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

import catenary as cat
from catenary.capture import SdoTransfer
from catenary.capture.compared_master import ComparedMaster
from catenary.capture.start_up_list import start_up_list
from catenary.capture.start_up_text import machine_text, python_text
from catenary.cli.main import main
from catenary.machine.device_request import start_up_objects
from catenary.machine.read import read_machine
from catenary.types import OCTET_STRING, UDINT, UINT, USINT
from tests.capture.events import IN_PRE_OP, Steps, device, sdo, timeline, to_op
from tests.capture.recordings import FOLLOWING_ERROR, VENDOR, record

MACHINE = """
format = "catenary-machine/1"
target = "virtual"

[[device]]
name = "j1"
position = 1
identity = { vendor = 0x43544E59, product = 0x50001 }
"""
PDOS = {
    0x1600: [(0x6040, 0, 16), (0x607A, 0, 32), (0x6060, 0, 8)],
    0x1A00: [(0x6041, 0, 16), (0x6064, 0, 32), (0x6061, 0, 8)],
}
EXPECTED = [
    cat.StartUp(0x6067, 0, 100, type=UDINT, before_mapping=True),
    cat.StartUp(0x6060, 0, 8, type=USINT),
    FOLLOWING_ERROR,
    VENDOR,
]


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    record(tmp_path / "a.pcapng", pdos=PDOS)
    return tmp_path / "a.pcapng"


def loaded(text: str, folder: Path) -> list[cat.StartUp]:
    """Return the start-up objects of a machine file that contains a printed list."""
    file = folder / "machine.toml"
    file.write_text(MACHINE + text)
    return start_up_objects(read_machine(file), 0)


def listed(steps: Steps, folder: Path) -> tuple[list[cat.StartUp], str]:
    """Return the objects and the text for a device with these events."""
    master = ComparedMaster(timeline((device(1), steps)))
    text = machine_text(start_up_list(master, master.devices[0]), "a.pcapng")
    return loaded(text, folder), text


def test_the_list_loads_in_a_machine_file(
    capture: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["capture", "sdo", str(capture), "--device", "1", "--format", "machine"]
    assert main(command) == 0
    text = capsys.readouterr().out
    assert loaded(text, tmp_path) == EXPECTED
    assert text.splitlines()[:4] == [
        "# Written to device 1 CVS001 in a.pcapng.",
        "# It also wrote the PDO mapping. For [drives.NAME] or [process_data.NAME]:",
        "#   pdos = [0x1600, 0x1A00]",
        "#   0x1600: 0x6040:00 (16 bits), 0x607A:00 (32 bits), 0x6060:00 (8 bits)",
    ]


def test_the_python_code_has_the_same_objects(
    capture: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["capture", "sdo", str(capture), "--device", "0x1002", "--format", "python"]
    assert main(command) == 0
    names: dict[str, list[cat.StartUp]] = {}
    exec(capsys.readouterr().out, names)
    assert names["start_up"] == EXPECTED


def test_json(capture: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["capture", "sdo", str(capture), "--device", "1", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [each["object"] for each in found["start_up"]] == [each.place for each in EXPECTED]
    assert found["pdos"]["0x1600"] == [[0x6040, 0, 16], [0x607A, 0, 32], [0x6060, 0, 8]]


def test_a_bring_up_with_the_exported_list_writes_the_same(
    capture: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The exported list closes the gap that `capture diff` shows."""
    ours = tmp_path / "ours.pcapng"
    record(ours, pdos=PDOS, start_up=())
    assert main(["capture", "diff", str(capture), str(ours)]) == 1
    main(["capture", "sdo", str(capture), "--device", "1"])
    text = capsys.readouterr().out
    exported = [
        each
        for each in loaded(text[text.index("# Written") :], tmp_path)
        if each.index != 0x6060  # Catenary writes it itself
    ]
    record(ours, pdos=PDOS, start_up=exported)
    assert main(["capture", "diff", str(capture), str(ours)]) == 0


def test_bytes_repeated_objects_and_parameters_that_are_stored(tmp_path: Path) -> None:
    objects, _ = listed(
        to_op(
            sdo(0x2000, 0, b"abc"),
            sdo(0xF000, 0, b"\x01"),
            sdo(0x2001, 0, b"\x07\x00"),
            sdo(0xF000, 0, b"\x02"),
            sdo(0x1010, 1, b"save"),
            sdo(0x2002, 0, b"\x01"),  # a pulse
            sdo(0x2002, 0, b"\x00"),
            sdo(0x2003, 0, b"\x80"),
            sdo(0x2003, 0, b"\x80"),
        ),
        tmp_path,
    )
    assert objects == [
        cat.StartUp(0x2000, 0, b"abc", type=OCTET_STRING),
        cat.StartUp(0xF000, 0, 1, type=USINT, verify=False),  # overwritten later
        cat.StartUp(0x2001, 0, 7, type=UINT),
        cat.StartUp(0xF000, 0, 2, type=USINT),
        cat.StartUp(0x1010, 1, 0x65766173, type=UDINT, verify=False),
        cat.StartUp(0x2002, 0, 1, type=USINT, verify=False),
        cat.StartUp(0x2002, 0, 0, type=USINT),
        cat.StartUp(0x2003, 0, 0x80, type=USINT),
    ]


def test_complete_access(tmp_path: Path) -> None:
    data = bytes.fromhex("02000100")  # not a number, although it has 4 bytes
    steps = to_op((IN_PRE_OP, SdoTransfer(True, 0xF030, 0, data, complete_access=True)))
    expected = [cat.StartUp(0xF030, 0, data, type=OCTET_STRING, complete_access=True)]
    assert listed(steps, tmp_path)[0] == expected
    master = ComparedMaster(timeline((device(1), steps)))
    names: dict[str, list[cat.StartUp]] = {}
    exec(python_text(start_up_list(master, master.devices[0]), "a.pcapng"), names)
    assert [replace(each, type=OCTET_STRING) for each in names["start_up"]] == expected


def test_what_a_list_cannot_contain_is_a_comment(tmp_path: Path) -> None:
    objects, text = listed(
        to_op(
            sdo(0x2000, 0, b"\1", abort=0x06020000),
            sdo(0x2001, 0, b"\1", answered=False),
            sdo(0xF030, 2, b"\1", complete_access=True),
        ),
        tmp_path,
    )
    assert objects == []
    assert "# omitted: 0x2000:00 = 1 aborted 0x06020000: the device did not accept it" in text
    assert "# omitted: 0x2001:00 = 1 not answered: the capture lacks its answer" in text
    assert "# omitted: 0xF030:02 complete = 1: complete access must begin at" in text


def test_a_truncated_capture_is_named(capture: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capture.write_bytes(capture.read_bytes()[:-5])
    assert main(["capture", "sdo", str(capture), "--device", "1"]) == 0
    output = capsys.readouterr()
    assert "the file ends in the middle of a packet" in output.err
    assert "note on" not in output.out


def test_a_device_that_is_not_there(capture: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["capture", "sdo", str(capture), "--device", "7"]) == 1
    assert "no device 7; devices: 0 CVK100, 1 CVS001, 2 CVO008" in capsys.readouterr().err


def test_an_unreadable_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "text.pcapng"
    file.write_bytes(b"text")
    assert main(["capture", "sdo", str(file), "--device", "1"]) == 2
    assert capsys.readouterr().err.startswith("catenary: ")


def test_a_real_capture(
    shared_data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = shared_data / "pcap" / "ecrab_replay-ek1914-el3004-configure.pcapng"
    assert main(["capture", "sdo", str(file), "--device", "1"]) == 0
    text = capsys.readouterr().out
    assert loaded(text, tmp_path) == []
    assert "#   pdos = [0x1A00, 0x1A02, 0x1A04, 0x1A06]" in text
