"""Golden values of the ESI files in the shared data, compared by hand with their text."""

from __future__ import annotations

from pathlib import Path

import pytest

from catenary.esi import read_esi
from catenary.esi.device import EsiDevice, EsiFile, RevisionCheck
from catenary.model.device import Direction
from catenary.wire.sii import MailboxProtocol
from catenary.wire.sii_categories import SyncManagerUse

COE = MailboxProtocol.COE
# file: key, type, profile, line of the first device, number of objects
GOLDEN = {
    "bogus_io": ("0x00B090C0:0xB0901030:0x0000002A", "B090.IO.3.0", None, 24, 0),
    "bogus_servo": ("0x00B090C0:0xB0905030:0x0000000D", "B090.SO.3.0", 402, 22, 12),
    "hpm_ECAT_CIA402": ("0x0048504D:0x00000003:0x00000001", "ECAT_CIA402", 402, 17, 17),
    "hpm_ECAT_EOE": ("0x0048504D:0x00000005:0x00000001", "eoe", 5001, 17, 18),
    "hpm_ECAT_FOE": ("0x0048504D:0x00000002:0x00000001", "foe", 5001, 17, 18),
    "hpm_ECAT_IO": ("0x0048504D:0x00000001:0x00000001", "digital_io", 5001, 17, 18),
    "metalmusings_EaserCAT_2000": (
        "0x00000AAA:0x00BBBCCC:0x00000002",
        "EaserCAT2000",
        5001,
        15,
        40,
    ),
    "metalmusings_EaserCAT_6000": (
        "0x00000AAA:0x00006000:0x00000002",
        "EaserCAT 6000",
        5001,
        15,
        17,
    ),
    "pollen_LeftElbowOrbita2d_fw1.0": (
        "0x00000F3F:0x00000001:0x00000001",
        "LeftElbowOrbita2d",
        None,
        17,
        0,
    ),
    "pollen_Orbita2d": ("0x00000F3F:0x00000001:0x00000001", "Orbita2d", None, 17, 0),
}


@pytest.fixture
def read(shared_data: Path) -> type[_Reader]:
    _Reader.folder = shared_data / "esi"
    return _Reader


class _Reader:
    folder: Path

    @classmethod
    def file(cls, name: str) -> EsiFile:
        return read_esi(cls.folder / f"{name}.xml")

    @classmethod
    def device(cls, name: str) -> EsiDevice:
        return cls.file(name).devices[0]


def test_every_shared_file_has_golden_values(shared_data: Path) -> None:
    assert {path.stem for path in (shared_data / "esi").glob("*.xml")} == set(GOLDEN)


@pytest.mark.parametrize("name", GOLDEN)
def test_identity_and_place(read: type[_Reader], name: str) -> None:
    file = read.file(name)
    device = file.devices[0]
    objects = len(device.dictionary.objects) if device.dictionary is not None else 0
    line = device.source.line
    assert (str(device.key), device.type, device.profile, line, objects) == GOLDEN[name]
    assert file.warnings == ()
    assert device.unknown == ()


@pytest.mark.parametrize("name", [name for name in GOLDEN if name[0] in "hm"])
def test_files_without_faults_have_no_warnings(read: type[_Reader], name: str) -> None:
    assert read.device(name).warnings == ()


def test_bogus_io(read: type[_Reader]) -> None:
    device = read.device("bogus_io")
    assert device.name == "B090.IO.001 3-ch Digital In/3-ch Digital Out"
    assert device.vendor_name == "Bogus HW Devices Inc. Co., Ltd."
    assert device.fmmus == ("Outputs", "Inputs")
    assert [(sm.start, sm.control) for sm in device.sync_managers] == [
        (0x1800, 0x64),
        (0x1C00, 0x20),
    ]
    (output,) = device.pdos_of(Direction.OUTPUT)
    assert (output.index, output.name, output.fixed, output.sync_manager) == (
        0x1600,
        "DOut(0-2)",
        True,
        0,
    )
    (entry,) = output.entries
    assert (entry.index, entry.subindex, entry.bit_length, entry.type) == (0x7000, 1, 8, "USINT")
    (warning,) = device.warnings  # <TxPdo Sm="2"> with two SyncManagers
    assert warning.source.line == 46
    assert device.pdos_of(Direction.INPUT)[0].sync_manager == 1
    assert device.eeprom is not None
    assert device.eeprom.config_data == bytes.fromhex("B0900000DEADBEEF")


def test_bogus_servo(read: type[_Reader]) -> None:
    first, second = read.file("bogus_servo").devices
    assert second.key.product == 0xB0905031
    assert second.source.line == 1034
    assert [pdo.sync_manager for pdo in first.pdos] == [None, None]
    assert [mode.name for mode in first.op_modes] == ["DC Sync", "DC Off"]
    assert (first.op_modes[0].assign_activate, first.op_modes[0].sync1_factor) == (0x300, 1)
    assert (first.timeouts.pre_op, first.timeouts.mailbox_response) == (2000, 4000)
    assert first.dictionary is not None
    mapped = first.dictionary.entry(0x1600, 1)
    assert mapped is not None
    assert (mapped.default, mapped.access) == (bytes.fromhex("10004060"), "rw")
    (warning,) = first.warnings
    assert "MinValue: '-4294967295' does not fit" in warning.message


def test_hpm_cia402_is_modular(read: type[_Reader]) -> None:
    device = read.device("hpm_ECAT_CIA402")
    slots = device.slots
    assert slots is not None
    assert (slots.pdo_increment, slots.index_increment) == (16, 0x800)
    idents = (0x119800, 0x219800, 0x319800)
    assert [(slot.name, slot.module_idents, slot.default_ident) for slot in slots.slots] == [
        ("Axis 0", idents, 0x319800),
        ("Axis 1", idents, None),
    ]
    assert [(slot.min_instances, slot.max_instances) for slot in slots.slots] == [(1, 1), (0, 1)]
    assert [module.ident for module in device.modules] == list(idents)
    assert device.profile_channels == (402, 402)
    csp = device.modules[1]
    assert [(pdo.index, pdo.depends_on_slot) for pdo in csp.pdos] == [
        (0x1601, True),
        (0x1A01, True),
    ]
    assert [entry.index for entry in csp.pdos[0].entries[:2]] == [0x6040, 0x607A]
    (command,) = csp.init_commands
    assert (command.transitions, command.index, command.data) == (("SO",), 0x6060, b"\x08")
    assert command.depends_on_slot
    assert [sm.enabled for sm in device.sync_managers] == [True, True, False, False]


@pytest.mark.parametrize(
    ("name", "protocols", "bootstrap"),
    [
        ("hpm_ECAT_EOE", COE | MailboxProtocol.EOE, ""),
        ("hpm_ECAT_FOE", COE | MailboxProtocol.FOE, "0010800080108000"),
        ("hpm_ECAT_IO", COE, ""),
    ],
)
def test_hpm_examples(
    read: type[_Reader], name: str, protocols: MailboxProtocol, bootstrap: str
) -> None:
    device = read.device(name)
    mailbox, eeprom = device.mailbox, device.eeprom
    assert mailbox is not None
    assert eeprom is not None
    assert mailbox.protocols == protocols
    assert (mailbox.complete_access, mailbox.pdo_assign, mailbox.segmented_sdo) == (
        True,
        False,
        True,
    )
    assert eeprom.config_data == bytes.fromhex("800C8166000000001234")
    assert eeprom.bootstrap == bytes.fromhex(bootstrap)
    assert device.controller.dpram_size == 61440
    assert (device.identification_register, device.identifies_by_al_status) == (0x134, True)
    assert [(pdo.index, pdo.sync_manager, pdo.bit_length) for pdo in device.pdos] == [
        (0x1600, 2, 32),
        (0x1A00, 3, 32),
    ]
    assert device.dictionary is not None
    mapped = device.dictionary.entry(0x1600, 1)
    assert mapped is not None
    assert (mapped.name, mapped.default) == ("SubIndex 001", bytes.fromhex("20001070"))


def test_metalmusings(read: type[_Reader]) -> None:
    device = read.device("metalmusings_EaserCAT_6000")
    assert [(pdo.index, pdo.name, pdo.bit_length) for pdo in device.pdos] == [
        (0x1600, "Output4", 8),
        (0x1A00, "Input12", 32),
        (0x1A01, "Velocity", 32),
        (0x1A02, "Frequency", 32),
    ]
    assert [entry.type for pdo in device.pdos for entry in pdo.entries] == [
        "USINT",
        "DINT",
        "REAL",
        "UDINT",
    ]
    assert device.mailbox is not None
    assert device.mailbox.pdo_upload
    assert device.has_clock
    larger = read.device("metalmusings_EaserCAT_2000")
    assert len(larger.pdos_of(Direction.OUTPUT)) == 5
    assert len(larger.pdos_of(Direction.INPUT)) == 11


def test_pollen(read: type[_Reader]) -> None:
    device = read.device("pollen_Orbita2d")
    assert device.revision_check is RevisionCheck.EQUAL_OR_GREATER
    assert [sm.use for sm in device.sync_managers] == [
        SyncManagerUse.MAILBOX_OUT,
        SyncManagerUse.MAILBOX_IN,
        SyncManagerUse.OUTPUTS,
        SyncManagerUse.INPUTS,
    ]
    output = device.pdos_of(Direction.OUTPUT)[0]
    assert [entry.index for entry in output.entries[:3]] == [0x6041, 0x6060, 0x607A]  # #x0x6041
    assert output.bit_length == 16 + 8 + 10 * 32
    assert device.op_modes[1].shift_ns == 2000200000
    elbow = read.device("pollen_LeftElbowOrbita2d_fw1.0")
    assert [sm.use for sm in elbow.sync_managers] == [
        SyncManagerUse.OUTPUTS,
        SyncManagerUse.INPUTS,  # in mailbox mode, but it carries a TxPDO
        SyncManagerUse.INPUTS,
    ]
    assert elbow.mailbox is None
