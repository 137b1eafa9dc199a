"""Virtual devices from ESIs, driven by our MainDevice."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import pytest

import catenary as cat
from catenary.errors import CatenaryError, SdoAbort
from catenary.esi.device import (
    DeviceKey,
    EsiDevice,
    EsiEeprom,
    EsiEntry,
    EsiMailbox,
    EsiModule,
    EsiOpMode,
    EsiPdo,
    EsiSlot,
    EsiSlots,
    EsiSyncManager,
)
from catenary.esi.dictionary import EsiDictionary, EsiObject, EsiObjectEntry
from catenary.model.device import Direction
from catenary.virtual import DescribedDevice, Segment, TwinOptions, from_esi
from catenary.virtual.devices.twin import NO_OPTIONS
from catenary.wire.sii import MailboxProtocol
from catenary.wire.sii_categories import SyncManagerUse
from tests.virtual.main_device import SM0, STATION, MainDevice


def variable(index: int, name: str, bits: int, **facts: object) -> EsiObject:
    kind = {8: "USINT", 16: "UINT", 32: "DINT"}[bits]
    entry = EsiObjectEntry(index, 0, name, kind, bits, **facts)  # type: ignore[arg-type]
    return EsiObject(index, name, kind, bits, (entry,))


OBJECTS = (
    variable(0x6040, "Controlword", 16, access="rw", pdo_mapping="R"),
    variable(0x6041, "Statusword", 16, pdo_mapping="T", default=b"\x50\x02"),
    variable(0x6064, "Position", 32, pdo_mapping="T", default=b"\xfe\xff\xff\xff"),
    variable(0x6083, "Acceleration", 32, access="rw", default=b"\x10\x27\x00\x00"),
    EsiObject(0x1008, "Name", "STRING(5)", 40, (
        EsiObjectEntry(0x1008, 0, "Name", "STRING(5)", 40, default=b"Drive"),
    )),
)  # fmt: skip
DRIVE = EsiDevice(
    DeviceKey(0xB090C0, 0xB0905030, 13),
    "Bogus",
    "B090.SO",
    "Bogus servo",
    physics="YY",
    fmmus=("Outputs", "Inputs", "MBoxState"),
    sync_managers=(
        EsiSyncManager(0, SyncManagerUse.MAILBOX_OUT, 0x1000, 128, control=0x26),
        EsiSyncManager(1, SyncManagerUse.MAILBOX_IN, 0x1080, 128, control=0x22),
        EsiSyncManager(2, SyncManagerUse.OUTPUTS, 0x1200, 0, control=0x64),
        EsiSyncManager(3, SyncManagerUse.INPUTS, 0x1400, 0, control=0x20),
    ),
    pdos=(
        EsiPdo(
            Direction.OUTPUT,
            0x1600,
            "Outputs",
            (EsiEntry(0x6040, 0, 16, "Controlword", "UINT"), EsiEntry(0, 0, 16)),
            2,
            mandatory=True,
        ),
        EsiPdo(
            Direction.INPUT,
            0x1A00,
            "Inputs",
            (
                EsiEntry(0x6041, 0, 16, "Statusword", "UINT"),
                EsiEntry(0x6064, 0, 32, "Position", "DINT"),
            ),
            3,
            excludes=frozenset({0x1A01}),
        ),
        EsiPdo(Direction.INPUT, 0x1A01, "Short", (EsiEntry(0x6041, 0, 16, "Statusword", "UINT"),)),
    ),
    mailbox=EsiMailbox(
        MailboxProtocol.COE, sdo_information=True, pdo_assign=True, complete_access=True
    ),
    has_clock=True,
    op_modes=(EsiOpMode("DC", assign_activate=0x0300, sync0_factor=1),),
    dictionary=EsiDictionary(objects={each.index: each for each in OBJECTS}),
    eeprom=EsiEeprom(2048, bytes.fromhex("800C8166")),
)


@contextmanager
def opened(
    device: EsiDevice, options: TwinOptions = NO_OPTIONS
) -> Iterator[tuple[cat.MainDevice, DescribedDevice]]:
    model = DescribedDevice(device, serial=7, options=options)
    with cat.MainDevice(Segment([model])) as main:
        main.scan()
        yield main, model


def test_the_scan_finds_what_the_esi_describes() -> None:
    with opened(DRIVE) as (main, _):
        sub = main.subs[0]
        identity = sub.identity
        assert (identity.vendor, identity.product, identity.revision) == DRIVE.key
        assert (identity.serial, sub.name) == (7, "Bogus servo")
        assert sub.description.mapping_source == "CoE"
        assert [pdo.index for pdo in sub.description.input_pdos] == [0x1A00, 0x1A01]
        assert sub.description.op_modes[0].name == "DC"
        assert sub.description.clock_bits == 64


def test_process_data_reaches_the_objects() -> None:
    with opened(DRIVE, TwinOptions(motor=None)) as (main, model):
        data = cat.ProcessData(main.subs[0])
        with cat.Loop(data, period=2e-3) as loop:
            data.outputs[:2] = b"\x06\x00"
            model.write_object(0x6041, 0, b"\x21\x00")
            for _ in range(3):
                next(loop)
            assert model.state == 8
            assert model.read_object(0x6040) == b"\x06\x00"
            assert bytes(data.inputs) == struct.pack("<Hi", 0x21, -2)


def test_objects_have_values_and_access_rights() -> None:
    with opened(DRIVE) as (main, _):
        sub = main.subs[0]
        assert sub.sdo.read(0x6083) == b"\x10\x27\x00\x00"
        sub.sdo.write(0x6083, 0, b"\x01\x00\x00\x00")
        assert sub.sdo.read(0x6083) == b"\x01\x00\x00\x00"
        assert sub.sdo.read(0x1008) == b"Drive"
        assert sub.sdo.read(0x1018, 4) == b"\x07\x00\x00\x00"
        with pytest.raises(SdoAbort) as caught:
            sub.sdo.write(0x6064, 0, bytes(4))
        assert caught.value.code == 0x06010002
        with pytest.raises(SdoAbort) as caught:
            sub.sdo.read(0x2100)  # an object of our own kinds of devices
        assert caught.value.code == 0x06020000


def test_sdo_information_and_complete_access_need_permission() -> None:
    box = EsiMailbox(MailboxProtocol.COE)
    with opened(replace(DRIVE, mailbox=box)) as (main, _):
        sub = main.subs[0]
        with pytest.raises(SdoAbort):
            sub.sdo.write(0x1C13, 0, b"\x00")
        with pytest.raises(CatenaryError, match="0x06010000"):
            sub.sdo.read(0x1018, complete=True)
        with pytest.raises(CatenaryError):
            sub.sdo.list()


@pytest.mark.parametrize(
    ("pdos", "code"), [((0x1A00, 0x1A01), 0x0024), ((0x1A01,), 0x001E), ((), 0)]
)
def test_excluded_pdos_are_refused_at_safe_op(pdos: tuple[int, ...], code: int) -> None:
    """0x001E: the SyncManager of allowed inputs is not configured yet."""
    with opened(replace(DRIVE, pdos=DRIVE.pdos[1:])) as (main, model):
        sub = main.subs[0]
        sub.sdo.write(0x1C13, 0, b"\x00")
        for place, pdo in enumerate(pdos, start=1):
            sub.sdo.write(0x1C13, place, struct.pack("<H", pdo))
        sub.sdo.write(0x1C13, 0, bytes([len(pdos)]))
        assert model.application.check_state(4) == code


def test_a_missing_mandatory_pdo_is_refused() -> None:
    with opened(DRIVE) as (main, model):
        main.subs[0].sdo.write(0x1C12, 0, b"\x00")
        assert model.application.check_state(4) == 0x0025


def test_a_device_without_a_mailbox_reaches_op() -> None:
    managers = (
        EsiSyncManager(0, SyncManagerUse.OUTPUTS, 0x1800, 0, control=0x64),
        EsiSyncManager(1, SyncManagerUse.INPUTS, 0x1C00, 0, control=0x20),
    )
    entry = EsiEntry(0x7000, 1, 8, "Outputs", "USINT")
    pdos = (
        EsiPdo(Direction.OUTPUT, 0x1600, "Out", (entry,), 0, fixed=True),
        EsiPdo(Direction.INPUT, 0x1A00, "In", (replace(entry, index=0x6000),), 1, fixed=True),
    )
    device = replace(DRIVE, sync_managers=managers, pdos=pdos, mailbox=None, dictionary=None)
    for configuration in ("800C", "8003"):  # the second with device emulation
        eeprom = EsiEeprom(2048, bytes.fromhex(configuration))
        with opened(replace(device, eeprom=eeprom)) as (main, model):
            data = cat.ProcessData(main.subs[0])
            with cat.Loop(data, period=2e-3) as loop:
                data.outputs[0] = 5
                model.write_object(0x6000, 1, b"\x09")
                for _ in range(3):
                    next(loop)
                assert (model.state, bytes(data.inputs)) == (8, b"\x09")
                assert model.read_object(0x7000, 1) == b"\x05"


def test_the_default_modules_are_in_place() -> None:
    entry = EsiEntry(0x6041, 0, 16, "Statusword", "UINT", depends_on_slot=True)
    pdo = EsiPdo(Direction.INPUT, 0x1A00, "Axis", (entry,), 3, depends_on_slot=True)
    axis = EsiModule(0x319800, "csp", "Axis", pdos=(pdo,))
    slots = EsiSlots(
        (
            EsiSlot("Axis 0", module_idents=(0x319800,)),
            EsiSlot("Axis 1", 1, 1, (0x319800,), default_ident=0x319800),
        ),
        pdo_increment=16,
        index_increment=0x800,
    )
    device = replace(DRIVE, pdos=(), slots=slots, modules=(axis,), dictionary=None)
    with opened(device) as (main, model):
        [found] = main.subs[0].description.input_pdos
        assert found.index == 0x1A10
        assert found.entries[0].index == 0x6841
        with cat.Loop(cat.ProcessData(main.subs[0]), period=2e-3) as loop:
            next(loop)
            assert model.state == 8


def test_an_image_that_does_not_fit_gets_a_larger_eeprom() -> None:
    small = replace(DRIVE, eeprom=EsiEeprom(256, b"\x80\x0c"))
    assert len(from_esi(small).sii_image()) == 2048


def test_an_unknown_object_is_a_lookup_error() -> None:
    with opened(DRIVE) as (_, model):
        with pytest.raises(LookupError, match="no object 0x5000:00"):
            model.read_object(0x5000)
        with pytest.raises(LookupError, match="not in a PDO"):
            model.write_object(0x1008, 0, bytes(4))


@pytest.mark.parametrize(("length", "status"), [(5, 0x04), (6, 0x12)])
def test_a_sync_manager_without_pdos_may_keep_the_length_of_the_sii(
    length: int, status: int
) -> None:
    """SOEM does so, for example with the ESI of the NI 9144."""
    manager = EsiSyncManager(0, SyncManagerUse.OUTPUTS, 0x1200, 5, control=0x64)
    device = replace(DRIVE, sync_managers=(manager,), pdos=(), mailbox=None, dictionary=None)
    main = MainDevice(Segment([from_esi(device)]))
    main.number_stations()
    main.request(STATION, 2)
    main.write(STATION, SM0, struct.pack("<HHBBBB", 0x1200, length, 0x64, 0, 1, 0))
    assert main.request(STATION, 4)[0] == status


def test_outputs_in_the_digital_output_register() -> None:
    """The SyncManager of Beckhoff's digital output terminals is at 0x0F00 (SII of the EL2004)."""
    entry = EsiEntry(0x7000, 1, 1, "Output", "BOOL")
    pdos = tuple(
        EsiPdo(Direction.OUTPUT, 0x1600 + k, "Channel", (replace(entry, index=0x7000 + k),), 0)
        for k in range(4)
    )
    manager = EsiSyncManager(0, SyncManagerUse.OUTPUTS, 0x0F00, 1, control=0x44, op_only=True)
    eeprom = EsiEeprom(2048, bytes.fromhex("040100000000000F"))
    device = replace(
        DRIVE, sync_managers=(manager,), pdos=pdos, mailbox=None, dictionary=None, eeprom=eeprom
    )
    with opened(device) as (main, model):
        data = cat.ProcessData(main.subs[0])
        with cat.Loop(data, period=2e-3) as loop:
            data.outputs[0] = 5
            for _ in range(4):
                next(loop)
            assert model.state == 8
            assert [model.read_object(0x7000 + k, 1)[0] for k in range(4)] == [1, 0, 1, 0]
            assert model.core.peek(0, 0x0F00, 1) == b"\x05"


def test_the_first_of_assigned_pdos_that_exclude_each_other_is_used() -> None:
    both = (DRIVE.pdos[0], DRIVE.pdos[1], replace(DRIVE.pdos[2], sync_manager=3))
    with opened(replace(DRIVE, pdos=both)) as (main, model):
        data = cat.ProcessData(main.subs[0])
        with cat.Loop(data, period=2e-3) as loop:
            next(loop)
            assert (model.state, len(data.inputs)) == (8, 6)


def test_a_device_may_map_more_objects_than_the_model_has() -> None:
    entries = tuple(EsiEntry(0x6000 + k // 200, k % 200 + 1, 8, "", "USINT") for k in range(200))
    more = tuple(replace(each, index=0x6100) for each in entries)
    pdos = tuple(
        EsiPdo(Direction.INPUT, 0x1A00 + k, "", part, 3) for k, part in enumerate((entries, more))
    )
    with opened(replace(DRIVE, pdos=pdos)) as (main, model):
        data = cat.ProcessData(main.subs[0])
        with cat.Loop(data, period=2e-3) as loop:
            next(loop)
            assert (model.state, len(data.inputs)) == (8, 400)


def test_a_mailbox_without_coe_reaches_op() -> None:
    device = replace(DRIVE, mailbox=EsiMailbox(MailboxProtocol.FOE | MailboxProtocol.EOE))
    with opened(device) as (main, model):
        sub = main.subs[0]
        assert sub.description.mapping_source == "SII"
        data = cat.ProcessData(sub)
        with cat.Loop(data, period=2e-3) as loop:
            next(loop)
            assert (model.state, len(data.outputs), len(data.inputs)) == (8, 4, 6)
        with pytest.raises(CatenaryError):
            sub.sdo.read(0x1000)
