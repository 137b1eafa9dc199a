"""Virtual devices with the identity, memory, PDOs and objects of an ENI."""

from __future__ import annotations

from dataclasses import replace

from catenary.esi.device import (
    DeviceKey,
    EsiDevice,
    EsiEeprom,
    EsiMailbox,
    EsiOpMode,
    EsiSyncManager,
)
from catenary.esi.dictionary import EsiDictionary, EsiObject, EsiObjectEntry
from catenary.esi.eni import EniDevice, EniFile
from catenary.model.device import Direction
from catenary.virtual import DescribedDevice, Segment, TwinOptions
from catenary.wire.sii import MailboxProtocol
from catenary.wire.sii_categories import SyncManagerUse

UNSIGNED = {1: "BOOL", 8: "USINT", 16: "UINT", 32: "UDINT"}


def segment_of(eni: EniFile) -> Segment:
    """Return a segment with one device for each device of the file."""
    return Segment([device_of(each) for each in eni.devices])


def device_of(device: EniDevice) -> DescribedDevice:
    """Return the virtual device."""
    return DescribedDevice(esi_of(device), options=TwinOptions(motor=None))


def esi_of(device: EniDevice) -> EsiDevice:
    """Return an ESI with the facts of a device in an ENI."""
    identity, box = device.identity, device.mailbox
    managers = []
    if box is not None:
        managers = [
            EsiSyncManager(
                0, SyncManagerUse.MAILBOX_OUT, box.send_start, box.send_length, control=0x26
            ),
            EsiSyncManager(
                1, SyncManagerUse.MAILBOX_IN, box.receive_start, box.receive_length, control=0x22
            ),
        ]
    for each in device.sync_managers:
        use = (
            SyncManagerUse.OUTPUTS if each.direction is Direction.OUTPUT else SyncManagerUse.INPUTS
        )
        managers.append(EsiSyncManager(each.index, use, each.start, 0, control=each.control))
    return EsiDevice(
        DeviceKey(identity.vendor, identity.product, identity.revision),
        device.name,
        device.name,
        device.name,
        physics=device.physics,
        fmmus=("Outputs", "Inputs", "MBoxState") if managers else (),
        sync_managers=tuple(managers),
        pdos=device.pdos,
        mailbox=EsiMailbox(
            MailboxProtocol.COE,
            sdo_information=True,
            pdo_assign=True,
            pdo_configuration=True,
            complete_access=True,
        )
        if box is not None
        else None,
        has_clock=True,
        op_modes=(EsiOpMode("DC", assign_activate=0x0300, sync0_factor=1),),
        dictionary=EsiDictionary(objects=_objects(device)),
        eeprom=EsiEeprom(2048, bytes.fromhex("800C8166")),
    )


def _objects(device: EniDevice) -> dict[int, EsiObject]:
    """Return the objects that PDOs map and commands write; all of them can be written."""
    lengths: dict[tuple[int, int], tuple[int, str]] = {}
    for pdo in device.pdos:
        letter = "R" if pdo.direction is Direction.OUTPUT else "T"
        for entry in pdo.entries:
            if entry.index:
                lengths[entry.index, entry.subindex] = entry.bit_length, letter
    for request in device.requests:
        command = request.download
        if command is not None and not 0x1600 <= command.index < 0x1D00:
            lengths.setdefault((command.index, command.subindex), (8 * len(command.data), ""))
    found: dict[int, list[EsiObjectEntry]] = {}
    for (index, subindex), (bits, letter) in sorted(lengths.items()):
        entries = found.setdefault(index, [])
        if subindex and not entries:
            entries.append(EsiObjectEntry(index, 0, "count", "USINT", 8))
        entries.append(
            EsiObjectEntry(
                index,
                subindex,
                f"value {subindex}",
                UNSIGNED[bits],
                bits,
                access="ro" if letter == "T" else "rw",
                pdo_mapping=letter,
                default=bytes((bits + 7) // 8),
            )
        )
    return {
        index: EsiObject(
            index,
            f"object 0x{index:04X}",
            entries[0].type,
            sum(each.bit_length for each in entries),
            (replace(entries[0], default=bytes([entries[-1].subindex])), *entries[1:])
            if len(entries) > 1
            else tuple(entries),
        )
        for index, entries in found.items()
    }
