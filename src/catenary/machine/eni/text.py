"""Text of a machine file for the devices of an ENI, for `catenary init bus.xml`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from catenary.esi.device import EsiPdo
from catenary.esi.eni.own_registers import own_reason
from catenary.esi.eni.places import PlacedVariable, place_variables
from catenary.esi.eni.settings import watchdog_of
from catenary.esi.eni.values import EniDevice, EniFile, MailboxCommand
from catenary.machine.eni.machine import DEFAULT_PERIOD, device_tables
from catenary.machine.eni.requests import clock, number_type
from catenary.machine.schema import FORMAT, DeviceTable
from catenary.machine.text import (
    DRIVES,
    FILL_IN,
    HEAD,
    comment_text,
    quoted,
    slug,
    unique_names,
)
from catenary.model.device import Direction
from catenary.plan.start_up_object import MAPPING_OBJECTS
from catenary.types import BOOL
from catenary.wire.cia402 import SLOT_OFFSET, Object

SLOTS = 8  # axes of a device, ETG.6010
WORD_BITS = 16


def eni_text(eni: EniFile) -> tuple[str, tuple[str, ...]]:
    """Return the text of a machine file, and the content of the ENI that it cannot contain.

    Args:
        eni: the file.
    """
    names = unique_names([slug(device.name, "device") for device in eni.devices])
    notes: list[str] = []
    period = _time(eni.cycle_time or DEFAULT_PERIOD)
    head = HEAD.format(mark=FILL_IN, format=FORMAT, target=quoted("eth0"))
    head = head.replace("# cat.Machine(", f"# {FILL_IN}: your interface. cat.Machine(")
    head, devices, rest = head.partition("# Devices, ")
    parts = [head.replace('period = "1 ms"', f'period = "{period}"')]
    parts += [*_reference(eni, names), devices, rest]
    for name, device, table in zip(names, eni.devices, device_tables(eni), strict=True):
        parts += _device(name, device, table, notes)
    parts += _drives(names, eni.devices)
    placed = place_variables(eni)
    by_device = placed.by_device()
    for name, device in zip(names, eni.devices, strict=True):
        if not slots_of(device):
            parts += _process_data(name, device, by_device.get(device.position, ()), notes)
    notes += [f"{eni.path}: variable {name!r}: {why}" for name, why in placed.left_out.items()]
    return "".join(parts), tuple(notes)


def slots_of(device: EniDevice) -> list[int]:
    """Return the slots of the CiA 402 axes: those with controlword and statusword."""
    found = []
    for slot in range(SLOTS):
        words = (
            (Direction.OUTPUT, Object.CONTROLWORD + SLOT_OFFSET * slot),
            (Direction.INPUT, Object.STATUSWORD + SLOT_OFFSET * slot),
        )
        if all((index, 0, WORD_BITS) in _mapped(device, direction) for direction, index in words):
            found.append(slot)
    return found


def _mapped(device: EniDevice, direction: Direction) -> set[tuple[int, int, int]]:
    """Return index, subindex and length of the mapped objects."""
    return {
        (entry.index, entry.subindex, entry.bit_length)
        for manager in device.managers(direction)
        for pdo in manager.pdos
        for entry in pdo.entries
    }


def _reference(eni: EniFile, names: Sequence[str]) -> Iterator[str]:
    if all(clock(device) is None for device in eni.devices):
        return
    for name, device in zip(names, eni.devices, strict=True):
        if device.clock is not None and device.clock.reference:
            yield f'[clocks]\nreference = "{name}"\n\n'


def _device(name: str, device: EniDevice, table: DeviceTable, notes: list[str]) -> Iterator[str]:
    numbers = {
        "vendor": device.identity.vendor,
        "product": device.identity.product,
        "revision": table.identity.revision,
        "serial": table.identity.serial,
    }
    identity = ", ".join(f"{k} = 0x{v:X}" for k, v in numbers.items() if isinstance(v, int))
    yield f"""
[[device]]                            # position {device.position}: {comment_text(device.name)}
name = "{name}"
position = {device.position}
identity = {{ {identity} }}
"""
    lines = [line for each in device.requests for line in _start_up(device, each, notes)]
    if lines:
        yield "start_up = [\n" + "".join(f"    {line},\n" for line in lines) + "]\n"
    notes += [
        f"{each.source}: {device.name}: the command at {', '.join(each.transitions)} to register "
        f"{each} = {each.data.hex(' ')} is not converted"
        for each in device.commands
        if not own_reason(each)
    ]
    if watchdog_of(device).process_data is not None:
        notes.append(
            f"{device.source}: {device.name}: the watchdog time is not converted; "
            "write `watchdog` in [loop] to change the default"
        )


def _start_up(device: EniDevice, request: MailboxCommand, notes: list[str]) -> Iterator[str]:
    """Yield the entry of a CoE command, or add a note."""
    object_ = request.download
    if object_ is not None and any(object_.index in objects for objects in MAPPING_OBJECTS):
        return
    what = f"{request.protocol} command" + f" ({request.comment})" * bool(request.comment)
    reason = _obstacle(device, request)
    if reason or object_ is None:
        notes.append(f"{request.source}: {device.name}: {what} is not converted: {reason}")
        return
    options = ", complete_access = true" if object_.complete_access else ", verify = false"
    comment = f", comment = {quoted(comment_text(request.comment))}" if request.comment else ""
    yield (
        f'{{ object = "0x{object_.index:04X}:{object_.subindex:02X}", type = "OCTET_STRING", '
        f'value = "{object_.data.hex()}", before_mapping = true{options}{comment} }}'
    )


def _obstacle(device: EniDevice, request: MailboxCommand) -> str:
    """Return the reason why a command has no place in a machine file; empty if it has one."""
    object_ = request.download
    if object_ is None:
        return f"{request.protocol} is not supported"
    if request.disabled:
        return "it is disabled"
    if request.operation != 1:
        return f"Ccs {request.operation} is not supported"
    if not {"IP", "PS"}.intersection(request.transitions):
        return f"a machine file has no commands at {', '.join(request.transitions)}"
    outputs = {place[:2] for place in _mapped(device, Direction.OUTPUT)}
    if (object_.index, object_.subindex) in outputs:
        return "it is an output of the process data"
    return (
        "complete access at this subindex"
        if object_.complete_access and (object_.subindex > 1)
        else ""
    )


def _drives(names: Sequence[str], devices: Sequence[EniDevice]) -> Iterator[str]:
    drives = [(name, device, slots_of(device)) for name, device in zip(names, devices, strict=True)]
    drives = [each for each in drives if each[2]]
    if not drives:
        return
    axes = [
        f'"{name}/{slot}"' if len(slots) > 1 else f'"{name}"'
        for name, _, slots in drives
        for slot in slots
    ]
    counts = f"# counts_per_turn = 0                  # {FILL_IN}: encoder counts per motor turn"
    yield DRIVES.format(mark=FILL_IN, axes=", ".join(axes), counts=counts)
    yield from _same(
        [f"pdos = {_written_pdos(device)}" for _, device, _ in drives], "different PDOs: add pdos"
    )
    clocks = [_clock(device) for _, device, _ in drives]
    if any(clocks):
        yield from _same(clocks, "different clocks: make a table for each")


def _same(lines: Sequence[str], otherwise: str) -> Iterator[str]:
    """Yield the line if all are equal, else a comment."""
    yield f"{lines[0]}\n" if len(set(lines)) == 1 else f"# the drives have {otherwise}\n"


def _written_pdos(device: EniDevice) -> str:
    """Return the PDOs: numbers if all are fixed, else a table with the entries."""
    pdos = [pdo for manager in device.sync_managers for pdo in manager.pdos]
    if all(pdo.fixed for pdo in pdos):
        return f"[{', '.join(f'0x{pdo.index:04X}' for pdo in pdos)}]"
    return f"{{ {', '.join(map(_with_entries, pdos))} }}"


def _with_entries(pdo: EsiPdo) -> str:
    entries = () if pdo.fixed else pdo.entries
    written = (f"[0x{each.index:04X}, {each.subindex}, {each.bit_length}]" for each in entries)
    return f'"0x{pdo.index:04X}" = [{", ".join(written)}]'


def _time(seconds: float) -> str:
    """Return a time with its nanoseconds."""
    return f"{round(seconds * 1e9) / 1000:.15g} us"


def _clock(device: EniDevice) -> str:
    request = clock(device)
    if request is None:
        return ""
    times = (("sync0", request.sync0), ("sync1", request.sync1), ("shift", request.shift))
    given = [f'{name} = "{_time(time)}"' for name, time in times if time is not None]
    given.append(f"assign_activate = 0x{request.assign_activate:04X}")
    return f"clock = {{ {', '.join(given)} }}"


def _process_data(
    name: str, device: EniDevice, variables: Sequence[PlacedVariable], notes: list[str]
) -> Iterator[str]:
    if not any(device.managers(direction) for direction in Direction):
        return
    yield f'\n[process_data.{name}]\ndevice = "{name}"\n'
    line = _clock(device)
    if line:
        yield f"{line}\n"
    channels = _channel_names(device, variables)
    for heading, direction in (("outputs", Direction.OUTPUT), ("inputs", Direction.INPUT)):
        own = [
            (channel, each)
            for channel, each in zip(channels, variables, strict=True)
            if each.variable.direction is direction
        ]
        if own:
            yield f"[process_data.{name}.{heading}]\n"
            yield from (f"{channel} = {_channel(each)}\n" for channel, each in own)
    yield f"[process_data.{name}.pdos]               # [] keeps the entries of the device\n"
    at = {
        (each.pdo, each.entry): channel for channel, each in zip(channels, variables, strict=True)
    }
    for manager in device.sync_managers:
        for pdo in manager.pdos:
            entries = [at.get((pdo.index, entry)) for entry in pdo.entries]
            known = [quoted(entry) for entry in entries if entry is not None]
            kept = pdo.fixed or len(known) < len(entries)
            if kept and not pdo.fixed:
                notes.append(
                    f"{pdo.source}: {device.name}: the entries of PDO 0x{pdo.index:04X} are not "
                    "converted, because not all have a variable; those of the device are used"
                )
            yield f'"0x{pdo.index:04X}" = [{"" if kept else ", ".join(known)}]\n'


def _channel_names(device: EniDevice, variables: Sequence[PlacedVariable]) -> list[str]:
    short = [slug(each.entry.name, "value") for each in variables]
    if len(set(short)) < len(short):
        prefix = f"{device.name}."
        short = [slug(each.variable.name.removeprefix(prefix), "value") for each in variables]
    return unique_names(short)


def _channel(placed: PlacedVariable) -> str:
    entry = placed.entry
    place = f'"0x{entry.index:04X}:{entry.subindex:02X}"'
    kind = number_type(placed.variable.data_type or entry.type, entry.bit_length)
    return place if kind is BOOL else f'{{ object = {place}, type = "{kind.name}" }}'
