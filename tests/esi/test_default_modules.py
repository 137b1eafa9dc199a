"""Modular devices with the modules of their default configuration."""

from __future__ import annotations

from dataclasses import replace

from catenary.esi.default_modules import with_default_modules
from catenary.esi.device import (
    DeviceKey,
    EsiDevice,
    EsiEntry,
    EsiInitCommand,
    EsiMailbox,
    EsiModule,
    EsiPdo,
    EsiSlot,
    EsiSlots,
)
from catenary.esi.dictionary import EsiDataType, EsiDictionary, EsiObject, EsiObjectEntry
from catenary.model.device import Direction
from catenary.wire.sii import MailboxProtocol

STATUS = EsiObject(
    0x6041,
    "Statusword",
    "UINT",
    16,
    (EsiObjectEntry(0x6041, 0, "Statusword", "UINT", 16),),
    depends_on_slot=True,
)
AXIS = EsiModule(
    0x319800,
    "csp",
    "Axis",
    pdos=(
        EsiPdo(
            Direction.INPUT,
            0x1A00,
            "Inputs",
            (
                EsiEntry(0x6041, 0, 16, depends_on_slot=True),
                EsiEntry(0x2000, 0, 8),
                EsiEntry(0, 0, 8, depends_on_slot=True),
            ),
            3,
            depends_on_slot=True,
            excludes=frozenset({0x1A01}),
            excludes_depend_on_slot=True,
        ),
    ),
    init_commands=(
        EsiInitCommand(("PS",), 0x6060, 0, b"\x08", depends_on_slot=True),
        EsiInitCommand(("PS",), 0x2001, 0, b"\x01"),
    ),
    dictionary=EsiDictionary({"UINT": EsiDataType("UINT", 16)}, {0x6041: STATUS}),
)
DEVICE = EsiDevice(
    DeviceKey(1, 2, 3),
    "Vendor",
    "MDP",
    "Modular drive",
    mailbox=EsiMailbox(MailboxProtocol.COE),
    slots=EsiSlots(
        (
            EsiSlot("Axis 0", 1, 1, (0x319800,), default_ident=0x319800),
            EsiSlot("Spare", 0, 2, (0x319800,)),
            EsiSlot("Axis 3", 0, 1, (0x319800,), default_ident=0x319800),
        ),
        pdo_increment=16,
        index_increment=0x800,
    ),
    modules=(AXIS,),
)


def test_indices_increase_by_the_slot() -> None:
    device = with_default_modules(DEVICE)
    first, second = device.pdos
    assert (first.index, second.index) == (0x1A00, 0x1A30)
    assert [entry.index for entry in second.entries] == [0x7841, 0x2000, 0]
    assert second.excludes == {0x1A31}
    assert device.slots is None


def test_objects_and_commands_come_from_the_modules() -> None:
    device = with_default_modules(DEVICE)
    assert device.dictionary is not None
    assert device.mailbox is not None
    assert set(device.dictionary.objects) == {0x6041, 0x7841}
    assert device.dictionary.entry(0x7841) is not None
    assert "UINT" in device.dictionary.types
    indices = [command.index for command in device.mailbox.init_commands]
    assert indices == [0x6060, 0x2001, 0x7860, 0x2001]


def test_increments_of_a_slot_take_precedence() -> None:
    slot = EsiSlot("S", 1, 1, (1,), 0x319800, pdo_increment=1, index_increment=2)
    slots = EsiSlots((EsiSlot("empty"), slot), pdo_increment=16, index_increment=0x800)
    [pdo] = with_default_modules(replace(DEVICE, slots=slots)).pdos
    assert (pdo.index, pdo.entries[0].index) == (0x1A01, 0x6043)


def test_absurd_numbers_of_instances_are_bounded() -> None:
    slot = EsiSlot("S", 10**9, 10**9, (1,), 0x319800)
    device = with_default_modules(replace(DEVICE, slots=EsiSlots((slot, slot), None, 1, 1)))
    assert len(device.pdos) == 255


def test_a_device_without_default_modules_is_unchanged() -> None:
    for slots in (None, EsiSlots(), EsiSlots((EsiSlot("S", default_ident=7),))):
        device = replace(DEVICE, slots=slots)
        assert with_default_modules(device) is device
