"""ESI facts added to the description of a device."""

from __future__ import annotations

from dataclasses import replace

import pytest

from catenary.errors import IdentityError
from catenary.esi.apply import applied
from catenary.esi.device import (
    DeviceKey,
    EsiSyncManager,
    EsiTimeouts,
    EsiWatchdog,
    RevisionCheck,
)
from catenary.esi.object_descriptions import data_type_index
from catenary.esi.units import unit_text
from catenary.model.device import DeviceDescription, Direction, Entry, Identity, OpMode, Pdo
from catenary.wire.sii_categories import SyncManagerUse
from tests.esi import devices as esi
from tests.plan import devices


def drive(**changes: object) -> DeviceDescription:
    return replace(devices.servo(0), **changes)  # type: ignore[arg-type]


def assigned(device: DeviceDescription, direction: Direction) -> dict[int, list[int]]:
    return {
        each.sync_manager: [pdo.index for pdo in each.pdos]
        for each in device.assignments(direction)
    }


def pdo(device: DeviceDescription, index: int) -> Pdo:
    return next(p for p in (*device.output_pdos, *device.input_pdos) if p.index == index)


# -- identity --------------------------------------------------------------------------------------


def test_the_esi_of_another_device_is_refused_with_file_and_line() -> None:
    other = replace(esi.servo(), key=DeviceKey(0x1234, 77, 1))
    with pytest.raises(IdentityError, match=r"drive\.xml:10 describes another device: SRV-1"):
        applied(drive(), other)


@pytest.mark.parametrize(
    ("rule", "revision", "accepted"),
    [
        ("", 0x0005_0001, True),
        ("EQ", 0x0002_0003, True),
        ("EQ", 0x0002_0004, False),
        ("EQ_OR_G", 0x0002_0004, True),
        ("EQ_OR_G", 0x0003_0000, True),
        ("EQ_OR_G", 0x0002_0002, False),
        ("LW_EQ", 0x0009_0003, True),
        ("LW_EQ", 0x0009_0004, False),
        ("LW_EQ_OR_G", 0x0000_0004, True),
        ("LW_EQ_OR_G", 0x0009_0002, False),
        ("LW_EQ_HW_EQ_OR_G", 0x0003_0003, True),
        ("LW_EQ_HW_EQ_OR_G", 0x0001_0003, False),
        ("HW_EQ", 0x0002_0000, True),
        ("HW_EQ", 0x0003_0003, False),
        ("HW_EQ_OR_G", 0x0003_0000, True),
        ("HW_EQ_OR_G", 0x0001_0003, False),
        ("HW_EQ_LW_EQ_OR_G", 0x0002_0004, True),
        ("HW_EQ_LW_EQ_OR_G", 0x0003_0004, False),
    ],
)
def test_the_revision_rule_decides(rule: str, revision: int, accepted: bool) -> None:
    described = replace(
        esi.servo(), key=DeviceKey(0x1234, 0, 0x0002_0003), revision_check=RevisionCheck(rule)
    )
    device = drive(identity=Identity(0x1234, 0, revision, 0))
    if accepted:
        applied(device, described)
        return
    with pytest.raises(IdentityError, match=f"CheckRevisionNo={rule}"):
        applied(device, described)


def test_another_revision_without_a_rule_is_a_note() -> None:
    device = applied(drive(identity=Identity(0x1234, 0, 2, 0)), esi.servo())
    assert device.notes == (
        "drive.xml:10: its ESI is for revision 0x00000001, but its revision is 0x00000002",
    )


# -- process data ----------------------------------------------------------------------------------


def test_the_default_pdos_of_the_esi_replace_those_of_the_sii() -> None:
    device = applied(drive(), esi.servo())
    assert assigned(device, Direction.OUTPUT) == {2: [0x1600]}
    assert assigned(device, Direction.INPUT) == {3: [0x1A00]}
    assert [p.index for p in device.input_pdos] == [0x1A00, 0x1A01, 0x1A02]
    assert pdo(device, 0x1600).entries[2] == Entry(0x607A, 0, 32, "Target position", 4)
    assert pdo(device, 0x1601).fixed
    assert pdo(device, 0x1601).excludes == {0x1600}
    assert pdo(device, 0x1A01).source == "drive.xml:44"
    assert (device.mapping_source, device.esi) == ("ESI drive.xml:10", "drive.xml:10")


def test_a_mapping_that_the_device_reports_is_kept_and_gets_names_and_rules() -> None:
    bare = Pdo(0x1A00, (Entry(0x6041, 0, 16), Entry(0x6064, 0, 32)), 3)
    device = drive(mapping_source="CoE").with_process_data(
        Direction.INPUT, devices.assigned((bare,)), (bare,)
    )
    device = applied(device, esi.servo())
    assert assigned(device, Direction.OUTPUT) == {2: [0x1600]}
    [inputs] = device.inputs
    assert [(e.name, e.data_type) for e in inputs.pdos[0].entries] == [
        ("Statusword", 6),
        ("Position actual value", 4),
    ]
    assert inputs.pdos[0].name == "Inputs"
    assert len(device.outputs[0].pdos[0].entries) == 5  # of the device; the ESI has three
    assert device.mapping_source == "CoE"
    assert pdo(device, 0x1A02).sync_manager is None


def test_units_and_enumerations_come_from_the_dictionary() -> None:
    device = applied(drive(), esi.servo())
    assert pdo(device, 0x1600).entries[1].enumeration == ((8, "CSP"), (9, "CSV"))
    known = device.documented_object(0x2000, 0)
    assert known is not None
    assert (known.name, known.data_type, known.unit) == ("Temperature", 8, "degC")


def test_a_device_without_coe_notes_that_its_sii_differs() -> None:
    device = applied(drive(mailbox=None), replace(esi.servo(), mailbox=None))
    assert device.notes == (
        "drive.xml:10: its ESI assigns the outputs SyncManager 2: 0x1600 (56 bits), its SII "
        "SyncManager 2: 0x1600 (104 bits); those of the ESI are used",
        "drive.xml:10: its ESI assigns the inputs SyncManager 3: 0x1A00 (56 bits), its SII "
        "SyncManager 3: 0x1A00 (104 bits); those of the ESI are used",
    )


def test_sync_managers_of_process_data_come_from_the_esi() -> None:
    described = esi.servo()
    moved = replace(described.sync_managers[2], start=0x1180)
    device = applied(
        drive(), replace(described, sync_managers=(*described.sync_managers[:2], moved))
    )
    assert [each.start for each in device.sync_managers] == [0x1000, 0x1080, 0x1180, 0x1400]
    assert device.notes == (
        "drive.xml:10: SyncManager 2 is outputs at 0x1100, control 0x24 in its SII, but outputs at "
        "0x1180, control 0x24 in its ESI, which is used",
    )


def test_a_pdo_on_a_wrong_sync_manager_is_not_assigned() -> None:
    wrong = replace(esi.servo(), pdos=(esi.tx(0x1A00, "Inputs", 40, 2),))
    device = applied(drive(), wrong)
    assert device.inputs == ()
    assert "drive.xml:40: its ESI assigns PDO 0x1A00 to SyncManager 2" in device.notes[0]


def test_a_direction_without_pdos_keeps_those_of_the_sii() -> None:
    device = applied(drive(), replace(esi.servo(), pdos=esi.servo().pdos_of(Direction.INPUT)))
    assert device.outputs == drive().outputs


# -- settings --------------------------------------------------------------------------------------


def test_mailbox_properties_count_where_the_sii_says_nothing() -> None:
    sii = drive().mailbox
    assert sii is not None
    silent = applied(drive(mailbox=replace(sii, stated=False)), esi.servo()).mailbox
    assert silent is not None
    assert (silent.pdo_assign, silent.complete_access, silent.source) == (
        True,
        False,
        "drive.xml:50",
    )
    stated = applied(drive(mailbox=replace(sii, pdo_assign=False)), esi.servo())
    assert stated.mailbox == replace(sii, pdo_assign=False)
    assert stated.notes == (
        "drive.xml:50: its ESI and its SII differ in PdoAssign; those of the SII are used",
    )


def test_modes_of_the_esi_precede_those_of_the_sii() -> None:
    sii = (OpMode("dc", assign_activate=0x500), OpMode("Other", assign_activate=0x300))
    device = applied(drive(op_modes=sii), esi.servo())
    assert [(mode.name, mode.source) for mode in device.op_modes] == [
        ("SM-Synchron", "drive.xml:60"),
        ("DC", "drive.xml:64"),
        ("DC half", "drive.xml:70"),
        ("Other", ""),
    ]


def test_commands_timeouts_and_watchdog_are_kept_with_their_source() -> None:
    described = replace(
        esi.with_commands(esi.command(52, 0x2010, b"\x05\x00", "PS")),
        timeouts=EsiTimeouts(pre_op=20_000, mailbox_response=4000),
        watchdog=EsiWatchdog(sync_managers=500),
    )
    device = applied(drive(), described)
    [command] = device.init_commands
    assert (command.transitions, command.index, command.source) == (("PS",), 0x2010, "drive.xml:52")
    assert (device.timeouts.pre_op, device.timeouts.mailbox_response) == (20.0, 4.0)
    assert device.watchdog.process_data == 500
    assert [each.name for each in device.named_mappings] == ["Compact"]


@pytest.mark.parametrize("index", [2, 4])  # 4: not in the SII
def test_process_data_cannot_be_in_the_registers(index: int) -> None:
    outputs = EsiSyncManager(
        index, SyncManagerUse.OUTPUTS, 0x0120, 7, control=0x64, source=esi.at(9)
    )
    device = applied(drive(), replace(esi.servo(), sync_managers=(outputs,)))
    assert device.sync_managers == drive().sync_managers
    assert (
        f"drive.xml:9: its ESI places SyncManager {index} at 0x0120, but process data start at "
        "0x1000; it is not used"
    ) in device.notes


def test_absurd_timeouts_are_bounded() -> None:
    described = replace(esi.servo(), timeouts=EsiTimeouts(safe_op_and_op=0xFFFFFFFF))
    assert applied(drive(), described).timeouts.safe_op_and_op == 60.0


@pytest.mark.parametrize(
    ("code", "text"),
    [(None, ""), (0, ""), (0xFD260000, "mV"), (0x00010300, "m/s"), (0x12345678, "unit 0x12345678")],
)
def test_units_as_text(code: int | None, text: str) -> None:
    assert unit_text(code) == text


def test_derived_types_have_the_index_of_their_base() -> None:
    assert data_type_index("Mode_T", 8, esi.DICTIONARY) == 2
    assert data_type_index("STRING(20)", 160) == 9
    assert data_type_index("UINT", 32) == 0
    assert data_type_index("DT1018", 144, esi.DICTIONARY) == 0
