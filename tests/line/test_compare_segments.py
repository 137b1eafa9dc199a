"""Clones of virtual segments before and after one change: the change is named, and no other one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

import pytest

import catenary as cat
from catenary.bus.clone import CloneOptions, read_segment
from catenary.line import Line
from catenary.line.change import Change, Comparison, Severity
from catenary.line.compare import compare_lines
from catenary.procedure.cable_traffic import exercise
from catenary.virtual import (
    Coupler,
    Device,
    DigitalOutputs,
    Junction,
    Segment,
    Servo,
    faults,
    from_esi,
)
from catenary.virtual.wiring import Place
from catenary.wire.al import AlState
from tests.esi.esi_file import device, write

Change_: TypeAlias = tuple[int | None, str, str, str, str]
PRE_OP = CloneOptions(pre_op=True)


def read(segment: Segment, options: CloneOptions = PRE_OP) -> Line:
    with cat.MainDevice(segment) as main:
        return read_segment(main, options)


def shown(found: Comparison) -> list[Change]:
    """Return the changes that `catenary check` shows without --all."""
    return [each for each in found.changes if each.severity is not Severity.VARIABLE]


def seen(found: Comparison) -> list[Change_]:
    return [(each.device.new, each.part, each.what, each.old, each.new) for each in shown(found)]


def changes(old: Segment, new: Segment) -> list[Change_]:
    found = compare_lines(read(old), read(new))
    assert not found.unread
    return seen(found)


@pytest.fixture(scope="module")
def first() -> Line:
    """Return the clone of a usual segment, to which the others are compared."""
    return read(usual())


def usual(*, servo: Device | None = None) -> Segment:
    return Segment([Coupler(), servo or Servo(), DigitalOutputs(), Servo(serial=7)])


def test_the_same_segment_again(first: Line) -> None:
    segment = usual()
    for _ in range(2):  # reading changes nothing
        again = compare_lines(first, read(segment))
        assert (again.changes, again.uncompared, again.compared) == ((), (), 4)


def test_a_device_of_another_revision(tmp_path: Path) -> None:
    old, new = (usual(servo=from_esi(write(tmp_path / f"{n}.xml", device(1, n)))) for n in (5, 6))
    assert changes(old, new) == [(1, "revision", "", "0x00000005", "0x00000006")]


def test_a_device_with_another_serial_number(first: Line) -> None:
    [change] = seen(compare_lines(first, read(usual(servo=Servo(serial=12)))))
    assert change == (1, "serial", "", "0", "12")


def test_another_alias(first: Line) -> None:
    [change] = seen(compare_lines(first, read(usual(servo=Servo(alias=12)))))
    assert change == (1, "alias", "", "0", "12")


def test_a_missing_device(first: Line) -> None:
    old = usual()
    old.plug(3)
    lost, change = compare_lines(first, read(old)).changes
    assert (lost.device.new, lost.what, lost.note) == (2, "port 1 lost links", "1 more")
    assert (change.device.old, change.device.new, change.new) == (3, None, "missing")
    assert change.note == "it was behind device 2 (Catenary virtual 4-channel output) port 1"


def test_another_value_of_an_object(first: Line) -> None:
    segment = usual()
    with cat.MainDevice(segment) as main:
        main.scan()[1].sdo.write(0x6065, 0, (777).to_bytes(4, "little"))
    found = compare_lines(first, read(segment))
    assert seen(found) == [(1, "object", "0x6065:00 Following error window", "262144", "777")]
    assert shown(found)[0].severity == "effect"
    assert found.different


def test_another_assignment(first: Line) -> None:
    segment = usual()
    with cat.MainDevice(segment) as main:
        sdo = main.scan()[1].sdo
        assigned = sdo.read(0x1C13, 1)
        sdo.write(0x1C13, 0, b"\0")
    found = compare_lines(first, read(segment))
    [change] = seen(found)
    index = int.from_bytes(assigned, "little")
    assert change == (1, "assignment", "SyncManager 3", f"0x{index:04X}", "-")


def test_another_mapping(first: Line) -> None:
    segment = usual()
    with cat.MainDevice(segment) as main:
        sdo = main.scan()[1].sdo
        pdo = int.from_bytes(sdo.read(0x1C13, 1), "little")
        count = sdo.read(pdo, 0)[0]
        sdo.write(0x1C13, 0, b"\0")
        sdo.write(pdo, 0, bytes((count - 1,)))
        sdo.write(0x1C13, 0, b"\1")
    [change] = shown(compare_lines(first, read(segment)))
    assert (change.part, change.what, change.severity) == ("mapping", f"0x{pdo:04X}", "effect")
    assert change.old.startswith(change.new)
    assert len(change.old.split(", ")) == count


def tree(behind: dict[int, Place]) -> Segment:
    return Segment([Junction(), DigitalOutputs(), Servo(serial=1), Servo(serial=2)], behind=behind)


def test_a_cable_at_another_port() -> None:
    old, new = (tree({1: (0, 3), 2: (0, port), 3: (2, 1)}) for port in (1, 2))
    assert changes(old, new) == [
        (
            *(2, "topology", "cable"),
            *(f"behind device 0 (Catenary virtual junction) port {port}" for port in (1, 2)),
        )
    ]


def test_a_branch_at_another_device() -> None:
    """The device behind the moved one is not a change of its own."""
    old = tree({1: (0, 3), 2: (0, 1), 3: (2, 1)})
    new = tree({1: (0, 3), 2: (1, 1), 3: (2, 1)})
    assert changes(old, new) == [
        (
            *(2, "topology", "cable", "behind device 0 (Catenary virtual junction) port 1"),
            "behind device 1 (Catenary virtual 4-channel output) port 1",
        )
    ]


def test_grown_error_counters_name_the_port(first: Line) -> None:
    segment = usual()
    with cat.MainDevice(segment) as main:
        main.passive_scan()
        segment.inject(faults.corrupt(20, every=4, between=(1, 2)))
        main.converse(exercise(1.0))
    found = compare_lines(first, read(segment))
    assert {each.part for each in found.changes} == {"error counters"}
    assert {each.severity for each in found.changes} == {"fault"}
    named = [(each.device.new, each.what) for each in found.changes]
    assert (2, "port 0 broken frames") in named  # the cable between devices 1 and 2
    assert (3, "port 0 broken frames") not in named
    [change] = [each for each in found.changes if each.what == "port 0 broken frames"]
    assert change.note == f"{int(change.new) - int(change.old)} more"
    assert int(change.new) == 20


def test_a_segment_in_op_is_not_written_to(first: Line) -> None:
    segment = usual()
    with cat.MainDevice(segment) as main:
        subs = main.passive_scan()
        main.request_states(subs, [2], AlState.OP)
    before = segment.core.peek(2, 0x0500, 16)
    found = compare_lines(first, read(segment))
    assert segment.core.peek(2, 0x0500, 16) == before  # the interface of the EEPROM
    assert seen(found) == [(2, "state", "", "INIT", "OP")]
    assert (found.different, found.unread) == (False, True)
    assert [(each.device.new, each.part, each.expected) for each in found.uncompared] == [
        (2, "EEPROM", True)
    ]


@pytest.mark.parametrize("make", [usual, lambda: tree({1: (0, 3), 2: (0, 1), 3: (2, 1)})])
def test_objects_need_pre_op(make: Callable[[], Segment]) -> None:
    segment = make()
    first = read(segment)
    found = compare_lines(first, read(segment, CloneOptions()))
    assert found.changes == ()
    assert found.unread
    assert {each.part for each in found.uncompared} == {"objects"}
