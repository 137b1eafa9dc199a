"""Comparison of virtual devices with their ESI: what is reported, and what is not changed."""

from __future__ import annotations

from dataclasses import replace

import pytest

import catenary as cat
from catenary.bus.esi_check import Comparison, Depth, check_device
from catenary.esi.device import EsiDevice
from catenary.virtual import Segment, TwinOptions, from_esi
from catenary.virtual.coe.quirks import MailboxQuirks
from catenary.virtual.devices.described import DescribedDevice
from catenary.wire.al import AlState
from tests.esi.compared import (
    DRIVE,
    STATUSWORD,
    variable,
    with_mailbox,
    with_manager,
    with_object,
    with_pdo,
)

FULL = Depth(objects=True)
# A device that differs from DRIVE in one fact, and the differences that are reported.
DEVICES = {
    "none": (DRIVE, []),
    "mailbox size": (
        with_manager(DRIVE, 1, default_size=192),
        ["warning send mailbox, size SII"],
    ),
    "SyncManager start": (
        with_manager(DRIVE, 3, start=0x1600),
        ["error SyncManager 3, start "],
    ),
    "PDO entry": (
        with_pdo(DRIVE, 0x1A00, entries=(STATUSWORD,)),
        ["error TxPDO 0x1A00 (Inputs), entry 2 SII"],
    ),
    "missing PDO": (
        replace(DRIVE, pdos=(DRIVE.pdos[0], DRIVE.pdos[2])),
        ["error TxPDO 0x1A00 (Inputs) SII"],
    ),
    "OpMode": (
        replace(DRIVE, op_modes=(DRIVE.op_modes[0],)),
        ["warning OpMode 'DC' "],
    ),
    "object type": (
        with_object(DRIVE, variable(0x6065, "Following error window", "DINT", 32, "rw")),
        ["warning 0x6065:00 (Following error window), type neither"],
    ),
    "SDO information": (
        with_mailbox(DRIVE, sdo_information=False),
        ["warning SDO information SII"],
    ),
    "complete access": (
        with_mailbox(DRIVE, complete_access=False),
        ["warning complete access SII"],
    ),
    "PDO assignment": (
        with_mailbox(DRIVE, pdo_assign=False),
        ["warning PDO assignment SII"],
    ),
}


def check(main: cat.MainDevice, esi: EsiDevice, depth: Depth = FULL) -> Comparison:
    [sub] = main.passive_scan()
    return check_device(main, sub.description, esi, depth, lambda done, total: None)


@pytest.mark.parametrize(("own", "expected"), DEVICES.values(), ids=DEVICES)
def test_one_fact_of_the_device_is_the_only_difference(own: EsiDevice, expected: list[str]) -> None:
    with cat.MainDevice(Segment([from_esi(own)])) as main:
        differences, notes = (found := check(main, DRIVE)).differences, found.notes
    serious = [each for each in differences if each.severity != "info"]
    assert [f"{each.severity} {each.what} {each.follows}" for each in serious] == expected
    assert notes == ()


@pytest.mark.parametrize("state", [AlState.INIT, AlState.PRE_OP])
def test_the_state_is_restored(state: AlState) -> None:
    model = from_esi(DRIVE)
    with cat.MainDevice(Segment([model])) as main:
        main.request_states(main.passive_scan(), [0], state)
        assert check(main, DRIVE).notes == ()
        assert model.state == state


def test_an_interruption_restores_the_state() -> None:
    def interrupted(done: int, total: int) -> None:
        raise KeyboardInterrupt

    model = from_esi(DRIVE)
    with cat.MainDevice(Segment([model])) as main:
        [sub] = main.passive_scan()
        with pytest.raises(KeyboardInterrupt):
            check_device(main, sub.description, DRIVE, FULL, interrupted)
        assert model.state == AlState.INIT


def test_a_device_in_safe_op_is_not_touched() -> None:
    model = from_esi(DRIVE)
    with cat.MainDevice(Segment([model])) as main:
        subs = main.passive_scan()
        main.request_states(subs, [0], AlState.SAFE_OP)
        found = check(main, with_manager(DRIVE, 3, start=0x1600))
        assert model.state == AlState.SAFE_OP
    assert [each.what for each in found.differences] == ["SyncManager 3, start"]
    assert "is in SAFE-OP; its state was not changed" in found.notes[0]


def test_a_passive_comparison_reads_no_objects() -> None:
    with cat.MainDevice(Segment([from_esi(DRIVE)])) as main:
        found = check(main, DRIVE, Depth(coe=False, reason="--passive"))
    assert found.differences == ()
    assert found.notes == ("its object dictionary was not read: --passive",)


def test_another_device_is_not_read() -> None:
    other = replace(DRIVE, key=DRIVE.key._replace(product=1))
    with cat.MainDevice(Segment([from_esi(other)])) as main:
        [difference] = check(main, DRIVE).differences
    assert difference.what == "vendor and product"


@pytest.mark.parametrize(
    ("quirks", "expected", "note"),
    [
        (MailboxQuirks(error_reply="unsupported"), [], "reading ended after 3 failures in a row"),
        (MailboxQuirks(missing_descriptions=(0x1000,)), ["SDO information"], "cannot be read"),
        (MailboxQuirks(malformed_descriptions=(0x6065,)), [], "0x6065"),
    ],
)
def test_a_mailbox_with_faults_ends_with_notes(
    quirks: MailboxQuirks, expected: list[str], note: str
) -> None:
    with cat.MainDevice(
        Segment([DescribedDevice(DRIVE, options=TwinOptions(mailbox_quirks=quirks))])
    ) as main:
        found = check(main, DRIVE)
    serious = [each.what for each in found.differences if each.severity != "info"]
    assert serious == expected
    assert note in "\n".join(found.notes)


def test_a_truncated_list_of_objects_is_not_a_difference() -> None:
    large = DRIVE
    for index in range(0x2000, 0x2100):
        large = with_object(large, variable(index, "Value", "UINT", 16))
    quirks = MailboxQuirks(object_list="missing")
    with cat.MainDevice(
        Segment([DescribedDevice(large, options=TwinOptions(mailbox_quirks=quirks))])
    ) as main:
        found = check(main, large)
    assert found.differences == ()
    assert "the list of objects is truncated" in found.notes[0]


def test_a_device_without_a_mailbox() -> None:
    simple = replace(
        DRIVE,
        mailbox=None,
        dictionary=None,
        sync_managers=tuple(replace(each, default_size=0) for each in DRIVE.sync_managers),
    )
    with cat.MainDevice(Segment([from_esi(simple)])) as main:
        assert check(main, simple) == Comparison(())
        found = check(main, DRIVE)
    texts = [each.what for each in found.differences]
    assert "receive mailbox" in texts
    assert "mailbox protocol CoE" in texts
