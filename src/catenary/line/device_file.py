"""device.toml: identity, state, registers, mailbox and mapping of one device."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace

from catenary.line.fields import FORMAT, Document, Fields
from catenary.line.toml_text import comment, flag, listed, quoted
from catenary.line.values import ClonedAssignment, ClonedDevice, ClonedPdo, MappedEntry
from catenary.model.device import Identity, MailboxLayout
from catenary.wire.register_names import at_address
from catenary.wire.register_text import explain
from catenary.wire.sii import MailboxProtocol

PARTS = ("sii", "objects", "state")
PORTS_MAX, REGISTERS_END, BLOCK_MAX = 3, 0x1000, 64
SOURCES = ("", "CoE", "SII")
POSITION_MAX = 0xFFFF
_AREAS = ("receive_offset", "receive_size", "send_offset", "send_size")
_PROPERTIES = ("complete_access", "sdo_information", "pdo_assign", "pdo_configuration", "stated")
_KEYS = (
    *("format", "complete", "position", "name", "order", "group", "al_status", "al_status_code"),
    *("raised", "notes", "identity", "address", "topology", "missing", "mailbox", "mapping"),
    *("assignment", "registers"),
)
_IDENTITY = ("vendor", "product", "revision", "serial")
_MAPPED = re.compile(r"0x([0-9A-F]{4}):([0-9A-F]{2}) ([0-9]{1,5})")


def device_text(device: ClonedDevice) -> str:
    """Return the text of a device file."""
    return "\n".join(
        (
            f"# {comment(device.name)}, as it was when `catenary clone` read it",
            f"format = {FORMAT}",
            f"complete = {flag(device.complete)}",
            f"position = {device.position}",
            f"name = {quoted(device.name)}",
            f"order = {quoted(device.order)}",
            f"group = {quoted(device.group)}",
            f"al_status = 0x{device.al_status:04X}{_explained(0x130, device.al_status)}",
            f"al_status_code = 0x{device.al_status_code:04X}",
            f"raised = {flag(device.raised)}",
            f"notes = {listed(device.notes)}",
            *_identity_lines(device.identity),
            "\n[address]",
            f"station = 0x{device.station_address:04X}",
            f"alias = 0x{device.alias:04X}",
            *_topology_lines(device),
            *_missing_lines(device.missing),
            *_mailbox_lines(device.mailbox),
            *_mapping_lines(device),
            *_register_lines(device.registers),
            "",
        )
    )


def _explained(address: int, value: int) -> str:
    return _remark(address, value.to_bytes(2, "little"))


def _remark(address: int, data: bytes) -> str:
    """Return a comment with the name of a register and an explanation of its content."""
    found = at_address(address, len(data))
    if found is None:
        return ""
    text = explain(found, data)
    return f"  # {comment(found.name + (f': {text}' if text else ''))}"


def _identity_lines(identity: Identity | None) -> Iterator[str]:
    if identity is None:
        return
    yield "\n[identity]"
    for key, number in zip(_IDENTITY, identity, strict=True):
        yield f"{key} = 0x{number:08X}"


def _topology_lines(device: ClonedDevice) -> Iterator[str]:
    if device.parent is None or device.parent_port is None:
        return
    yield "\n[topology]"
    yield f"parent = {device.parent}"
    yield f"parent_port = {device.parent_port}"


def _missing_lines(missing: Mapping[str, str]) -> Iterator[str]:
    if missing:
        yield "\n[missing]"
    for part in PARTS:
        if part in missing:
            yield f"{part} = {quoted(missing[part])}"


def _mailbox_lines(layout: MailboxLayout | None) -> Iterator[str]:
    if layout is None:
        return
    yield "\n[mailbox]"
    for key in _AREAS:
        yield f"{key} = 0x{getattr(layout, key):04X}"
    names = ", ".join(str(each.name) for each in layout.protocols)
    yield f"protocols = 0x{layout.protocols:04X}  # {names or 'none'}"
    for key in _PROPERTIES:
        yield f"{key} = {flag(getattr(layout, key))}"


def _mapping_lines(device: ClonedDevice) -> Iterator[str]:
    if device.mapping_source:
        yield "\n[mapping]"
        yield f"source = {quoted(device.mapping_source)}"
    for assignment in device.assignments:
        yield "\n[[assignment]]"
        yield f"sync_manager = {assignment.sync_manager}"
        for pdo in assignment.pdos:
            yield "\n[[assignment.pdo]]"
            yield f"index = 0x{pdo.index:04X}"
            yield f"entries = {listed(map(str, pdo.entries))}"


def _register_lines(registers: Mapping[int, bytes]) -> Iterator[str]:
    yield "\n[registers]"
    for address, data in sorted(registers.items()):
        yield f"0x{address:04X} = {quoted(data.hex(' '))}{_remark(address, data)}"


def parse_device(text: str, file: str) -> ClonedDevice:
    """Return the device of a text, without SII and objects.

    Args:
        text: The text.
        file: Name of the file, for errors.

    Raises:
        CloneError: The text is not valid.
    """
    root = Document(file, text).root()
    root.only(_KEYS)
    address, missing = root.table("address"), _missing(root.table("missing"))
    if root.flag("complete") == bool(missing):
        raise root.error("complete", "complete must be true without [missing], and else false")
    device = ClonedDevice(
        position=root.number("position", 0, POSITION_MAX),
        name=root.text("name"),
        identity=_identity(root.table("identity")) if "identity" in root else None,
        station_address=address.number("station", 0, 0xFFFF),
        alias=address.number("alias", 0, 0xFFFF),
        al_status=root.number("al_status", 0, 0xFFFF),
        al_status_code=root.number("al_status_code", 0, 0xFFFF),
        registers=_registers(root.table("registers")),
        order=root.text("order"),
        group=root.text("group"),
        raised=root.flag("raised"),
        mailbox=_mailbox(root.table("mailbox")) if "mailbox" in root else None,
        assignments=tuple(map(_assignment, root.tables("assignment"))),
        mapping_source=_source(root.table("mapping")) if "mapping" in root else "",
        missing=missing,
        notes=root.texts("notes"),
    )
    if "topology" not in root:
        return device
    tree = root.table("topology")
    parent = tree.number("parent", 0, POSITION_MAX)
    if parent >= device.position:
        raise tree.error("parent", f"parent = {parent} must be less than {device.position}")
    return replace(device, parent=parent, parent_port=tree.number("parent_port", 0, PORTS_MAX))


def _identity(table: Fields) -> Identity:
    table.only(_IDENTITY)
    return Identity(*(table.number(key, 0, 0xFFFF_FFFF) for key in _IDENTITY))


def _missing(table: Fields) -> dict[str, str]:
    table.only(PARTS)
    return {part: table.text(part) for part in table.keys}


def _mailbox(table: Fields) -> MailboxLayout:
    table.only((*_AREAS, "protocols", *_PROPERTIES))
    receive_offset, receive_size, send_offset, send_size = (
        table.number(key, 0, 0xFFFF) for key in _AREAS
    )
    return MailboxLayout(
        *(receive_offset, receive_size, send_offset, send_size),
        MailboxProtocol(table.number("protocols", 0, 0xFFFF)),
        complete_access=table.flag("complete_access"),
        sdo_information=table.flag("sdo_information"),
        pdo_assign=table.flag("pdo_assign"),
        pdo_configuration=table.flag("pdo_configuration"),
        stated=table.flag("stated"),
    )


def _source(table: Fields) -> str:
    source = table.text("source")
    if source not in SOURCES:
        raise table.error("source", f'source = "{source}" is unknown; known: "CoE", "SII"')
    return source


def _assignment(table: Fields) -> ClonedAssignment:
    table.only(("sync_manager", "pdo"))
    pdos = tuple(map(_pdo, table.tables("pdo")))
    return ClonedAssignment(table.number("sync_manager", 0, 15), pdos)


def _pdo(table: Fields) -> ClonedPdo:
    table.only(("index", "entries"))
    entries = []
    for number, text in enumerate(table.texts("entries")):
        found = _MAPPED.fullmatch(text)
        if found is None or int(found[3]) > 0xFFFF:
            message = f'"{text}" is not an entry; example: "0x6040:00 16"'
            raise table.error("entries", message, element=number)
        entries.append(MappedEntry(int(found[1], 16), int(found[2], 16), int(found[3])))
    return ClonedPdo(table.number("index", 0, 0xFFFF), tuple(entries))


def _registers(table: Fields) -> dict[int, bytes]:
    """Return the register blocks. Blocks may not overlap, and known ones have a known length."""
    found: dict[int, bytes] = {}
    end = 0
    for key in table.keys:
        if not re.fullmatch(r"0x[0-9A-F]{4}", key):
            raise table.error(key, f"{key!r} is not an address; example: 0x0110")
        address, data = int(key, 16), table.data(key)
        if address < end:
            raise table.error(key, f"{key} overlaps the line before it, or is not ascending")
        end = address + len(data)
        if not 0 < len(data) <= BLOCK_MAX or end > REGISTERS_END:
            raise table.error(key, f"{key} has {len(data)} bytes (1 to {BLOCK_MAX}, up to 0x0FFF)")
        if at_address(address, len(data)) is None:
            raise table.error(key, f"{key} with {len(data)} bytes is not a known register")
        found[address] = data
    return found
