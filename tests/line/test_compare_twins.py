"""Clone → twin → one fault or change → comparison with the clone: exactly this is named."""

from __future__ import annotations

from pathlib import Path

import pytest

import catenary as cat
from catenary.bus.clone import CloneOptions, read_segment
from catenary.line import Line, read_line
from catenary.line.change import Severity
from catenary.line.compare import compare_lines
from catenary.procedure.cable_traffic import exercise
from catenary.virtual import Coupler, DigitalOutputs, Segment, Servo, faults

PRE_OP = CloneOptions(pre_op=True)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    real = Segment([Coupler(), Servo(serial=7), DigitalOutputs()])
    cat.clone(real, tmp_path / "line", pre_op=True)
    return tmp_path / "line"


def read(segment: Segment) -> Line:
    with cat.MainDevice(segment) as main:
        return read_segment(main, PRE_OP)


def named(old: Path, twin: Segment) -> list[tuple[int | None, str, str]]:
    """Return device, part and name of each difference of a twin from its clone."""
    found = compare_lines(read_line(old), read(twin))
    assert not found.unread
    return [(each.device.new, each.part, each.what) for each in found.changes]


def test_a_twin_is_equal_to_its_clone(folder: Path) -> None:
    assert named(folder, Segment.from_clone(folder)) == []


def test_a_bad_cable_of_a_twin_is_named(folder: Path) -> None:
    twin = Segment.from_clone(folder)
    with cat.MainDevice(twin) as main:
        main.passive_scan()
        twin.inject(faults.corrupt(20, every=4, between=(0, 1)))
        main.converse(exercise(1.0))
    found = named(folder, twin)
    assert {part for _, part, _ in found} == {"error counters"}
    assert (1, "error counters", "port 0 broken frames") in found


def test_a_twin_without_power_is_missing(folder: Path) -> None:
    twin = Segment.from_clone(folder)
    twin[2].power_off()
    found = compare_lines(read_line(folder), read(twin))
    missing = [each for each in found.changes if each.new == "missing"]
    assert [(each.device.old, each.device.new) for each in missing] == [(2, None)]
    assert {(each.device.new, each.what) for each in found.changes if each not in missing} == {
        (1, "port 1 lost links")
    }


def test_a_changed_object_of_a_twin_is_named(folder: Path) -> None:
    twin = Segment.from_clone(folder)
    with cat.MainDevice(twin) as main:
        main.scan()[1].sdo.write(0x6065, 0, b"\x10\x27\x00\x00")
    found = compare_lines(read_line(folder), read(twin))
    effects = [each for each in found.changes if each.severity is Severity.EFFECT]
    [change] = effects
    assert change.device.new == 1
    assert change.what.startswith("0x6065:00")
    assert (change.old, change.new) == ("262144", "10000")
