"""Device descriptions from the data of the kernel master, in the form that Catenary's scan returns.

libethercat does not report everything: entries have no names or types, and SyncManagers have no
addresses. The master itself chooses the addresses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from catenary.errors import MailboxError, SdoAbort
from catenary.igh import abi
from catenary.igh.failures import NoMailboxError
from catenary.igh.reservation import Reservation
from catenary.model.describe import assignments
from catenary.model.device import (
    DeviceDescription,
    Entry,
    Identity,
    MailboxLayout,
    ObjectInformation,
    Pdo,
    SyncManager,
)
from catenary.model.module import CONFIGURED_IDENTS, DETECTED_IDENTS
from catenary.model.text import printable
from catenary.wire.features import Feature, Information, PortKind
from catenary.wire.sii import MailboxProtocol
from catenary.wire.sii_categories import SyncManagerUse

DEVICE_TYPE, MODULE_PROFILES = 0x1000, 0xF010
STATUSWORD, SLOT_STRIDE, SLOTS_MAX = 0x6041, 0x800, 16
PROFILE_DRIVE, PROFILE_MODULAR = 402, 5001
ATTEMPTS = 3
MAILBOXES = 2  # SyncManagers 0 and 1 of a device with a mailbox
STATION_BASE = 0x03E9  # 1001, as in Catenary's scan: libethercat does not report station addresses

# The master assigns the FMMUs; FMMU_BYTE_ORIENTED stops the plan from assigning one to the mailbox.
CONTROLLER = Information(
    type=0,
    revision=0,
    build=0,
    fmmu_count=abi.SYNC_MANAGERS_MAX,
    sync_manager_count=abi.SYNC_MANAGERS_MAX,
    ram_size=0,
    ports=(PortKind.MII, PortKind.MII, PortKind.ABSENT, PortKind.ABSENT),
    features=Feature.DISTRIBUTED_CLOCKS
    | Feature.DISTRIBUTED_CLOCKS_64_BIT
    | Feature.FMMU_BYTE_ORIENTED,
)
MAILBOX = MailboxLayout(0, 0, 0, 0, MailboxProtocol.COE, pdo_assign=True, pdo_configuration=True)


def describe(master: Reservation, position: int) -> DeviceDescription:
    """Return the description of one device.

    Args:
        master: The reserved master.
        position: The position of the device.
    """
    info = master.slave(position)
    syncs = [master.sync_manager(position, index) for index in range(info.sync_count)]
    mailbox = _may_have_mailbox(syncs)
    device_type = read_if_there(master, position, DEVICE_TYPE) if mailbox else None
    coe = device_type is not None
    managers, outputs, inputs = _process_data(master, position, syncs, coe)
    number = None if not device_type else int.from_bytes(device_type[:4], "little")
    identity = Identity(info.vendor_id, info.product_code, info.revision_number, info.serial_number)
    name = printable(info.name.decode("latin-1"))
    links = [bool(port.link.link_up) for port in info.ports]
    return DeviceDescription(
        position=position,
        station_address=STATION_BASE + position,
        alias=info.alias,
        identity=identity,
        name=name or f"0x{identity.vendor:08X}:0x{identity.product:08X}",
        controller=CONTROLLER,
        mailbox=MAILBOX if coe else None,
        sync_managers=managers,
        outputs=assignments(outputs),
        inputs=assignments(inputs),
        output_pdos=outputs,
        input_pdos=inputs,
        open_ports=(links[0], links[1], links[2], links[3]),
        system_time=any(
            port.receive_time for port in info.ports
        ),  # latched by devices with a clock
        device_type=number,
        slots=_slots(master, position, number),
        mapping_source="IgH master",
    )


def read_if_there(
    master: Reservation, position: int, index: int, subindex: int = 0
) -> bytes | None:
    """Read an object that may be absent.

    The upload is repeated after a missing reply, because the master does not repeat lost frames.

    Args:
        master: The reserved master.
        position: The position of the device.
        index: Index of the object.
        subindex: Subindex of the object.

    Returns:
        The data, empty if the device refuses the upload; None if it does not support CoE.

    Raises:
        MailboxError: The device did not answer in any attempt.
    """
    for attempt in range(ATTEMPTS):
        try:
            return master.upload(position, index, subindex)
        except SdoAbort:
            return b""
        except NoMailboxError:
            return None
        except MailboxError:
            if attempt + 1 == ATTEMPTS:
                raise
    return None


def with_module_lists(master: Reservation, device: DeviceDescription) -> DeviceDescription:
    """Return the description of a modular device with 0xF050 and 0xF030.

    Args:
        master: The reserved master.
        device: The description; returned unchanged if it is not modular or has no CoE mailbox.

    Raises:
        MailboxError: The device did not answer.
    """
    if device.modular is None or not device.coe:
        return device
    detected, configured = (
        _read_idents(master, device.position, index)
        for index in (DETECTED_IDENTS, CONFIGURED_IDENTS)
    )
    modular = replace(device.modular, detected=detected, configured=configured)
    return replace(device, modular=modular)


def _read_idents(master: Reservation, position: int, index: int) -> tuple[int, ...] | None:
    count = read_if_there(master, position, index)
    if not count:
        return None
    data = (read_if_there(master, position, index, k + 1) or b"" for k in range(count[0]))
    return tuple(int.from_bytes(each[:4], "little") for each in data)


def object_information(
    master: Reservation, position: int, index: int, subindex: int
) -> ObjectInformation:
    """Return the length of an object, measured by reading it.

    Args:
        master: The reserved master.
        position: The position of the device.
        index: Index of the object.
        subindex: Subindex of the object.

    Returns:
        The description of the object; its bit length is 0 if the object is absent.
    """
    data = read_if_there(master, position, index, subindex)
    return ObjectInformation(index, subindex, 8 * len(data or b""))


def _may_have_mailbox(syncs: Sequence[abi.SyncInfo]) -> bool:
    """Return True if the first two SyncManagers carry no PDOs.

    For an SDO upload from a device without a mailbox, libethercat prints an error on stderr, and
    the kernel writes one to its log.
    """
    directions = [sync.dir for sync in syncs[:MAILBOXES] if not sync.n_pdos]
    return directions == [abi.DIRECTION_OUTPUT, abi.DIRECTION_INPUT]


def _process_data(
    master: Reservation, position: int, syncs: Sequence[abi.SyncInfo], coe: bool
) -> tuple[tuple[SyncManager, ...], tuple[Pdo, ...], tuple[Pdo, ...]]:
    """Return the SyncManagers, the output PDOs and the input PDOs."""
    managers = []
    pdos: dict[SyncManagerUse, list[Pdo]] = {SyncManagerUse.OUTPUTS: [], SyncManagerUse.INPUTS: []}
    for index, sync in enumerate(syncs):
        use = SyncManagerUse.OUTPUTS
        if sync.dir == abi.DIRECTION_INPUT:
            use = SyncManagerUse.INPUTS
        if coe and index < MAILBOXES:
            use = SyncManagerUse(index + 1)
        else:
            pdos[use] += _pdos(master, position, index, sync.n_pdos)
        managers.append(SyncManager(index, use, start=0, length=0, control=0))
    outputs, inputs = pdos.values()
    return tuple(managers), tuple(outputs), tuple(inputs)


def _pdos(master: Reservation, position: int, index: int, count: int) -> list[Pdo]:
    found = []
    for rank in range(count):
        pdo = master.pdo(position, index, rank)
        entries = (master.pdo_entry(position, index, rank, e) for e in range(pdo.n_entries))
        found.append(Pdo(pdo.index, tuple(_entry(entry) for entry in entries), index))
    return found


def _entry(info: abi.PdoEntryInfo) -> Entry:
    name = f"0x{info.index:04X}:{info.subindex:02X}" if info.index else ""
    return Entry(info.index, info.subindex, info.bit_length, name)


def _slots(master: Reservation, position: int, device_type: int | None) -> tuple[int, ...]:
    """Return the slots of the CiA 402 axes, by the rules of `procedure/profile.py`."""
    profile = 0 if device_type is None else device_type & 0xFFFF
    if profile == PROFILE_DRIVE:
        there = [0]
        while len(there) < SLOTS_MAX and read_if_there(
            master, position, STATUSWORD + SLOT_STRIDE * len(there)
        ):
            there.append(len(there))
        return tuple(there)
    if profile != PROFILE_MODULAR:
        return ()
    count = read_if_there(master, position, MODULE_PROFILES) or b"\0"
    profiles = [
        read_if_there(master, position, MODULE_PROFILES, slot + 1) or b""
        for slot in range(min(count[0], SLOTS_MAX))
    ]
    return tuple(
        slot
        for slot, data in enumerate(profiles)
        if int.from_bytes(data[:2], "little") == PROFILE_DRIVE
    )
