"""Passive scans and state requests outside a loop."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.errors import EepromError, StateError
from catenary.procedure.al_state import DeviceState
from catenary.virtual import faults
from catenary.wire.al import AlState

OUTPUTS, SERVO = 2, 1


@pytest.fixture
def segment() -> cat.Segment:
    return cat.Segment(
        [cat.virtual.Coupler(), cat.virtual.Servo(alias=10), cat.virtual.DigitalOutputs()]
    )


@pytest.fixture
def main(segment: cat.Segment) -> Iterator[cat.MainDevice]:
    with cat.MainDevice(segment) as main:
        yield main


def states(segment: cat.Segment) -> list[AlState]:
    return [AlState(segment.core.peek(n, 0x0130, 1)[0] & 15) for n in range(len(segment))]


def test_a_passive_scan_finds_the_same_devices_as_a_scan(main: cat.MainDevice) -> None:
    looked = [(sub.name, sub.identity, sub.alias) for sub in main.passive_scan()]
    assert looked == [(sub.name, sub.identity, sub.alias) for sub in main.scan()]


def test_a_passive_scan_and_closing_change_no_state(segment: cat.Segment) -> None:
    with cat.MainDevice(segment) as main:
        main.request_states(main.passive_scan(), range(3), AlState.PRE_OP)
    assert states(segment) == [AlState.PRE_OP] * 3
    with cat.MainDevice(segment) as main:
        main.passive_scan()
    assert states(segment) == [AlState.PRE_OP] * 3


def test_without_names_no_eeprom_is_read(main: cat.MainDevice) -> None:
    main.passive_scan(names=False)
    few = main.counts.datagrams
    main.passive_scan()
    assert main.counts.datagrams > 10 * few


def test_safe_op_is_reached_from_every_state(segment: cat.Segment, main: cat.MainDevice) -> None:
    subs = main.passive_scan()
    for before in (AlState.INIT, AlState.PRE_OP, AlState.SAFE_OP):
        main.request_states(subs, range(3), before)
        found = main.request_states(subs, range(3), AlState.SAFE_OP)
        assert [each.state for each in found.values() if isinstance(each, DeviceState)] == [
            AlState.SAFE_OP
        ] * 3
    assert states(segment) == [AlState.SAFE_OP] * 3


def test_a_single_device_changes_its_state(segment: cat.Segment, main: cat.MainDevice) -> None:
    main.request_states(main.passive_scan(), [SERVO], AlState.PRE_OP)
    assert states(segment) == [AlState.INIT, AlState.PRE_OP, AlState.INIT]


def test_a_refusal_is_reported_and_does_not_affect_other_devices(
    segment: cat.Segment, main: cat.MainDevice
) -> None:
    found = main.request_states(main.passive_scan(), range(3), AlState.OP)
    error = found[SERVO]
    assert isinstance(error, StateError)
    assert error.code == 0x0019
    assert states(segment) == [AlState.OP, AlState.SAFE_OP, AlState.OP]


def test_boot_needs_a_bootstrap_mailbox(main: cat.MainDevice) -> None:
    error = main.request_states(main.passive_scan(), [SERVO], AlState.BOOT)[SERVO]
    assert isinstance(error, EepromError)
    assert "no bootstrap mailbox" in error.message


@pytest.mark.parametrize("cut", [None, ("main", 0), (0, 1), (1, 2), (2, "main")])
def test_a_ring_is_scanned_from_both_ends(cut: tuple[int | str, int | str] | None) -> None:
    devices = [cat.virtual.Coupler(), cat.virtual.Servo(name="a"), cat.virtual.Servo(name="b")]
    segment = cat.Segment(devices, ring=True)
    if cut is not None:
        segment.inject(faults.cut(between=cut))
    with cat.MainDevice(segment.first, segment.second) as main:
        subs = main.passive_scan()
        assert [sub.name for sub in subs] == ["Catenary virtual coupler", "a", "b"]
        texts = [each.evidence for each in main.diagnose(subs=subs).findings]
    wanted = [] if cut is None else [f"the ring is cut between device {cut[0]} and device {cut[1]}"]
    assert [text for text in texts if "ring" in text] == (wanted if cut in ((0, 1), (1, 2)) else [])
