"""Each part of a device: PDOs, SyncManagers, mailbox, clocks, slots, EEPROM, general facts."""

from __future__ import annotations

from catenary.esi.device import (
    EsiController,
    EsiDevice,
    EsiEeprom,
    EsiEepromCategory,
    EsiEntry,
    EsiInitCommand,
    EsiMapping,
    EsiModeSyncManager,
    EsiOpMode,
    EsiPdo,
    EsiSlot,
    EsiSyncManager,
    EsiTimeouts,
    EsiWatchdog,
)
from catenary.esi.document import make_document
from catenary.esi.reader import read_document
from catenary.esi.source import Source
from catenary.model.device import Direction
from catenary.wire.sii import MailboxProtocol
from catenary.wire.sii_categories import SyncManagerUse
from tests.esi import corpus

LINE_3 = Source("a.xml", 3)


def device_of(name: str) -> EsiDevice:
    return read_document(make_document(corpus.FILES[name], "a.xml")).devices[0]


WHOLE = device_of("every element")


def test_pdos() -> None:
    entry = EsiEntry(0x7000, 1, 16, "Value", "INT")
    assert WHOLE.pdos_of(Direction.OUTPUT) == (
        EsiPdo(
            Direction.OUTPUT, 0x1600, "Out", (entry,), 2, fixed=True, mandatory=True, source=LINE_3
        ),
    )
    assert [pdo.index for pdo in WHOLE.pdos] == [0x1600, 0x1A00]


def test_options_of_pdos() -> None:
    (pdo,) = device_of("PDO options").pdos
    assert pdo == EsiPdo(
        Direction.INPUT,
        0x1A00,
        "A",
        (),
        virtual=True,
        excludes=frozenset({0x1A01, 0x1A02}),
        excluded_sync_managers=frozenset({2}),
        oversampling_max=100,
        depends_on_slot=True,
        excludes_depend_on_slot=True,
        overwritten_by_module=True,
        source=LINE_3,
    )


def entries_of(name: str) -> tuple[EsiEntry, ...]:
    return tuple(entry for pdo in device_of(name).pdos for entry in pdo.entries)


def test_entries() -> None:
    assert entries_of("numbers") == (EsiEntry(0x6041, 1, 16),)
    assert entries_of("no SubIndex") == (EsiEntry(0x6000, 0, 8),)
    assert entries_of("no BitLen") == (EsiEntry(0x6000, 0, 16, type="UINT"),)
    assert entries_of("gap") == (EsiEntry(0, 0, 4),)
    assert entries_of("BitLen 0") == (EsiEntry(0x7000, 1, 0, "Value", "INT"),)
    assert entries_of("absurd numbers") == ()


def test_sync_managers() -> None:
    first, *_, last = WHOLE.sync_managers
    assert first == EsiSyncManager(
        0, SyncManagerUse.MAILBOX_OUT, 0x1000, 128, 34, 128, 0x26, name="MBoxOut", source=LINE_3
    )
    assert (last.use, last.start, last.default_size) == (SyncManagerUse.INPUTS, 0x1400, 2)


def test_a_sync_manager_that_does_not_exist_is_replaced_by_the_only_one_of_the_direction() -> None:
    assert [pdo.sync_manager for pdo in device_of("SyncManager that does not exist").pdos] == [3]


def test_mailbox_and_init_commands() -> None:
    mailbox = device_of("plain").mailbox
    assert mailbox is not None
    assert mailbox.protocols == MailboxProtocol.COE
    assert (mailbox.sdo_information, mailbox.complete_access) == (True, True)
    assert WHOLE.mailbox is not None
    assert WHOLE.mailbox.init_commands == (
        EsiInitCommand(
            ("PS", "SO"),
            0x1C12,
            0,
            bytes.fromhex("01000016"),
            complete_access=True,
            fixed=True,
            comment="assign",
            source=LINE_3,
        ),
    )


def test_op_modes() -> None:
    assert WHOLE.has_clock
    assert WHOLE.op_modes == (
        EsiOpMode(
            "DC-Synchron",
            "with SYNC0",
            0x730,
            sync0_factor=1,
            shift_ns=-5000,
            shift_factor=-1,
            shift_of_inputs=True,
            sync1_factor=-2,
            sync1_shift_ns=100,
            sync_managers=(EsiModeSyncManager(3, 2, 1000, 5, (0x1A00, 0x1A01), (10, 1)),),
            source=LINE_3,
        ),
    )


def test_slots() -> None:
    slots = WHOLE.slots
    assert slots is not None
    assert (slots.pdo_increment, slots.index_increment, slots.max_slot_count) == (16, 2048, 4)
    assert slots.download_module_idents
    assert slots.identify_by == "ModuleIdent"
    assert slots.slots == (
        EsiSlot("Axis", 1, 2, (1, 2), 2, source=LINE_3),
        EsiSlot("Terminal", 0, 1, module_classes=("DI",), pdo_increment=3, source=LINE_3),
    )


def test_eeprom() -> None:
    assert WHOLE.eeprom == EsiEeprom(
        2048,
        bytes.fromhex("050E03441027"),
        bytes.fromhex("0010800080108000"),
        assign_to_pdi=True,
        categories=(
            EsiEepromCategory(2048, b"\x01\x02"),
            EsiEepromCategory(2049, b"abc"),
            EsiEepromCategory(2050, b"\x34\x12"),
            EsiEepromCategory(2051, b"\x01\0\0\0"),
        ),
    )


def test_general_facts() -> None:
    assert WHOLE.timeouts == EsiTimeouts(2000, 9000, 5000, 200, 100, 2000)
    assert WHOLE.controller == EsiController(4096, 4, 3)
    assert WHOLE.watchdog == EsiWatchdog(0x9C2, 0, 1000)
    assert WHOLE.e_bus_current_ma == -2000
    assert (WHOLE.identification_register, WHOLE.identifies_by_al_status) == (0x12, False)
    assert (WHOLE.physics, WHOLE.group, WHOLE.profile) == ("YY", "IO", 5001)


def test_alternative_mappings() -> None:
    assert device_of("alternative mappings").alternative_mappings == (
        EsiMapping("Standard", True, ((3, (0x1A00, 0x1A01)),), LINE_3),
        EsiMapping("Compact", False, ((3, (0x1A02,)),), LINE_3),
    )
