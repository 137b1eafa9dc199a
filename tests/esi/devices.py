"""EsiDevice values built by hand, for the devices of `tests.plan.devices`."""

from __future__ import annotations

from dataclasses import replace

from catenary.esi.device import (
    DeviceKey,
    EsiDevice,
    EsiEntry,
    EsiInitCommand,
    EsiMailbox,
    EsiMapping,
    EsiOpMode,
    EsiPdo,
    EsiSyncManager,
)
from catenary.esi.dictionary import EsiDataType, EsiDictionary, EsiObject, EsiObjectEntry
from catenary.esi.source import Source
from catenary.model.device import Direction
from catenary.wire.sii import MailboxProtocol
from catenary.wire.sii_categories import SyncManagerUse

FILE = "drive.xml"
OUTPUTS = (
    EsiEntry(0x6040, 0, 16, "Controlword", "UINT"),
    EsiEntry(0x6060, 0, 8, "Modes of operation", "SINT"),
    EsiEntry(0x607A, 0, 32, "Target position", "DINT"),
)
INPUTS = (
    EsiEntry(0x6041, 0, 16, "Statusword", "UINT"),
    EsiEntry(0x6061, 0, 8, "Modes of operation display", "SINT"),
    EsiEntry(0x6064, 0, 32, "Position actual value", "DINT"),
)
TORQUE = EsiEntry(0x6077, 0, 16, "Torque actual value", "INT")


def at(line: int) -> Source:
    return Source(FILE, line)


def rx(index: int, name: str, line: int, sm: int | None = None, **rules: object) -> EsiPdo:
    return _pdo(Direction.OUTPUT, index, name, OUTPUTS, line, sm, rules)


def tx(index: int, name: str, line: int, sm: int | None = None, **rules: object) -> EsiPdo:
    entries = rules.pop("entries", INPUTS)
    return _pdo(Direction.INPUT, index, name, entries, line, sm, rules)


def _pdo(
    direction: Direction,
    index: int,
    name: str,
    entries: object,
    line: int,
    sm: int | None,
    rules: dict[str, object],
) -> EsiPdo:
    return EsiPdo(
        direction,
        index,
        name,
        entries,  # type: ignore[arg-type]
        sync_manager=sm,
        source=at(line),
        **rules,  # type: ignore[arg-type]
    )


def command(
    line: int, index: int, data: bytes, *transitions: str, **more: object
) -> EsiInitCommand:
    return EsiInitCommand(transitions or ("PS",), index, 0, data, source=at(line), **more)  # type: ignore[arg-type]


MODES = (
    EsiOpMode("SM-Synchron", "SM", source=at(60)),
    EsiOpMode("DC", "DC-Synchron", 0x0300, sync0_factor=1, source=at(64)),
    EsiOpMode("DC half", "", 0x0700, sync0_factor=-2, sync1_factor=-1, source=at(70)),
)
TYPES = {
    "Mode_T": EsiDataType("Mode_T", 8, base="SINT", enumeration={8: "CSP", 9: "CSV"}),
}


def entry(index: int, subindex: int, name: str, kind: str, bits: int, **more: object) -> object:
    return EsiObjectEntry(index, subindex, name, kind, bits, **more)  # type: ignore[arg-type]


DICTIONARY = EsiDictionary(
    TYPES,
    {
        each.index: EsiObject(each.index, each.name, each.type, each.bit_length, (each,))
        for each in (
            EsiObjectEntry(0x6060, 0, "Modes of operation", "Mode_T", 8, "rw", "R"),
            EsiObjectEntry(0x6064, 0, "Position actual value", "DINT", 32, "ro", "T"),
            EsiObjectEntry(0x2000, 0, "Temperature", "REAL", 32, "ro", "", unit=0x002D0000),
            EsiObjectEntry(0x2010, 0, "Filter time", "UINT", 16, "rw", unit=0xFD030000),
        )
    },
)


def servo() -> EsiDevice:
    """Return an ESI for `tests.plan.devices.servo(0)`: another mapping, modes, and commands."""
    return EsiDevice(
        DeviceKey(0x1234, 0, 1),
        "Vendor",
        "SRV-1",
        "Servo drive",
        sync_managers=(
            EsiSyncManager(0, SyncManagerUse.MAILBOX_OUT, 0x1000, 128, source=at(20)),
            EsiSyncManager(1, SyncManagerUse.MAILBOX_IN, 0x1080, 128, source=at(21)),
            EsiSyncManager(2, SyncManagerUse.OUTPUTS, 0x1100, 7, control=0x64, source=at(22)),
            EsiSyncManager(3, SyncManagerUse.INPUTS, 0x1400, 7, control=0x20, source=at(23)),
        ),
        pdos=(
            rx(0x1600, "Outputs", 30, 2),
            rx(0x1601, "Outputs fixed", 32, fixed=True, excludes=frozenset({0x1600})),
            tx(0x1A00, "Inputs", 40, 3),
            tx(0x1A01, "Inputs compact", 44, excludes=frozenset({0x1A00})),
            tx(0x1A02, "Torque", 46, entries=(TORQUE,)),
        ),
        mailbox=EsiMailbox(
            MailboxProtocol.COE, pdo_assign=True, pdo_configuration=True, source=at(50)
        ),
        has_clock=True,
        op_modes=MODES,
        dictionary=DICTIONARY,
        alternative_mappings=(
            EsiMapping("Compact", False, ((2, (0x1601,)), (3, (0x1A01, 0x1A02))), source=at(80)),
        ),
        source=at(10),
    )


def with_commands(*commands: EsiInitCommand) -> EsiDevice:
    device = servo()
    assert device.mailbox is not None
    return replace(device, mailbox=replace(device.mailbox, init_commands=commands))
