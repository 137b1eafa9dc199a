"""`catenary capture diff`: mistakes are named first."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from catenary.capture.diff import compare
from catenary.cli.capture_diff_text import _summary
from catenary.cli.main import main
from catenary.virtual import ServoQuirks
from tests.capture.events import device, sdo, timeline, to_op
from tests.capture.recordings import (
    FOLLOWING_ERROR,
    SYNC0,
    SYNC0_AND_1,
    VENDOR,
    WINDOW,
    record,
)


@pytest.fixture
def a(tmp_path: Path) -> Path:
    """Return the bring-up that works."""
    record(tmp_path / "a.pcapng")
    return tmp_path / "a.pcapng"


@pytest.fixture
def b(tmp_path: Path) -> Path:
    return tmp_path / "b.pcapng"


def test_equal_captures(a: Path, b: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record(b)
    assert main(["capture", "diff", str(a), str(b)]) == 0
    head, *lines = capsys.readouterr().out.splitlines()
    assert head.startswith("A a.pcapng  Catenary (source 10:10:10:10:10:10)  3 devices  start-up ")
    assert lines[-1] == "No differences."
    assert "0  CVK100  same (0 register writes, 0 SDO)" in lines
    assert "same (9 register writes, 4 SDO)" in "\n".join(lines)


def test_a_missing_sdo_is_named_first(a: Path, b: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record(b, start_up=(WINDOW, VENDOR))
    assert main(["capture", "diff", str(a), str(b)]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert "1  CVS001 (A 0x1002, B 0x1002)" in lines
    assert any(
        line.split("  ")[-1] == "only in A" and "0x6065:00 = 0x00001388" in line for line in lines
    )
    assert lines[-3:] == [
        "1 only in A.",
        "First difference: 0x6065:00 of device 1, only in A.",
        f"  try: catenary capture sdo {a} --device 1 --format machine",
    ]


def test_a_wrong_assign_activate_is_named_before_the_error(
    tmp_path: Path, b: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A missing SDO comes first in time, but the error code names the clocks."""
    a = tmp_path / "twincat.pcapng"
    quirks = ServoQuirks(sync_signal="sync1")
    record(a, clock=SYNC0_AND_1, quirks=quirks)
    record(b, clock=SYNC0, quirks=quirks, start_up=(WINDOW, VENDOR))
    assert main(["capture", "diff", str(a), str(b)]) == 1
    lines = capsys.readouterr().out.splitlines()
    found = [" ".join(line.split()) for line in lines]
    assert "PRE→SAFE SYNC0 1 ms AssignActivate 0x0700 SYNC0 1 ms 0x0300 differs" in found
    assert any(line.endswith("B stops here") for line in lines)
    assert "First difference before B's error 0x0030: AssignActivate of device 1." in lines


def test_the_order_of_sdos(a: Path, b: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record(b, start_up=(VENDOR, WINDOW, FOLLOWING_ERROR))
    assert main(["capture", "diff", str(a), str(b)]) == 1
    output = capsys.readouterr().out
    assert "1  CVS001  same; order of 2 SDO writes differs" in output
    assert "\n1 order.\n" in output


def test_a_missing_device(a: Path, b: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record(b, outputs=0)
    assert main(["capture", "diff", str(a), str(b)]) == 1
    output = capsys.readouterr().out
    assert "2  CVO008  only in A (A 0x1003)" in output
    assert "First difference: device 2, only in A." in output


def test_json_has_the_same_rows(a: Path, b: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record(b, start_up=(WINDOW, VENDOR))
    assert main(["capture", "diff", str(a), str(b), "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    rows = [row for device in found["devices"] for row in device["rows"]]
    assert [(row["mark"], row["a"], row["b"], row["effect"]) for row in rows] == [
        ("only in A", "0x6065:00 = 0x00001388", None, True)
    ]
    assert rows[0]["packet_a"] > 0
    assert found["first"]["text"] == "0x6065:00 of device 1, only in A"
    assert (found["equal"], found["until"], found["a"]["master"]) == (False, "OP", "Catenary")


@pytest.mark.parametrize("content", [b"text", b"", None])
def test_an_unreadable_file(
    a: Path, b: Path, content: bytes | None, capsys: pytest.CaptureFixture[str]
) -> None:
    if content is not None:
        b.write_bytes(content)
    assert main(["capture", "diff", str(a), str(b)]) == 2
    assert main(["capture", "diff", str(b), str(a), "--json"]) == 2
    output = capsys.readouterr()
    assert output.err.startswith(f"catenary: {b}: ")
    assert output.out == ""


def test_notes_are_not_part_of_the_json(
    a: Path, b: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    b.write_bytes(a.read_bytes()[:-5])
    assert main(["capture", "diff", str(a), str(b), "--json"]) == 0
    output = capsys.readouterr()
    assert json.loads(output.out)["equal"]
    assert output.err.startswith("note on B: the file ends in the middle of a packet")


def test_the_next_command_selects_a_device_without_a_position() -> None:
    """A capture that begins late shows station addresses only."""
    known = replace(device(1), position=None)
    a = timeline((known, to_op(sdo(0x2000, 0, b"\1"))))
    found = compare(a, timeline((known, to_op())))
    assert list(_summary(found, "a b", "b"))[-1] == (
        "  try: catenary capture sdo 'a b' --device 0x1002 --format machine"
    )


def test_real_captures(shared_data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    dc = shared_data / "pcap" / "ecrab_replay-dc.pcapng"
    plain = shared_data / "pcap" / "ecrab_replay-ek1100-el2828-el2889.pcapng"
    assert main(["capture", "diff", str(dc), str(dc)]) == 0
    assert main(["capture", "diff", str(dc), str(plain)]) == 1
    output = capsys.readouterr().out
    assert "1  0x00000002:0x0B0C3052  same (2 register writes, 0 SDO)" in output
    assert "2 only in A." in output
    assert "First difference: AssignActivate of device 0, only in A." in output
