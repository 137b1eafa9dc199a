"""A drive with its ESI, and what a scan finds of a device that agrees with an ESI."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from catenary.esi.compare import compare
from catenary.esi.default_modules import with_default_modules
from catenary.esi.device import (
    DeviceKey,
    EsiDevice,
    EsiEeprom,
    EsiEntry,
    EsiMailbox,
    EsiOpMode,
    EsiPdo,
    EsiSyncManager,
)
from catenary.esi.dictionary import EsiDictionary, EsiObject, EsiObjectEntry
from catenary.esi.difference import Difference
from catenary.esi.sii import build_sii
from catenary.esi.sii_process_data import type_number
from catenary.esi.source import Source
from catenary.model.coe_facts import CoeFacts, EntryFacts
from catenary.model.describe import describe
from catenary.model.device import DeviceDescription, Direction, Identity
from catenary.wire.sii import MailboxProtocol, Sii, decode_sii
from catenary.wire.sii_categories import SyncManagerUse

INFORMATION = bytes.fromhex("1101020008080B0FFC00")
FILE = "drive.xml"


def line(number: int) -> Source:
    return Source(FILE, number)


def variable(index: int, name: str, kind: str, bits: int, access: str = "ro") -> EsiObject:
    """Return an object with one entry."""
    entry = EsiObjectEntry(index, 0, name, kind, bits, access)
    return EsiObject(index, name, kind, bits, (entry,), source=line(index))


CONTROLWORD = EsiEntry(0x6040, 0, 16, "Controlword", "UINT")
STATUSWORD = EsiEntry(0x6041, 0, 16, "Statusword", "UINT")
TARGET = EsiEntry(0x607A, 0, 32, "Target position", "DINT")
POSITION = EsiEntry(0x6064, 0, 32, "Position actual value", "DINT")
VELOCITY = EsiEntry(0x606C, 0, 32, "Velocity actual value", "DINT")
DRIVE = EsiDevice(
    DeviceKey(0xB090C0, 0xB0905030, 0x00010002),
    "Bogus",
    "B090.SO",
    "Bogus servo",
    physics="YY",
    profile=402,
    fmmus=("Outputs", "Inputs", "MBoxState"),
    sync_managers=(
        EsiSyncManager(0, SyncManagerUse.MAILBOX_OUT, 0x1000, 128, control=0x26, source=line(20)),
        EsiSyncManager(1, SyncManagerUse.MAILBOX_IN, 0x1080, 256, control=0x22, source=line(21)),
        EsiSyncManager(2, SyncManagerUse.OUTPUTS, 0x1200, 6, control=0x64, source=line(22)),
        EsiSyncManager(3, SyncManagerUse.INPUTS, 0x1400, 6, control=0x20, source=line(23)),
    ),
    pdos=(
        EsiPdo(Direction.OUTPUT, 0x1600, "Outputs", (CONTROLWORD, TARGET), 2, source=line(30)),
        EsiPdo(
            Direction.INPUT,
            0x1A00,
            "Inputs",
            (STATUSWORD, POSITION),
            3,
            fixed=True,
            source=line(40),
        ),
        EsiPdo(Direction.INPUT, 0x1A01, "Velocity", (VELOCITY,), source=line(50)),
    ),
    mailbox=EsiMailbox(
        MailboxProtocol.COE | MailboxProtocol.FOE,
        sdo_information=True,
        pdo_assign=True,
        complete_access=True,
        source=line(60),
    ),
    has_clock=True,
    op_modes=(
        EsiOpMode("FreeRun", source=line(70)),
        EsiOpMode("DC", "DC-Synchron", 0x0300, sync0_factor=1, source=line(71)),
    ),
    dictionary=EsiDictionary(
        objects={
            0x1000: variable(0x1000, "Device type", "UDINT", 32),
            0x6040: variable(0x6040, "Controlword", "UINT", 16, "rw"),
            0x6065: variable(0x6065, "Following error window", "UDINT", 32, "rw"),
        }
    ),
    eeprom=EsiEeprom(4096, bytes.fromhex("050E03440A00000034120000")),
    source=line(10),
)


class Found(NamedTuple):
    """What a scan and the object dictionary give of one device."""

    description: DeviceDescription
    sii: Sii
    coe: CoeFacts

    def against(self, esi: EsiDevice, *, coe: bool = True) -> tuple[Difference, ...]:
        """Compare with an ESI, with or without the object dictionary."""
        return compare(self.description, esi, self.sii, self.coe if coe else None)


def found(esi: EsiDevice) -> Found:
    """Return what is found of a device that agrees with an ESI."""
    image = build_sii(esi, serial=7)
    return Found(described(image, esi.has_clock), decode_sii(image), coe_facts(esi))


def described(image: bytes, clock: bool = True) -> DeviceDescription:
    """Return the description of a device with an SII."""
    return describe(
        0,
        station_address=0x1001,
        alias=0,
        dl_status=0,
        information=INFORMATION,
        image=image,
        system_time=clock,
    )


def coe_facts(esi: EsiDevice) -> CoeFacts:
    """Return the facts that an object dictionary gives if it agrees with an ESI."""
    whole = with_default_modules(esi)
    mailbox = esi.mailbox or EsiMailbox(MailboxProtocol(0))
    dictionary = whole.dictionary or EsiDictionary()
    return CoeFacts(
        identity=Identity(*esi.key, 7),
        device_type=esi.profile,
        assignments={
            manager.index: tuple(p.index for p in whole.pdos if p.sync_manager == manager.index)
            for manager in esi.sync_managers[2:]
        },
        mappings={
            pdo.index: tuple((e.index, e.subindex, e.bit_length) for e in pdo.entries)
            for pdo in whole.pdos
        },
        sdo_information=mailbox.sdo_information,
        complete_access=mailbox.complete_access,
        pdo_assign=mailbox.pdo_assign,
        indices=frozenset(dictionary.objects),
        objects={
            index: tuple(entry_facts(entry, dictionary) for entry in each.entries)
            for index, each in dictionary.objects.items()
        },
    )


def entry_facts(entry: EsiObjectEntry, dictionary: EsiDictionary) -> EntryFacts:
    return EntryFacts(
        entry.index,
        entry.subindex,
        type_number(entry.type, dictionary),
        entry.bit_length,
        entry.access in ("ro", "rw"),
        entry.access in ("wo", "rw"),
    )


def with_manager(esi: EsiDevice, index: int, **changes: object) -> EsiDevice:
    """Return an ESI with another SyncManager."""
    managers = tuple(
        replace(each, **changes) if each.index == index else each  # type: ignore[arg-type]
        for each in esi.sync_managers
    )
    return replace(esi, sync_managers=managers)


def with_pdo(esi: EsiDevice, index: int, **changes: object) -> EsiDevice:
    """Return an ESI with another PDO."""
    pdos = tuple(
        replace(each, **changes) if each.index == index else each  # type: ignore[arg-type]
        for each in esi.pdos
    )
    return replace(esi, pdos=pdos)


def with_mailbox(esi: EsiDevice, **changes: object) -> EsiDevice:
    """Return an ESI with other properties of the mailbox."""
    assert esi.mailbox is not None
    return replace(esi, mailbox=replace(esi.mailbox, **changes))  # type: ignore[arg-type]


def with_object(esi: EsiDevice, changed: EsiObject) -> EsiDevice:
    """Return an ESI with another or a further object."""
    assert esi.dictionary is not None
    objects = {**esi.dictionary.objects, changed.index: changed}
    return replace(esi, dictionary=replace(esi.dictionary, objects=objects))
