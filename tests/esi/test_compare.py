"""Differences between a device and its ESI."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.esi.compare import compare
from catenary.esi.device import (
    DeviceKey,
    EsiDevice,
    EsiEntry,
    EsiOpMode,
    EsiPdo,
    RevisionCheck,
)
from catenary.esi.reader import read_esi
from catenary.esi.sii import build_sii
from catenary.model.device import Direction, Identity
from catenary.wire.sii import CHECKSUM_DISABLED, MailboxProtocol, decode_sii
from tests.esi.compared import (
    DRIVE,
    FILE,
    STATUSWORD,
    TARGET,
    described,
    found,
    variable,
    with_mailbox,
    with_manager,
    with_object,
    with_pdo,
)

CLOCKED = DRIVE.op_modes[1]
WIDE = EsiEntry(0x6041, 0, 32, "Statusword", "UDINT")
FURTHER = EsiPdo(Direction.INPUT, 0x1A02, "Torque", (STATUSWORD,), 3)


def test_a_device_that_agrees_has_no_difference() -> None:
    assert found(DRIVE).against(DRIVE) == ()
    assert found(DRIVE).against(DRIVE, coe=False) == ()


# one changed fact of the ESI, and the only difference that is reported without and with CoE
CHANGES = {
    "newer device": (
        replace(DRIVE, key=DRIVE.key._replace(revision=0x00010001)),
        "info identity revision",
        "info identity revision",
    ),
    "older device": (
        replace(DRIVE, key=DRIVE.key._replace(revision=0x00010003)),
        "warning identity revision",
        "warning identity revision",
    ),
    "refused revision": (
        replace(
            DRIVE,
            key=DRIVE.key._replace(revision=0x00010001),
            revision_check=RevisionCheck.EQUAL,
        ),
        "error identity revision",
        "error identity revision",
    ),
    "mailbox size": (
        with_manager(DRIVE, 0, default_size=192),
        "warning mailbox receive mailbox, size",
        "warning mailbox receive mailbox, size",
    ),
    "allowed mailbox size": (
        with_manager(DRIVE, 1, default_size=512, min_size=64, max_size=512),
        "info mailbox send mailbox, size",
        "info mailbox send mailbox, size",
    ),
    "mailbox start": (
        with_manager(DRIVE, 1, start=0x1100),
        "error mailbox send mailbox, start",
        "error mailbox send mailbox, start",
    ),
    "SyncManager start": (
        with_manager(DRIVE, 2, start=0x1800),
        "error SyncManager SyncManager 2, start",
        "error SyncManager SyncManager 2, start",
    ),
    "watchdog": (
        with_manager(DRIVE, 2, control=0x24),
        "warning SyncManager SyncManager 2, control",
        "warning SyncManager SyncManager 2, control",
    ),
    "FMMUs": (
        replace(DRIVE, fmmus=("Inputs", "Outputs", "MBoxState")),
        "warning FMMU FMMUs",
        "warning FMMU FMMUs",
    ),
    "length of a fixed entry": (
        with_pdo(DRIVE, 0x1A00, entries=(WIDE, *DRIVE.pdos[1].entries[1:])),
        "error PDO TxPDO 0x1A00 (Inputs), entry 1",
        "error PDO TxPDO 0x1A00 (Inputs), entry 1",
    ),
    "length of an entry that can be configured": (
        with_mailbox(with_pdo(DRIVE, 0x1600, entries=(TARGET,)), pdo_configuration=True),
        "error PDO RxPDO 0x1600 (Outputs), entry 1; warning capability PDO configuration",
        "warning capability PDO configuration; warning PDO RxPDO 0x1600 (Outputs), entry 1",
    ),
    "PDO that is not assigned": (
        with_pdo(DRIVE, 0x1A01, entries=(WIDE,)),
        "warning PDO TxPDO 0x1A01 (Velocity), entry 1",
        "warning PDO TxPDO 0x1A01 (Velocity), entry 1",
    ),
    "missing PDO": (
        replace(DRIVE, pdos=(*DRIVE.pdos, FURTHER)),
        "error PDO TxPDO 0x1A02 (Torque)",
        "error PDO TxPDO 0x1A02 (Torque)",
    ),
    "undescribed PDO": (
        replace(DRIVE, pdos=DRIVE.pdos[:2]),
        "warning PDO TxPDO 0x1A01",
        "warning PDO TxPDO 0x1A01",
    ),
    "undescribed PDO in use": (
        replace(DRIVE, pdos=(DRIVE.pdos[0], DRIVE.pdos[2])),
        "error PDO TxPDO 0x1A00",
        "warning PDO TxPDO 0x1A00",
    ),
    "assignment": (
        with_pdo(DRIVE, 0x1A01, sync_manager=3),
        "error PDO SyncManager 3, assigned PDOs",
        "warning PDO SyncManager 3, assigned PDOs",
    ),
    "OpMode": (
        replace(DRIVE, op_modes=(DRIVE.op_modes[0], replace(CLOCKED, assign_activate=0x0700))),
        "warning clock OpMode 'DC'",
        "warning clock OpMode 'DC'",
    ),
    "missing OpMode": (
        replace(DRIVE, op_modes=(*DRIVE.op_modes, EsiOpMode("DC with SYNC1"))),
        "warning clock OpMode 'DC with SYNC1'",
        "warning clock OpMode 'DC with SYNC1'",
    ),
    "protocol": (
        with_mailbox(DRIVE, protocols=MailboxProtocol.COE | MailboxProtocol.EOE),
        "warning mailbox mailbox protocol EoE; warning mailbox mailbox protocol FoE",
        "warning mailbox mailbox protocol EoE; warning mailbox mailbox protocol FoE",
    ),
    "complete access": (
        with_mailbox(DRIVE, complete_access=False),
        "warning capability complete access",
        "warning capability complete access",
    ),
    "LRW": (
        replace(DRIVE, use_lrd_lwr=True),
        "warning capability support of LRW",
        "warning capability support of LRW",
    ),
    "profile": (
        replace(DRIVE, profile=401),
        "",
        "warning identity device profile (0x1000)",
    ),
    "type of an object": (
        with_object(DRIVE, variable(0x6065, "Window", "DINT", 32, "rw")),
        "",
        "warning object 0x6065:00 (Window), type",
    ),
    "length of an object": (
        with_object(DRIVE, variable(0x6065, "Window", "", 16, "rw")),
        "",
        "warning object 0x6065:00 (Window), length",
    ),
    "further access to an object": (
        with_object(DRIVE, variable(0x6065, "Window", "UDINT", 32, "ro")),
        "",
        "info object 0x6065:00 (Window), access",
    ),
    "missing access to an object": (
        with_object(DRIVE, variable(0x1000, "Device type", "UDINT", 32, "rw")),
        "",
        "warning object 0x1000:00 (Device type), access",
    ),
    "missing object": (
        with_object(DRIVE, variable(0x6066, "Timeout", "UINT", 16)),
        "",
        "warning object objects that only the ESI has",
    ),
}


@pytest.mark.parametrize(("esi", "passive", "full"), CHANGES.values(), ids=CHANGES)
def test_one_changed_fact_is_the_only_difference(esi: EsiDevice, passive: str, full: str) -> None:
    device = found(DRIVE)
    for coe, expected in ((False, passive), (True, full)):
        differences = device.against(esi, coe=coe)
        texts = (f"{each.severity} {each.subject} {each.what}" for each in differences)
        assert "; ".join(texts) == expected
        for each in differences:
            assert each.reason
            assert each.sides.differ


def test_another_device_is_one_error() -> None:
    other = replace(DRIVE, key=DeviceKey(2, 0x07D43052, 1), pdos=(), sync_managers=())
    [difference] = found(DRIVE).against(other)
    assert str(difference) == (
        "vendor and product: 0x00B090C0:0xB0905030 in the device, "
        f"0x00000002:0x07D43052 in the ESI ({FILE}:10)"
    )
    assert difference.severity == "error"


def test_a_difference_has_the_line_of_the_file() -> None:
    [difference] = found(DRIVE).against(with_manager(DRIVE, 2, start=0x1800))
    assert str(difference) == (
        f"SyncManager 2, start: 0x1200 in the device, 0x1800 in the ESI ({FILE}:22)"
    )


def test_the_sides_tell_which_description_the_device_follows() -> None:
    """An outdated SII of a device whose dictionary agrees with the ESI is only a warning."""
    device = found(with_pdo(DRIVE, 0x1A00, entries=(WIDE, *DRIVE.pdos[1].entries[1:])))
    outdated = device._replace(coe=found(DRIVE).coe)
    [difference] = outdated.against(DRIVE)
    assert (difference.severity, difference.follows) == ("warning", "ESI")
    assert str(difference) == (
        "TxPDO 0x1A00 (Inputs), entry 1: 0x6041:00 with 16 bits at bit 0 in the device and the "
        "ESI, 0x6041:00 with 32 bits at bit 0 in its SII "
        f"({FILE}:40); the device follows the ESI"
    )
    [difference] = found(DRIVE).against(with_manager(DRIVE, 0, default_size=192))
    assert difference.follows == "SII"


def test_a_device_without_sdo_information() -> None:
    device = found(DRIVE)
    silent = device._replace(coe=replace(device.coe, sdo_information=False, objects={}))
    [difference] = silent.against(DRIVE)
    assert str(difference) == (
        "SDO information: not supported in the device, supported in its SII and the ESI "
        f"({FILE}:60)"
    )


def test_the_identity_of_the_dictionary_may_differ_from_the_sii() -> None:
    device = found(DRIVE)
    other = Identity(*DRIVE.key._replace(revision=1), 7)
    [difference] = device._replace(coe=replace(device.coe, identity=other)).against(DRIVE)
    assert difference.what == "0x1018:03 (revision)"
    assert difference.follows == "neither"


def test_a_changed_mapping_of_the_device_is_reported() -> None:
    """The master can write 0x1C13, so the present assignment is only a warning."""
    device = found(DRIVE)
    lists = {**device.coe.assignments, 3: (0x1A01,)}
    changed = device._replace(coe=replace(device.coe, assignments=lists))
    [difference] = changed.against(DRIVE)
    assert difference.severity == "warning"
    assert difference.advice == "a master can write 0x1C13"
    fixed = with_mailbox(DRIVE, pdo_assign=False)
    changed = changed._replace(sii=found(fixed).sii, coe=replace(changed.coe, pdo_assign=False))
    [difference] = changed.against(fixed)
    assert difference.severity == "error"


def test_gaps_may_be_divided_in_other_ways() -> None:
    entries = DRIVE.pdos[1].entries
    one = with_pdo(DRIVE, 0x1A00, entries=(entries[0], EsiEntry(0, 0, 16), entries[1]))
    two = with_pdo(
        DRIVE, 0x1A00, entries=(entries[0], EsiEntry(0, 0, 8), EsiEntry(0, 0, 8), entries[1])
    )
    assert found(one).against(two) == ()


def test_an_entry_of_more_than_255_bits_is_one_entry() -> None:
    long = with_pdo(DRIVE, 0x1A00, entries=(EsiEntry(0x2000, 1, 512, "Buffer", "OCTET_STRING"),))
    assert found(long).against(long, coe=False) == ()


def test_an_sii_without_pdos_is_not_a_fault() -> None:
    device = found(replace(DRIVE, pdos=()))
    differences = device.against(DRIVE, coe=False)
    assert [(each.severity, each.what) for each in differences] == [
        ("info", "RxPDOs"),
        ("info", "TxPDOs"),
    ]


def test_config_data_is_compared_without_the_alias() -> None:
    eeprom = DRIVE.eeprom
    assert eeprom is not None
    alias = replace(eeprom, config_data=bytes.fromhex("050E03440A00000078560000"))
    assert found(DRIVE).against(replace(DRIVE, eeprom=alias)) == ()
    other = replace(eeprom, config_data=bytes.fromhex("080E"), byte_size=8192)
    differences = found(DRIVE).against(replace(DRIVE, eeprom=other))
    assert [str(each) for each in differences] == [
        f"ConfigData, PDI control: 0x0E05 in the device, 0x0E08 in the ESI ({FILE}:10)",
        f"size of the EEPROM: 4096 bytes in the device, 8192 bytes in the ESI ({FILE}:10)",
    ]


def test_many_differences_of_a_dictionary_are_summarised() -> None:
    device = found(DRIVE)
    assert DRIVE.dictionary is not None
    longer, shorter = DRIVE, DRIVE
    for index in range(0x2000, 0x2040):
        longer = with_object(longer, variable(index, "Value", "UDINT", 32))
        shorter = with_object(shorter, variable(index, "Value", "UINT", 16))
    device = device._replace(coe=found(longer).coe)
    differences = device.against(shorter)
    assert len(differences) == 21
    assert differences[-1].what == "44 further differences of entries"


def test_without_an_sii_only_the_identity_and_the_dictionary_are_compared() -> None:
    device = found(DRIVE)
    assert compare(device.description, DRIVE) == ()
    assert compare(device.description, DRIVE, None, device.coe) == ()


SHORT_SII = ["info clock OpModes", "info PDO RxPDOs", "info PDO TxPDOs"]
PAIRS = {
    "metalmusings_EaserCAT_2000": SHORT_SII,
    "metalmusings_EaserCAT_6000": SHORT_SII,
    "pollen_Orbita2d": ["error identity vendor and product"],  # the image has vendor 0
}


@pytest.mark.parametrize("name", PAIRS)
def test_real_images_against_the_files_of_their_vendors(shared_data: Path, name: str) -> None:
    image = (shared_data / "sii" / f"{name}.bin").read_bytes()
    [esi] = read_esi(shared_data / "esi" / f"{name}.xml").devices
    differences = compare(described(image), esi, decode_sii(image))
    assert [f"{each.severity} {each.subject} {each.what}" for each in differences] == PAIRS[name]


def test_a_real_image_with_another_op_mode(shared_data: Path) -> None:
    """The vendor's tool shifted the fields of category 60 in this image, and lost its vendor."""
    image = (shared_data / "sii" / "pollen_Orbita2d.bin").read_bytes()
    [esi] = read_esi(shared_data / "esi" / "pollen_Orbita2d.xml").devices
    device = described(image)
    [difference] = compare(device, replace(esi, key=esi.key._replace(vendor=0)), decode_sii(image))
    assert difference.what == "OpMode 'DC_Sync'"
    assert difference.sides == (
        "AssignActivate 0x0300, SYNC0 factor 1, SYNC0 shift 2000200000 ns",
        "AssignActivate 0x0000, SYNC0 factor 0, SYNC0 shift 1882234944 ns",
        None,
    )


def test_an_image_built_from_any_file_agrees_with_it(shared_data: Path) -> None:
    for path in sorted((shared_data / "esi").glob("*.xml")):
        for esi in read_esi(path).devices:
            differences = found(esi).against(esi, coe=False)
            assert [str(each) for each in differences if each.severity != "info"] == [], path


def test_any_two_devices_can_be_compared(shared_data: Path) -> None:
    """A wrong file with the right numbers gives a bounded number of differences."""
    files = sorted((shared_data / "esi").glob("*.xml"))
    devices = [esi for path in files for esi in read_esi(path).devices]
    for one in devices:
        device = found(one)
        for other in devices:
            differences = device.against(replace(other, key=one.key))
            assert len(differences) < 150
            assert all(each.sides.differ for each in differences)


@given(st.data())
def test_any_image_can_be_compared(data: st.DataObject) -> None:
    image = bytearray(build_sii(DRIVE))
    image[14:16] = CHECKSUM_DISABLED.to_bytes(2, "little")
    for _ in range(data.draw(st.integers(1, 8))):
        place = data.draw(st.integers(0, 700))
        image[place] = data.draw(st.integers(0, 255))
    image[14:24] = build_sii(DRIVE)[14:24]
    image[14:16] = CHECKSUM_DISABLED.to_bytes(2, "little")
    try:
        sii = decode_sii(bytes(image))
    except DecodeError:
        return
    for each in compare(described(bytes(image)), DRIVE, sii, found(DRIVE).coe):
        assert str(each)
