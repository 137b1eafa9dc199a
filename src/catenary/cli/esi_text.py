"""A device of an ESI file, as text and as values for JSON."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum

from catenary.cli.tables import table
from catenary.cli.text import escaped
from catenary.esi.device import (
    EsiDevice,
    EsiInitCommand,
    EsiMailbox,
    EsiModule,
    EsiOpMode,
    EsiPdo,
    EsiSyncManager,
)
from catenary.esi.dictionary import EsiDictionary
from catenary.esi.source import Source
from catenary.model.device import Direction

PREFIX = {Direction.OUTPUT: "RxPDO", Direction.INPUT: "TxPDO"}
UNKNOWN_SHOWN = 20
MAILBOX_FLAGS = (
    ("complete_access", "complete access"),
    ("sdo_information", "SDO information"),
    ("pdo_assign", "PDO assignment"),
    ("pdo_configuration", "PDO configuration"),
    ("pdo_upload", "PDO upload"),
    ("segmented_sdo", "segmented SDO"),
    ("data_link_layer", "data link layer"),
)


def device_lines(device: EsiDevice, *, pdos: bool, objects: bool) -> list[str]:
    """Return a device as lines of text.

    Args:
        device: The device.
        pdos: True to show the entries of the PDOs.
        objects: True to show the object dictionary.
    """
    lines = [*_identity(device), *_sync_managers(device.sync_managers)]
    lines += _pdos("PDOs", device.pdos, entries=pdos)
    lines += [*_mailbox(device.mailbox), *_op_modes(device), *_slots(device)]
    lines += _modules(device.modules, entries=pdos)
    lines += _dictionary(device.dictionary, entries=objects)
    lines += _list("diagnosis messages", _diagnosis_texts(device))
    lines += _list("elements that Catenary ignores", device.unknown)
    lines += _list("warnings", tuple(str(each) for each in device.warnings))
    return lines


def _identity(device: EsiDevice) -> list[str]:
    check = f" (CheckRevisionNo {device.revision_check})" if device.revision_check else ""
    profile = "" if device.profile is None else str(device.profile)
    clock = ", distributed clocks" if device.has_clock else ""
    values = {
        "vendor": f"0x{device.key.vendor:08X} {device.vendor_name}",
        "product": f"0x{device.key.product:08X}",
        "revision": f"0x{device.key.revision:08X}{check}",
        "file": str(device.source),
        "group": device.group,
        "profile": profile,
        "ports": f"{device.physics}{clock}" if device.physics else "",
        "replaces": ", ".join(str(each) for each in device.hides),
    }
    rows = [(name, text) for name, text in values.items() if text.strip()]
    return [escaped(f"{device.type} ({device.name})"), *table(rows).splitlines()]


def _section(title: str, rows: Sequence[Sequence[str]]) -> list[str]:
    """Return a title and an indented table; nothing without rows."""
    return ["", title, *(f"  {line}" for line in table(rows).splitlines())] if rows else []


def _list(title: str, lines: Sequence[str]) -> list[str]:
    if not lines:
        return []
    shown = [f"  {escaped(line)}" for line in lines[:UNKNOWN_SHOWN]]
    more = [f"  and {len(lines) - len(shown)} more"] if len(lines) > len(shown) else []
    return ["", f"{title}: {len(lines)}", *shown, *more]


def _diagnosis_texts(device: EsiDevice) -> list[str]:
    return [f"0x{number:04X} {text}" for number, text in sorted(device.diagnosis_texts.items())]


def _sync_managers(managers: Sequence[EsiSyncManager]) -> list[str]:
    rows = [
        (
            *(str(each.index), each.use.name.lower(), f"0x{each.start:04X}"),
            *(f"{each.default_size} bytes", f"control 0x{each.control:02X}", _flags(each)),
        )
        for each in managers
    ]
    return _section("SyncManagers", rows)


def _flags(manager: EsiSyncManager) -> str:
    sizes = f"{manager.min_size or 0} to {manager.max_size} bytes" if manager.max_size else ""
    found = (
        *("disabled" * (not manager.enabled), "virtual" * manager.virtual),
        *("OP only" * manager.op_only, sizes),
    )
    return ", ".join(filter(None, found))


def _pdos(title: str, pdos: Sequence[EsiPdo], *, entries: bool) -> list[str]:
    rows = [row for pdo in pdos for row in _pdo(pdo, entries)]
    return _section(title, rows)


def _pdo(pdo: EsiPdo, entries: bool) -> Iterator[tuple[str, ...]]:
    place = f"SM {pdo.sync_manager}" if pdo.sync_manager is not None else "-"
    index = f"{PREFIX[pdo.direction]} 0x{pdo.index:04X}"
    yield index, place, f"{pdo.bit_length} bits", _pdo_flags(pdo), pdo.name
    for entry in pdo.entries if entries else ():
        name = entry.name or ("gap" if not entry.index else "")
        shown = f"  0x{entry.index:04X}:{entry.subindex:02X}"
        yield shown, "", f"{entry.bit_length} bits", entry.type, name


def _pdo_flags(pdo: EsiPdo) -> str:
    excludes = ", ".join(f"0x{index:04X}" for index in sorted(pdo.excludes))
    found = (
        *("fixed" * pdo.fixed, "mandatory" * pdo.mandatory, "virtual" * pdo.virtual),
        f"excludes {excludes}" if excludes else "",
    )
    return ", ".join(filter(None, found))


def _mailbox(mailbox: EsiMailbox | None) -> list[str]:
    if mailbox is None:
        return []
    names = ", ".join(f"{(each.name or '')[:1]}oE" for each in mailbox.protocols) or "no protocols"
    flags = [text for name, text in MAILBOX_FLAGS if getattr(mailbox, name)]
    lines = ["", f"mailbox: {names}", *([f"  {', '.join(flags)}"] if flags else [])]
    return lines + _section("start-up objects", [_command(each) for each in mailbox.init_commands])


def _command(command: EsiInitCommand) -> tuple[str, ...]:
    place = f"0x{command.index:04X}:{command.subindex:02X}"
    return ",".join(command.transitions), place, command.data.hex(" "), command.comment


def _op_modes(device: EsiDevice) -> list[str]:
    return _section("OpModes", [_op_mode(each) for each in device.op_modes])


def _op_mode(mode: EsiOpMode) -> tuple[str, ...]:
    sync0 = f"SYNC0 {mode.sync0_ns} ns, factor {mode.sync0_factor}, shift {mode.shift_ns} ns"
    sync1 = f"SYNC1 {mode.sync1_ns} ns, factor {mode.sync1_factor}, shift {mode.sync1_shift_ns} ns"
    activate = f"AssignActivate 0x{mode.assign_activate:04X}"
    return mode.name, activate, sync0, sync1, mode.description


def _slots(device: EsiDevice) -> list[str]:
    """Return the slots, each with the modules that it accepts; the default one is marked."""
    slots = device.slots
    if slots is None:
        return []
    written = ", 0xF030 is written" * slots.download_module_idents
    title = (
        f"slots (PDO increment {slots.pdo_increment}, index increment 0x{slots.index_increment:X}"
        f"{written})"
    )
    return ["", title, *(f"  {escaped(line)}" for line in str(slots).splitlines())]


def _modules(modules: Sequence[EsiModule], *, entries: bool) -> list[str]:
    rows = [(f"0x{each.ident:08X}", each.type, each.name, str(each.source)) for each in modules]
    lines = _section("modules", rows)
    for each in modules if entries else ():
        lines += _pdos(f"PDOs of {escaped(each.type)}", each.pdos, entries=True)
    return lines


def _dictionary(dictionary: EsiDictionary | None, *, entries: bool) -> list[str]:
    if dictionary is None:
        return []
    if not entries:
        return ["", f"object dictionary: {len(dictionary.objects)} objects (--objects shows them)"]
    rows: list[tuple[str, ...]] = []
    for each in dictionary.objects.values():
        if len(each.entries) != 1:
            rows.append((f"0x{each.index:04X}", each.type, "", "", "", "", each.name))
        for entry in each.entries:
            default = entry.default.hex(" ") if entry.default is not None else ""
            name = entry.name if len(each.entries) != 1 else each.name
            rows.append(
                (
                    *(entry.place, entry.type, f"{entry.bit_length} bits", entry.access),
                    *(entry.pdo_mapping, default, name),
                )
            )
    return _section("object dictionary (defaults: bytes, little endian)", rows)


def device_values(device: EsiDevice) -> dict[str, object]:
    """Return a device as values for JSON: bytes in hexadecimal, sources as file and line."""
    found = plain(device)
    assert isinstance(found, dict)
    return found


def plain(value: object) -> object:
    """Return a value of the data model as a value for JSON."""
    if isinstance(value, bytes):
        return value.hex()
    if isinstance(value, Source):
        return {"file": value.file, "line": value.line}
    if isinstance(value, Enum):
        return value.name.lower() if isinstance(value, int) else value.value
    if is_dataclass(value) and not isinstance(value, type):
        return {each.name: plain(getattr(value, each.name)) for each in fields(value)}
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return {name: plain(each) for name, each in value._asdict().items()}
    if isinstance(value, Mapping):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, frozenset):
        return sorted(plain(each) for each in value)  # type: ignore[type-var]
    return [plain(each) for each in value] if isinstance(value, tuple) else value
