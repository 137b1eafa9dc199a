"""Comparison of timelines."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import get_args

import hypothesis.strategies as st
import pytest
from hypothesis import given

from catenary.capture import (
    EepromAssigned,
    RegisterWrite,
    StateRefused,
    StateRequest,
    Step,
    SyncManagerWrite,
    Timeline,
    read_timeline,
)
from catenary.capture.contents import Content
from catenary.capture.diff import CaptureComparison, compare
from catenary.capture.difference import Difference, Mark, Topic
from tests.capture.events import (
    IN_PRE_OP,
    INIT,
    OP,
    PRE_OP,
    SAFE_OP,
    TO_OP,
    TO_SAFE_OP,
    Steps,
    device,
    fmmu,
    reached,
    refused,
    sdo,
    sdo_read,
    sync,
    sync_manager,
    timeline,
    to_op,
)


def rows(a: Steps, b: Steps) -> list[Difference]:
    """Return the rows of one device."""
    (found,) = compared(a, b).devices
    return list(found.rows)


def compared(a: Steps, b: Steps) -> CaptureComparison:
    return compare(timeline((device(1), a)), timeline((device(1), b)))


def test_example_9() -> None:
    """The rows, their marks and the named difference of the example in the documentation."""
    twincat = to_op(
        sdo(0x1C12, 0, b"\0"),
        sdo(0x1C12, 1, b"\x01\x16"),
        sdo(0x1C12, 0, b"\1"),
        sync_manager(2, 6, 0x64),
        sync(0x0730),
    )
    ours = to_op(
        sdo(0x1C12, 1, b"\x00\x16"),
        sdo(0x1C12, 0, b"\1"),
        sdo(0x60C2, 1, b"\1"),
        sync_manager(2, 6, 0x24),
        sync(0x0300),
        *refused(OP, 0x001A),
    )
    found = compared(twincat, ours)
    assert [(str(row.step), row.a, row.b, row.remark) for row in found.devices[0].rows] == [
        ("PRE-OP", "0x1C12:00 = 0", "", "only in A: overwritten later"),
        ("PRE-OP", "0x1C12:01 = 0x1601", "0x1C12:01 = 0x1600", "differs"),
        ("PRE-OP", "", "0x60C2:01 = 1", "only in B"),
        (
            "PRE→SAFE",
            "SM2 0x1800 len 6 ctrl 0x64",
            "SM2 0x1800 len 6 ctrl 0x24",
            "watchdog trigger off in B",
        ),
        ("PRE→SAFE", "SYNC0 1 ms  AssignActivate 0x0730", "SYNC0 1 ms  0x0300", "differs"),
        ("SAFE→OP", "OP after 12 ms", "refused 0x001A", "B stops here"),
    ]
    assert found.first is not None
    assert (found.first.text, found.first.side, found.first.error) == (
        "AssignActivate of device 1",
        "B",
        0x001A,
    )
    assert [found.count(mark) for mark in Mark] == [1, 1, 3, 0, 1]


def test_values_that_differ_from_run_to_run_are_not_compared() -> None:
    a = to_op(fmmu(0, 0x10000, 4, 0x1100), sync(0x0300, start_ns=5))
    b = to_op(
        (TO_SAFE_OP, RegisterWrite(0x0928, bytes(4))),  # propagation delay
        (TO_SAFE_OP, RegisterWrite(0x0920, bytes(8))),
        (IN_PRE_OP, EepromAssigned(True)),
        sdo_read(0x1018, 1, bytes(4)),
        fmmu(3, 0, 4, 0x1100),  # another FMMU and another logical address
        sync(0x0300, start_ns=999),
    )
    assert rows(a, b) == []


def test_adjacent_fmmus_map_the_same_area_as_one() -> None:
    two = to_op(fmmu(0, 0, 2, 0x1100), fmmu(1, 9, 2, 0x1102))
    assert rows(two, to_op(fmmu(0, 0, 4, 0x1100))) == []
    (row,) = rows(two, to_op(fmmu(0, 0, 3, 0x1100)))
    assert (row.mark, row.subject, row.effect) == (Mark.DIFFERS, "FMMU length", True)


def test_only_the_last_value_of_a_register_counts() -> None:
    cleared = (TO_SAFE_OP, SyncManagerWrite(2, 0, 0, 0, enabled=False))
    assert rows(to_op(sync_manager(2, 6, 0x64)), to_op(cleared, sync_manager(2, 6, 0x64))) == []
    assert rows(to_op(), to_op(cleared)) == []


@pytest.mark.parametrize(
    ("length", "control", "subject", "effect"),
    [
        (7, 0x64, "SM2 length", True),
        (6, 0x66, "SM2 direction or mode", True),
        (6, 0x24, "SM2 watchdog trigger", True),
        (6, 0x44, "SM2 PDI interrupt", True),
        (6, 0x74, "SM2 control", False),  # interrupt for the master
    ],
)
def test_parts_of_a_sync_manager(length: int, control: int, subject: str, effect: bool) -> None:
    (row,) = rows(to_op(sync_manager(2, 6, 0x64)), to_op(sync_manager(2, length, control)))
    assert (row.subject, row.effect, row.mark) == (subject, effect, Mark.DIFFERS)


def test_cycle_times() -> None:
    (row,) = rows(to_op(sync(0x0300)), to_op(sync(0x0300, 2_000_000)))
    assert (row.subject, row.a, row.b) == (
        "SYNC0 cycle time",
        "SYNC0 1 ms  AssignActivate 0x0300",
        "SYNC0 2 ms  0x0300",
    )
    times = RegisterWrite(0x09A0, (2_000_000).to_bytes(4, "little") + bytes(4))
    assert rows(to_op(sync(0x0300), (TO_SAFE_OP, times)), to_op(sync(0x0300, 2_000_000))) == []


def test_watchdog_registers() -> None:
    reset = (TO_SAFE_OP, RegisterWrite(0x0420, (1000).to_bytes(2, "little")))
    longer = (TO_SAFE_OP, RegisterWrite(0x0420, (5000).to_bytes(2, "little")))
    assert rows(to_op(reset), to_op()) == []
    (row,) = rows(to_op(reset), to_op(longer))
    assert (row.topic, row.effect) == (Topic.WATCHDOG, True)
    (row,) = rows(to_op(longer), to_op())
    assert (row.mark, row.effect) == (Mark.ONLY_A, True)


def test_a_written_value_that_the_other_master_read_has_no_effect() -> None:
    (row,) = rows(to_op(sdo(0x6065, 0, b"\5")), to_op(sdo_read(0x6065, 0, b"\5")))
    assert (row.effect, row.remark) == (False, "only in A: B read this value")
    (row,) = rows(to_op(sdo(0x6065, 0, b"\5")), to_op(sdo_read(0x6065, 0, b"\6")))
    assert (row.effect, row.remark) == (True, "only in A: B read 6")
    (row,) = rows(to_op(sdo(0x6065, 0, b"\5")), to_op())
    assert (row.effect, row.remark) == (True, "only in A")


def test_an_object_that_reads_another_value_than_was_written() -> None:
    command = [sdo(0x2000, 1, b"\5"), sdo_read(0x2000, 1, b"\0")]
    (row,) = rows(to_op(*command), to_op())
    assert (row.effect, row.remark) == (True, "only in A")


def test_complete_access_of_the_mapping_equals_single_writes() -> None:
    complete = bytes.fromhex("0200 0116 0216")
    single = [
        sdo(0x1C12, 0, b"\2"),
        sdo(0x1C12, 1, b"\x01\x16"),
        sdo(0x1C12, 2, b"\x02\x16"),
    ]
    assert rows(to_op(sdo(0x1C12, 0, complete, complete_access=True)), to_op(*single)) == []


def test_a_refused_write() -> None:
    (row,) = rows(to_op(sdo(0x6065, 0, b"\5")), to_op(sdo(0x6065, 0, b"\5", abort=0x06010002)))
    assert (row.mark, row.effect, row.remark) == (
        Mark.DIFFERS,
        True,
        "refused in B: Attempt to write a read-only object",
    )
    assert row.b == "0x6065:00 = 5 aborted 0x06010002"


def test_the_order_of_writes() -> None:
    one, two, three = (sdo(0x2000 + i, 0, b"\1") for i in range(3))
    (row,) = rows(to_op(one, two, three), to_op(two, one, three))
    assert (row.mark, row.effect, row.note) == (Mark.ORDER, False, "2 SDO writes")
    assert (row.a, row.b) == ("0x2000:00, 0x2001:00", "0x2001:00, 0x2000:00")


def test_repeated_writes_of_one_object_are_aligned() -> None:
    password = [sdo(0xF000, 0, bytes((i,))) for i in (1, 2, 3)]
    (row,) = rows(to_op(*password), to_op(password[0], password[2]))
    assert (row.a, row.mark) == ("0xF000:00 = 2", Mark.ONLY_A)


def test_a_write_in_safe_op_instead_of_pre_op() -> None:
    write = sdo(0x6065, 0, b"\5")
    late = (Step(SAFE_OP, SAFE_OP), write[1])
    (row,) = rows(to_op(write), to_op(late))
    assert row.note == "not before SAFE-OP in B"


def test_a_device_that_leaves_op_by_itself() -> None:
    request = (TO_OP, StateRequest(OP))
    fall = (Step(OP, SAFE_OP), StateRefused(SAFE_OP, OP, 0x001B, OP))
    found = compared(
        to_op(sync_manager(2, 6, 0x64), sync(0x0300)),
        [*to_op(sync_manager(2, 6, 0x24), sync(0x0700), request, reached(OP)), fall],
    )
    assert found.devices[0].rows[-1].b == "OP after 12 ms, then left OP by itself, 0x001B"
    assert found.first is not None
    assert (found.first.row.subject, found.first.error) == ("SM2 watchdog trigger", 0x001B)


def test_steps_after_the_stop_of_b_are_not_compared() -> None:
    late = (Step(SAFE_OP, SAFE_OP), sdo(0x6065, 0, b"\5")[1])
    (row,) = rows(to_op(late), [reached(PRE_OP), *refused(SAFE_OP, 0x001D)])
    assert (row.mark, row.b) == (Mark.RESULT, "refused 0x001D")


def test_the_attempt_that_reached_most_is_compared() -> None:
    """TwinCAT scans devices, returns them to INIT and starts them again."""
    again = (Step(PRE_OP, INIT), StateRequest(INIT))
    scan = [reached(PRE_OP), sdo(0x2000, 0, b"\1"), again]
    assert rows([*scan, *to_op(sdo(0x2001, 0, b"\2"))], to_op(sdo(0x2001, 0, b"\2"))) == []


def test_writes_after_the_master_gave_up_do_not_count() -> None:
    """B waits for OP in vain, returns to PRE-OP and turns the SyncManager off."""
    configured = [reached(PRE_OP), sync_manager(2, 6, 0x64), reached(SAFE_OP)]
    request = (TO_OP, StateRequest(OP))
    off = (TO_SAFE_OP, SyncManagerWrite(2, 0, 0, 0, enabled=False))
    down = (Step(SAFE_OP, PRE_OP), StateRequest(PRE_OP))
    (row,) = rows([*configured, request, reached(OP)], [*configured, request, down, off])
    assert (row.b, row.remark) == ("OP requested, not reached", "B stops here")
    assert rows([*configured, down, off], configured) == []


def test_a_capture_that_begins_in_pre_op() -> None:
    later = to_op(sync_manager(2, 6, 0x64))[1:]
    assert rows(to_op(sync_manager(2, 6, 0x64)), later) == []
    (row,) = rows([], later)
    assert (row.a, row.b, row.remark) == ("", "not in the capture", "not requested in A")


def test_another_error_on_the_way_to_the_same_state() -> None:
    again = [reached(PRE_OP), *refused(SAFE_OP, 0x001E), *to_op()[1:]]
    (row,) = rows(to_op(), again)
    assert (row.b, row.remark) == ("refused 0x001E, then SAFE-OP after 12 ms", "another result")


def test_devices_are_paired_by_serial_number_then_by_order() -> None:
    a = timeline((device(0, serial=7), to_op()), (device(1, serial=8), to_op(sync(0x0300))))
    b = timeline((device(0, serial=8), to_op(sync(0x0300))), (device(1, serial=7), to_op()))
    found = compare(a, b)
    assert [row.remark for each in found.devices for row in each.rows] == ["order", "order"]
    assert [row.subject for each in found.devices for row in each.rows] == ["position", "position"]
    unknown = timeline((device(0), to_op()), (device(1), to_op(sync(0x0300))))
    assert compare(a, unknown).equal


def test_a_device_without_an_identity_is_paired_with_one_that_is_left() -> None:
    unknown = replace(device(0), position=None, vendor=None)
    a = timeline((device(0, product=1), to_op()), (device(1, product=2), to_op()))
    b = timeline((unknown, to_op()), (replace(device(1, product=2), position=5), to_op()))
    assert [(each.pair.a, each.pair.b) for each in compare(a, b).devices] == [
        (device(0, product=1), unknown),
        (device(1, product=2), replace(device(1, product=2), position=5)),
    ]
    c = timeline((device(0, product=3), to_op()), (replace(unknown, number=1), to_op()))
    (first, *_) = compare(timeline((device(0, product=1), to_op())), c).devices
    assert first.pair.b == replace(unknown, number=1)


def test_a_device_that_only_one_capture_has() -> None:
    both = ((device(0, product=1), to_op()), (device(1, product=2), to_op()))
    a, b = timeline(*both, (device(2, product=3), to_op())), timeline(both[1])
    found = compare(a, b)
    assert [[row.mark for row in each.rows] for each in found.devices] == [
        [Mark.ONLY_A],
        [],
        [Mark.ONLY_A],
    ]
    assert found.first is not None
    assert found.first.text == "device 0, only in A"
    assert not compare(b, a).equal


def test_the_real_captures(shared_data: Path) -> None:
    """Each capture equals itself, and the clocks differ between two captures of one line."""
    files = sorted((shared_data / "pcap").iterdir())
    timelines = {file.name: read_timeline(file) for file in files}
    for a, b in itertools.product(timelines, timelines):
        assert compare(timelines[a], timelines[b]).equal or a != b
    dc = timelines["ecrab_replay-dc.pcapng"]
    plain = timelines["ecrab_replay-ek1100-el2828-el2889.pcapng"]
    found = compare(dc, plain)
    assert [[row.subject for row in each.rows] for each in found.devices] == [
        ["AssignActivate"],
        [],
        ["AssignActivate"],
    ]
    assert found.count(Mark.ONLY_A, effect=True) == 2


STEPS = st.builds(Step, *[st.sampled_from([None, PRE_OP, SAFE_OP, OP])] * 2)
CONTENTS = st.one_of(*(st.from_type(each) for each in get_args(Content)))


@st.composite
def timelines(draw: st.DrawFn) -> Timeline:
    devices = [
        device(i, serial=draw(st.sampled_from([None, 1, 2])), product=draw(st.integers(1, 3)))
        for i in range(draw(st.integers(0, 3)))
    ]
    return timeline(
        *((each, draw(st.lists(st.tuples(STEPS, CONTENTS), max_size=12))) for each in devices)
    )


@given(timelines(), timelines())
def test_any_two_timelines(a: Timeline, b: Timeline) -> None:
    found, reverse = compare(a, b), compare(b, a)
    assert compare(a, a).equal
    assert found.equal == reverse.equal
    for mark, mirrored in ((Mark.ONLY_A, Mark.ONLY_B), (Mark.RESULT, Mark.RESULT)):
        assert found.count(mark) == reverse.count(mirrored)
    for each in found.devices:
        for row in each.rows:
            assert row.remark
            assert row.a or row.b


@given(st.lists(st.tuples(STEPS, CONTENTS), max_size=12), st.randoms(use_true_random=False))
def test_a_timeline_and_a_mixed_part_of_it(steps: Steps, random: Random) -> None:
    """Most values are equal, so that they are paired."""
    part = [each for each in steps if random.random() < 0.8]
    random.shuffle(part)
    found, reverse = compared(steps, part), compared(part, steps)
    assert found.count(Mark.DIFFERS) == reverse.count(Mark.DIFFERS)
    assert found.equal == reverse.equal
