"""Modular ESI devices of the tests: a coupler with terminals, built by hand."""

from __future__ import annotations

from dataclasses import replace

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
    EsiSyncManager,
)
from catenary.esi.dictionary import EsiDictionary, EsiObject, EsiObjectEntry
from catenary.esi.source import Source
from catenary.model.device import Direction
from catenary.wire.sii import MailboxProtocol
from catenary.wire.sii_categories import SyncManagerUse

DI, DO, AI = 0x11, 0x22, 0x33


def module(ident: int, kind: str, direction: Direction, index: int, bits: int) -> EsiModule:
    """Return a module with one PDO of two entries, one object and one command, all by slot."""
    output = direction is Direction.OUTPUT
    entries = tuple(
        EsiEntry(index, sub, bits, f"Channel {sub}", "UINT", depends_on_slot=True) for sub in (1, 2)
    )
    pdo = EsiPdo(
        direction,
        0x1600 if output else 0x1A00,
        f"{kind} data",
        (*entries, EsiEntry(0, 0, 8)),
        2 if output else 3,
        fixed=True,
        depends_on_slot=True,
        source=Source("modules.xml", ident),
    )
    setting = EsiObjectEntry(0x8000, 1, "Filter", "UINT", 16, "rw")
    return EsiModule(
        ident,
        kind,
        f"{kind} terminal",
        "digital" if ident in (DI, DO) else "analog",
        (pdo,),
        (EsiInitCommand(("PS",), 0x8000, 1, b"\x05\x00", depends_on_slot=True),),
        EsiDictionary(
            objects={0x8000: EsiObject(0x8000, "Settings", "DT8000", 32, (setting,), True)}
        ),
        source=Source("modules.xml", ident),
    )


MODULES = (
    module(DI, "8 DI", Direction.INPUT, 0x6000, 8),
    module(DO, "8 DO", Direction.OUTPUT, 0x7000, 8),
    module(AI, "4 AI", Direction.INPUT, 0x6000, 16),
)
MANAGERS = (
    EsiSyncManager(0, SyncManagerUse.MAILBOX_OUT, 0x1000, 128),
    EsiSyncManager(1, SyncManagerUse.MAILBOX_IN, 0x1080, 128),
    EsiSyncManager(2, SyncManagerUse.OUTPUTS, 0x1100, control=0x64),
    EsiSyncManager(3, SyncManagerUse.INPUTS, 0x1400, control=0x20),
)
STATUS = EsiPdo(
    Direction.INPUT, 0x1AFF, "Coupler", (EsiEntry(0xF100, 1, 16, "Status", "UINT"),), 3, fixed=True
)


def coupler(*slots: EsiSlot, **facts: object) -> EsiDevice:
    """Return a coupler with slots; three slots for any terminal without arguments."""
    slots = slots or (EsiSlot("Terminals", 1, 3, (DI, DO, AI), DI),)
    device = EsiDevice(
        DeviceKey(0x5A5A, 7, 1),
        "Acme",
        "COUPLER-1",
        "Bus coupler",
        sync_managers=MANAGERS,
        pdos=(STATUS,),
        mailbox=EsiMailbox(
            MailboxProtocol.COE, sdo_information=True, pdo_assign=True, pdo_configuration=True
        ),
        slots=EsiSlots(slots, pdo_increment=1, index_increment=16),
        modules=MODULES,
        source=Source("coupler.xml", 3),
    )
    return replace(device, **facts)  # type: ignore[arg-type]
