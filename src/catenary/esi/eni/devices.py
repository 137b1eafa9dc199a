"""Devices of an ENI (`Config/Slave`)."""

from __future__ import annotations

from catenary.esi.device import EsiEntry, EsiPdo
from catenary.esi.eni.commands import MILLISECOND, read_mailbox_commands, read_register_commands
from catenary.esi.eni.fields import Fields
from catenary.esi.eni.values import EniClock, EniDevice, EniMailbox, EniSyncManager, ImagePart
from catenary.esi.xml import Element
from catenary.model.device import Direction, Identity

DIRECTIONS = {"RxPdo": Direction.OUTPUT, "TxPdo": Direction.INPUT}
TYPES = {"Outputs": Direction.OUTPUT, "Inputs": Direction.INPUT}
MAILBOX_TYPES = ("MBoxOut", "MBoxIn")
SYNC_MANAGERS = 16
NANOSECOND = 1e-9


def read_devices(config: Element, fields: Fields) -> tuple[EniDevice, ...]:
    """Return the devices in the order of their positions.

    Raises:
        MachineFileError: A value is missing or faulty, or two devices have the same position.
    """
    slaves = config.all("Slave")
    if not slaves:
        fields.refuse(config, "Config has no Slave")
    found = [(_device(each, fields), each) for each in slaves]
    found.sort(key=lambda pair: pair[0].position)
    for position, (device, element) in enumerate(found):
        if device.position != position:
            fields.refuse(
                element,
                f"AutoIncAddr is position {device.position}, expected {position}; the positions "
                "must be 0, 1, 2 ... without gaps",
                tag="Info",
            )
    return tuple(device for device, _ in found)


def _device(element: Element, fields: Fields) -> EniDevice:
    info = fields.child(element, "Info")
    hot = element.find("HotConnect")
    if hot is not None:
        fields.refuse(
            hot,
            "hot-connect groups are not supported",
            hint="export the ENI without hot-connect groups, or convert it with `catenary init` "
            "and write `required = false`",
        )
    process_data = element.find("ProcessData")
    pdos = () if process_data is None else _pdos(process_data, fields)
    mailbox = element.find("Mailbox")
    return EniDevice(
        name=fields.text(info, "Name", required=True),
        position=-fields.signed(info, "AutoIncAddr", bits=16) & 0xFFFF,
        station_address=fields.number(info, "PhysAddr", bits=16, default=0),
        identity=Identity(
            fields.number(info, "VendorId"),
            fields.number(info, "ProductCode"),
            fields.number(info, "RevisionNo", default=0),
            fields.number(info, "SerialNo", default=0),
        ),
        physics=fields.text(info, "Physics"),
        outputs=_parts(process_data, "Send", fields),
        inputs=_parts(process_data, "Recv", fields),
        sync_managers=_sync_managers(process_data, pdos, fields),
        pdos=pdos,
        mailbox=None if mailbox is None else _mailbox(mailbox, fields),
        requests=() if mailbox is None else read_mailbox_commands(mailbox, fields),
        commands=read_register_commands(element, fields),
        clock=_clock(element.find("DC"), fields),
        previous=_previous(element, fields),
        source=fields.source(element),
    )


def _parts(process_data: Element | None, tag: str, fields: Fields) -> tuple[ImagePart, ...]:
    if process_data is None:
        return ()
    parts = (
        ImagePart(fields.number(each, "BitStart"), fields.number(each, "BitLength"))
        for each in process_data.all(tag)
    )
    return tuple(part for part in parts if part.bit_length)


def _pdos(process_data: Element, fields: Fields) -> tuple[EsiPdo, ...]:
    return tuple(_pdo(each, fields) for each in process_data.all(*DIRECTIONS))


def _pdo(element: Element, fields: Fields) -> EsiPdo:
    manager = "@Sm" if "Sm" in element.attributes else ""
    return EsiPdo(
        direction=DIRECTIONS[element.tag],
        index=fields.number(element, "Index", bits=16),
        name=fields.text(element, "Name"),
        entries=tuple(_entry(each, fields) for each in element.all("Entry")),
        sync_manager=fields.number(element, manager, bits=8) if manager else None,
        fixed=fields.flag(element, "@Fixed"),
        mandatory=fields.flag(element, "@Mandatory"),
        excludes=frozenset(_numbers(element, "Exclude", fields)),
        source=fields.source(element),
    )


def _entry(element: Element, fields: Fields) -> EsiEntry:
    return EsiEntry(
        index=fields.number(element, "Index", bits=16),
        subindex=fields.number(element, "SubIndex", bits=8, default=0),
        bit_length=fields.number(element, "BitLen", bits=16),
        name=fields.text(element, "Name"),
        type=fields.text(element, "DataType"),
        comment=fields.text(element, "Comment"),
    )


def _numbers(parent: Element, tag: str, fields: Fields) -> list[int]:
    """Return the numbers in all children with a tag."""
    return [
        fields.number(Element(parent.tag, {}, "", (each,), each.line), tag, bits=16)
        for each in parent.all(tag)
    ]


def _sync_managers(
    process_data: Element | None, pdos: tuple[EsiPdo, ...], fields: Fields
) -> tuple[EniSyncManager, ...]:
    if process_data is None:
        return ()
    managers: list[EniSyncManager] = []
    assigned: set[int] = set()
    for index in range(SYNC_MANAGERS):
        element = process_data.find(f"Sm{index}")
        if element is None or fields.text(element, "Type") in MAILBOX_TYPES:
            continue
        manager = _sync_manager(index, element, pdos, fields)
        for pdo in manager.pdos:
            if pdo.index in assigned:
                fields.refuse(element, f"PDO 0x{pdo.index:04X} is assigned twice", tag="Pdo")
            assigned.add(pdo.index)
        managers.append(manager)
    return tuple(managers)


def _sync_manager(
    index: int, element: Element, pdos: tuple[EsiPdo, ...], fields: Fields
) -> EniSyncManager:
    kind = fields.text(element, "Type", required=True)
    if kind not in TYPES:
        fields.refuse(element, f"{kind!r} is neither Outputs nor Inputs", tag="Type")
    direction = TYPES[kind]
    known = {pdo.index: pdo for pdo in pdos if pdo.direction is direction}
    indices = _numbers(element, "Pdo", fields)
    for pdo in indices:
        if pdo not in known:
            fields.refuse(element, f"PDO 0x{pdo:04X} is not described", tag="Pdo")
    if not indices:
        indices = [pdo.index for pdo in known.values() if pdo.sync_manager == index]
    return EniSyncManager(
        index=index,
        direction=direction,
        start=fields.number(element, "StartAddress", bits=16),
        control=fields.number(element, "ControlByte", bits=8),
        enabled=fields.flag(element, "Enable"),
        pdos=tuple(known[pdo] for pdo in indices),
        source=fields.source(element),
    )


def _mailbox(element: Element, fields: Fields) -> EniMailbox:
    send, receive = fields.child(element, "Send"), fields.child(element, "Recv")
    has_poll = receive.find("PollTime") is not None
    has_bit = receive.find("StatusBitAddr") is not None
    return EniMailbox(
        send_start=fields.number(send, "Start", bits=16),
        send_length=fields.number(send, "Length", bits=16),
        receive_start=fields.number(receive, "Start", bits=16),
        receive_length=fields.number(receive, "Length", bits=16),
        protocols=tuple(each.text.strip() for each in element.all("Protocol")),
        poll_time=fields.number(receive, "PollTime") * MILLISECOND if has_poll else None,
        status_bit=fields.number(receive, "StatusBitAddr", bits=64) if has_bit else None,
        source=fields.source(element),
    )


def _clock(element: Element | None, fields: Fields) -> EniClock | None:
    if element is None:
        return None
    return EniClock(
        reference=fields.flag(element, "ReferenceClock"),
        potential_reference=fields.flag(element, "PotentialReferenceClock"),
        sync0=fields.number(element, "CycleTime0", default=0) * NANOSECOND,
        sync1=fields.number(element, "CycleTime1", default=0) * NANOSECOND,
        shift=fields.signed(element, "ShiftTime") * NANOSECOND,
        source=fields.source(element),
    )


def _previous(element: Element, fields: Fields) -> tuple[int, str] | None:
    ports = element.all("PreviousPort")
    chosen = [each for each in ports if fields.flag(each, "@Selected")] or list(ports)
    if not chosen:
        return None
    return fields.number(chosen[0], "PhysAddr", bits=16), fields.text(chosen[0], "Port")
