"""SII images built from device descriptions."""

from __future__ import annotations

from dataclasses import replace

import hypothesis
import pytest
from hypothesis import strategies as st

from catenary.errors import ConfigurationError
from catenary.esi.device import (
    DeviceKey,
    EsiDevice,
    EsiEeprom,
    EsiEepromCategory,
    EsiEntry,
    EsiMailbox,
    EsiModeSyncManager,
    EsiOpMode,
    EsiPdo,
    EsiSyncManager,
)
from catenary.esi.dictionary import EsiDataType, EsiDictionary
from catenary.esi.sii import assemble_sii, build_sii
from catenary.model.device import Direction
from catenary.wire.sii import Header, MailboxArea, MailboxProtocol, Sii, decode_sii
from catenary.wire.sii_categories import CoeDetails, GeneralFlags, PdoFlags, SyncManagerUse
from catenary.wire.sii_check import objections

STATUS = EsiEntry(0x6041, 0, 16, "Statusword", "UINT")
DRIVE = EsiDevice(
    DeviceKey(0xB090C0, 0xB0905030, 13),
    "Bogus",
    "B090.SO",
    "Bogus servo",
    group="Drives",
    physics="YY",
    fmmus=("Outputs", "Inputs", "MBoxState"),
    sync_managers=(
        EsiSyncManager(0, SyncManagerUse.MAILBOX_OUT, 0x1000, 128, control=0x26),
        EsiSyncManager(1, SyncManagerUse.MAILBOX_IN, 0x1080, 256, control=0x22),
        EsiSyncManager(2, SyncManagerUse.OUTPUTS, 0x1200, 0, control=0x64, op_only=True),
        EsiSyncManager(3, SyncManagerUse.INPUTS, 0x1400, 2, control=0x20, enabled=False),
    ),
    pdos=(
        EsiPdo(Direction.OUTPUT, 0x1600, "Outputs", (), mandatory=True),
        EsiPdo(Direction.INPUT, 0x1A00, "Inputs", (STATUS, EsiEntry(0, 0, 8)), 3, fixed=True),
    ),
    mailbox=EsiMailbox(
        MailboxProtocol.COE | MailboxProtocol.FOE,
        sdo_information=True,
        pdo_assign=True,
        complete_access=True,
        data_link_layer=True,
        drive_channels=1,
    ),
    op_modes=(
        EsiOpMode("FreeRun"),
        EsiOpMode("DC", "DC-Synchron", 0x0300, sync0_factor=1, shift_ns=-5_000, sync1_factor=-1),
    ),
    eeprom=EsiEeprom(
        4096,
        bytes.fromhex("050E03440A00000034120000AB"),
        bytes.fromhex("0010800080108000"),
        categories=(EsiEepromCategory(0x8001, b"\x01\x02\x03"),),
    ),
    e_bus_current_ma=-40,
    use_lrd_lwr=True,
    identification_register=0x0012,
)


def test_the_header_has_identity_configuration_and_mailboxes() -> None:
    image = build_sii(DRIVE, serial=7)
    assert len(image) == 4096
    header = decode_sii(image).header  # checks the checksum
    assert replace(header, checksum=None) == Header(
        *(0xB090C0, 0xB0905030, 13, 7),
        pdi_control=0x0E05,
        pdi_configuration=0x4403,
        sync_pulse_length=10,
        pdi_configuration_2=0,
        station_alias=0x1234,
        bootstrap_receive=MailboxArea(0x1000, 128),
        bootstrap_send=MailboxArea(0x1080, 128),
        standard_receive=MailboxArea(0x1000, 128),
        standard_send=MailboxArea(0x1080, 256),
        mailbox_protocols=MailboxProtocol.COE | MailboxProtocol.FOE,
        size_kbit=32,
        reserved=b"\0\0\xab".ljust(78, b"\0"),
    )
    assert not objections(image)


def test_an_alias_replaces_that_of_the_configuration() -> None:
    assert decode_sii(build_sii(DRIVE, alias=0)).header.station_alias == 0


def test_general_category() -> None:
    sii = decode_sii(build_sii(DRIVE))
    general = sii.general
    assert general is not None
    names = (general.order, general.group, general.name)
    assert [sii.string(number) for number in names] == ["B090.SO", "Drives", "Bogus servo"]
    assert general.reserved[1] == general.group
    assert general.coe == (
        CoeDetails.SDO
        | CoeDetails.SDO_INFORMATION
        | CoeDetails.PDO_ASSIGN
        | CoeDetails.COMPLETE_ACCESS
    )
    assert (general.foe, general.eoe, general.ds402_channels) == (1, 0, 1)
    assert (general.current_ma, general.physical_ports) == (-40, 0x0011)
    assert general.identification_address == 0x0012
    assert general.flags == (
        GeneralFlags.NO_LRW
        | GeneralFlags.MAILBOX_DATA_LINK_LAYER
        | GeneralFlags.IDENTIFICATION_BY_MEMORY
    )


@pytest.mark.parametrize(
    ("profile", "channels", "given", "expected"),
    [(402, (), 0, 1), (5001, (402, 402), 0, 2), (5001, (), 0, 0), (402, (402,), 3, 3)],
)
def test_drive_channels(profile: int, channels: tuple[int, ...], given: int, expected: int) -> None:
    mailbox = EsiMailbox(MailboxProtocol.COE, drive_channels=given)
    device = replace(DRIVE, mailbox=mailbox, profile=profile, profile_channels=channels)
    general = decode_sii(build_sii(device)).general
    assert general is not None
    assert general.ds402_channels == expected


def test_safe_op_in_configuration_mode_is_a_flag() -> None:
    general = decode_sii(build_sii(replace(DRIVE, config_in_safe_op=True))).general
    assert general is not None
    assert GeneralFlags.SAFE_OP in GeneralFlags(general.flags)


@pytest.mark.parametrize(
    ("physics", "ports"), [("YKY", 0x0131), ("Y H", 0x0401), ("", 0), ("KK", 0x0033)]
)
def test_ports(physics: str, ports: int) -> None:
    """0x0131 is the value of Beckhoff's EK1100."""
    general = decode_sii(build_sii(replace(DRIVE, physics=physics))).general
    assert general is not None
    assert general.physical_ports == ports


def test_sync_managers_and_fmmus() -> None:
    sii = decode_sii(build_sii(DRIVE))
    assert sii.fmmus == (1, 2, 3, 0xFF)
    assert [(each.address, each.length, each.control) for each in sii.sync_managers] == [
        *((0x1000, 128, 0x26), (0x1080, 256, 0x22), (0x1200, 0, 0x64), (0x1400, 2, 0x20))
    ]
    assert [(int(each.enable), each.use) for each in sii.sync_managers] == [
        *((1, 1), (1, 2), (0x09, 3), (0, 4))
    ]


def test_pdos() -> None:
    sii = decode_sii(build_sii(DRIVE))
    [output], [into] = sii.receive_pdos, sii.transmit_pdos
    assert (output.sync_manager, output.flags) == (0xFF, PdoFlags.MANDATORY)
    assert (into.sync_manager, into.flags) == (3, PdoFlags.FIXED_CONTENT)
    assert [(e.index, e.bit_length, e.data_type) for e in into.entries] == [
        *((0x6041, 16, 6), (0, 8, 0))
    ]
    assert sii.string(into.entries[0].name) == "Statusword"


def test_clock_modes() -> None:
    free, clock = decode_sii(build_sii(DRIVE)).clock_modes
    assert free.assign_activate == 0
    assert (clock.assign_activate, clock.shift_time_ns) == (0x0300, -5_000)
    assert (clock.sync0_factor, clock.sync1_factor) == (1, -1)


def test_the_categories_of_the_file_come_last() -> None:
    categories = decode_sii(build_sii(DRIVE)).categories
    assert [each.type for each in categories] == [10, 30, 40, 41, 50, 51, 60, 0x8001]
    assert categories[-1].data == b"\x01\x02\x03\x00"


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("BOOL", 0x01),
        ("UINT8", 0x05),
        ("UNSIGNED32", 0x07),
        ("STRING(26)", 0x09),
        ("ARRAY [0..7] OF BYTE", 0x0A),
        ("BITARR8", 0x2D),
        ("DT0800EN03", 0x03),
        ("DT1018", 0),
        ("Loop", 0),
        ("unknown", 0),
    ],
)
def test_data_types_are_coe_indices(name: str, number: int) -> None:
    declared = {
        "DT0800EN03": EsiDataType("DT0800EN03", 16, base="INT"),
        "DT1018": EsiDataType("DT1018", 144),
        "Loop": EsiDataType("Loop", 8, base="Loop"),
    }
    pdo = EsiPdo(Direction.INPUT, 0x1A00, "", (EsiEntry(0x6000, 1, 16, "x", name),), 3)
    device = replace(DRIVE, pdos=(pdo,), dictionary=EsiDictionary(types=declared))
    assert decode_sii(build_sii(device)).transmit_pdos[0].entries[0].data_type == number


def test_names_that_an_sii_cannot_store_are_noted() -> None:
    build = assemble_sii(replace(DRIVE, name="总线 IO", group="g" * 300))
    sii = decode_sii(build.image)
    assert "?? IO" in sii.strings
    assert "g" * 255 in sii.strings
    assert len(build.notes) == 2
    assert "Latin-1" in " ".join(build.notes)


def test_the_256th_string_is_left_out() -> None:
    pdos = tuple(EsiPdo(Direction.INPUT, 0x1A00 + n, f"P{n}", ()) for n in range(300))
    build = assemble_sii(replace(DRIVE, pdos=pdos, eeprom=None))
    sii = decode_sii(build.image)
    assert len(sii.strings) == 255
    assert sii.transmit_pdos[-1].name == 0
    assert any("255 strings" in note for note in build.notes)


def test_an_entry_of_more_than_255_bits_keeps_its_length() -> None:
    pdo = EsiPdo(Direction.INPUT, 0x1A00, "", (EsiEntry(0x6000, 1, 600, "blob", ""),), 3)
    build = assemble_sii(replace(DRIVE, pdos=(pdo,)))
    [found] = decode_sii(build.image).transmit_pdos
    assert [entry.bit_length for entry in found.entries] == [248, 248, 104]
    assert "600 bits" in build.notes[0]


def test_unknown_uses_and_lost_settings_are_noted() -> None:
    mode = EsiOpMode("DC", sync1_ns=1000, sync_managers=(EsiModeSyncManager(2, 1),))
    build = assemble_sii(replace(DRIVE, fmmus=("OrbitaIn", "Inputs"), op_modes=(mode,)))
    assert decode_sii(build.image).fmmus == (0, 2)
    assert [note.split(":")[0] for note in build.notes] == ["OpMode 'DC'", "FMMU 0"]


def test_without_a_known_use_the_fmmus_are_left_out() -> None:
    """As in Pollen's images: masters would take unused FMMUs for missing ones."""
    build = assemble_sii(replace(DRIVE, fmmus=("OrbitaIn", "OrbitaOut")))
    assert decode_sii(build.image).fmmus == ()
    assert "left out" in build.notes[0]


def test_an_image_that_exceeds_the_eeprom_is_refused() -> None:
    pdos = tuple(EsiPdo(Direction.INPUT, 0x1A00 + n, "name " * 9, (STATUS,)) for n in range(9))
    pdos = tuple(replace(pdo, name=f"{pdo.name}{n}") for n, pdo in enumerate(pdos))
    small = replace(DRIVE, pdos=pdos, eeprom=EsiEeprom(700, b"\x05"))
    with pytest.raises(ConfigurationError, match="but its EEPROM has 700") as caught:
        build_sii(small)
    assert "--pdos unnamed" in caught.value.hint
    assert len(assemble_sii(small, pdos="unnamed").image) == 700
    absent = decode_sii(assemble_sii(small, pdos="absent").image)
    assert (absent.transmit_pdos, absent.receive_pdos) == ((), ())


def test_without_a_size_the_eeprom_fits() -> None:
    bare = replace(DRIVE, eeprom=None)
    assert len(build_sii(bare)) == 2048
    pdos = tuple(EsiPdo(Direction.INPUT, 0x1A00 + n, f"P{n}", (STATUS,) * 9) for n in range(99))
    image = build_sii(replace(bare, pdos=pdos))
    assert len(image) == 16384
    assert decode_sii(image).header.size_kbit == 128


def test_a_whole_image_in_the_file_is_used() -> None:
    given_image = Sii(Header(1, 2, 3, 4, station_alias=5)).encode()
    device = replace(DRIVE, eeprom=EsiEeprom(data=given_image))
    assert build_sii(device) == given_image
    header = decode_sii(build_sii(device, serial=9, alias=6)).header
    assert (header.serial, header.station_alias) == (9, 6)


def test_a_truncated_image_in_the_file_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="Eeprom/Data"):
        build_sii(replace(DRIVE, eeprom=EsiEeprom(data=b"\x05\x06")))


@pytest.mark.parametrize(("serial", "alias"), [(-1, None), (1 << 32, None), (0, 65536)])
def test_a_number_out_of_range_is_refused(serial: int, alias: int | None) -> None:
    with pytest.raises(ValueError, match="must be 0 to"):
        build_sii(DRIVE, serial=serial, alias=alias)


def test_a_value_that_does_not_fit_names_the_device() -> None:
    pdo = EsiPdo(Direction.INPUT, 0x1A00, "", (STATUS,) * 256, 3)
    with pytest.raises(ConfigurationError, match=r"B090\.SO .*PDO"):
        build_sii(replace(DRIVE, pdos=(pdo,), eeprom=None))


@hypothesis.given(
    st.text(max_size=300),
    st.lists(st.integers(0, 700), max_size=20),
    st.binary(max_size=20),
    st.binary(max_size=10),
)
def test_any_device_gives_an_image_that_decodes(
    name: str, lengths: list[int], configuration: bytes, bootstrap: bytes
) -> None:
    entries = tuple(EsiEntry(0x6000, n, bits, name) for n, bits in enumerate(lengths))
    device = replace(
        DRIVE,
        name=name,
        pdos=(EsiPdo(Direction.OUTPUT, 0x1600, name, entries, 2),),
        eeprom=EsiEeprom(0, configuration, bootstrap),
    )
    image = build_sii(device)
    assert not objections(image)
    assert decode_sii(image).receive_pdos[0].bit_length == sum(lengths)
