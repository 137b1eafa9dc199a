"""Data that is written to one device between PRE-OP and SAFE-OP: SDOs, then registers.

The SDOs are written in this order: commands of the ESI (`init_commands.py`), start-up objects of
the application with `before_mapping`, the mapping, the objects of Catenary, and the other start-up
objects of the application. Commands of the ESI for the step to OP follow in SAFE-OP.

A changed mapping is written in the order of ETG.1020 §"PDO mapping": empty the assignment, empty
and fill the mapping, fill the assignment. Only differences are written. An assignment that
cannot be changed is not emptied.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, cast

from catenary.errors import ConfigurationError, MappingError
from catenary.model.device import (
    Assignment,
    DeviceDescription,
    Direction,
    Identity,
    ObjectInformation,
    Pdo,
    mapped_entries,
    mapped_pdos,
)
from catenary.model.esi_settings import IdnCommand
from catenary.model.register_command import RegisterCommand
from catenary.model.sercos_axis import SercosAxis
from catenary.plan.changes import Change, mapping_changes, value_changes
from catenary.plan.clocks import SyncPlan
from catenary.plan.download import Download
from catenary.plan.init_commands import NO_COMMANDS, Commands, choose_commands
from catenary.plan.layout import DeviceLayout
from catenary.plan.modules import ModulePlan
from catenary.plan.pdo_mapping import ASSIGNMENT_BASE, Mapping, differing
from catenary.plan.start_up_object import StartUp
from catenary.types import Scalar, by_index
from catenary.wire.register import watchdog_unit_ns

if TYPE_CHECKING:  # request.py imports NumPy, which a scan does not need
    from catenary.plan.request import DeviceRequest

BITS_MAX = 0xFF  # of an entry in a mapping object, ETG.1000.6 table 75
WATCHDOG_DIVIDER = 2498  # the controller's reset value
WATCHDOG_UNIT_NS = watchdog_unit_ns(WATCHDOG_DIVIDER)  # 100 µs


@dataclass(frozen=True, slots=True)
class DevicePlan:
    """Configuration of one device, and its expected identity."""

    position: int
    name: str
    station_address: int
    identity: Identity
    outputs: tuple[Assignment, ...]
    inputs: tuple[Assignment, ...]
    layout: DeviceLayout
    before_mapping: tuple[Download, ...]  # start-up objects of the application
    mapping: tuple[Download, ...]  # empty: unchanged
    start_up: tuple[Download, ...]  # objects of Catenary, then those of the application
    mapping_changed: bool
    watchdog_ns: int  # watchdog time of process data; 0: off
    sync: SyncPlan | None = None  # None: no SYNC signals
    changes: tuple[Change, ...] = ()  # changes by the downloads, with old and new values
    rejected: tuple[str, ...] = ()  # mappings that change less, and their obstacles
    left_out: tuple[str, ...] = ()  # optional objects that are not exchanged
    commands: Commands = NO_COMMANDS  # of the ESI, before the other objects or in SAFE-OP
    watchdog_source: str = ""  # file and line; empty if it is not from an ESI
    mapping_source: str = ""  # "CoE", "SII", "ESI FILE:LINE", or of the OpMode or named mapping
    modules: ModulePlan | None = None  # None: the device is not modular
    registers: tuple[RegisterCommand, ...] = ()  # of an ENI, sent at the transitions
    telegrams: tuple[SercosAxis, ...] = ()  # of a SERCOS device, to write; empty: unchanged
    idns: tuple[IdnCommand, ...] = ()  # of a SERCOS device, written in PRE-OP

    @property
    def downloads(self) -> tuple[Download, ...]:
        """All downloads in PRE-OP, in the order of writing."""
        own = (*self.commands.in_pre_op, *self.before_mapping, *self.mapping, *self.start_up)
        return own if self.modules is None else (*self.modules.downloads, *own)

    @property
    def watchdog_count(self) -> int:
        """Value of register 0x0420."""
        return self.watchdog_ns // WATCHDOG_UNIT_NS

    def assignments(self, direction: Direction) -> tuple[Assignment, ...]:
        return self.outputs if direction is Direction.OUTPUT else self.inputs


def make_device_plan(
    device: DeviceDescription,
    request: DeviceRequest,
    outputs: Mapping,
    inputs: Mapping,
    layout: DeviceLayout,
    watchdog_ns: int,
    sync: SyncPlan | None = None,
    watchdog_source: str = "",
) -> DevicePlan:
    """Return the plan of one device.

    Args:
        device: Description of the device.
        request: Combined request for the device, with the objects to write.
        outputs: Mapping of the outputs.
        inputs: Mapping of the inputs.
        layout: Place of the device's process data.
        watchdog_ns: Watchdog time of the process data [ns]; 0: off.
        sync: Settings of the SYNC unit; None: no SYNC signals.
        watchdog_source: File and line of the watchdog time; empty if it is not from an ESI.

    Raises:
        ConfigurationError: The device cannot have start-up objects, or the type of one is unknown.
        ValueError: The value of a start-up object is out of range.
        TypeError: The value of a start-up object does not agree with its type.
    """
    before, after = object_downloads(device, request.objects)
    mine = _own_downloads(device, request, sync)
    start_up = (*mine, *after)
    own = {(each.index, each.subindex) for each in mine}
    commands = choose_commands(device, request.objects, own, mapped_entries(outputs.assignments))
    left_out = outputs.left_out + inputs.left_out
    return DevicePlan(
        position=device.position,
        name=device.name,
        station_address=device.station_address,
        identity=device.identity,
        outputs=outputs.assignments,
        inputs=inputs.assignments,
        layout=layout,
        before_mapping=before,
        mapping=(*mapping_downloads(outputs), *mapping_downloads(inputs)),
        start_up=start_up,
        mapping_changed=outputs.changed or inputs.changed,
        watchdog_ns=watchdog_ns,
        sync=sync,
        changes=_changes(device, outputs, inputs, (*commands.written, *before, *start_up)),
        rejected=outputs.rejected + inputs.rejected,
        left_out=tuple(f"0x{each.index:04X}:{each.subindex:02X}" for each in left_out),
        commands=commands,
        watchdog_source=watchdog_source,
        mapping_source=_mapping_source(device, outputs, inputs),
        registers=device.register_commands,
        telegrams=request.telegrams,
        idns=request.idns,
    )


def _own_downloads(
    device: DeviceDescription, request: DeviceRequest, sync: SyncPlan | None
) -> tuple[Download, ...]:
    """Return the objects that Catenary writes."""
    of_sync = sync.objects if sync is not None and device.coe else ()
    return (
        *(Download(*each) for each in request.start_up),
        *(Download(*each, optional=True) for each in of_sync),
    )


def _changes(
    device: DeviceDescription, outputs: Mapping, inputs: Mapping, steps: Sequence[Download]
) -> tuple[Change, ...]:
    """Return the changes by the mapping and by other downloads.

    Whole objects (complete access) are omitted, because their present values are not read.
    """
    single = (each for each in steps if not each.complete_access)
    values = [(each.index, each.subindex, each.data) for each in single]
    return (
        *mapping_changes(device, Direction.OUTPUT, outputs),
        *mapping_changes(device, Direction.INPUT, inputs),
        *value_changes(device, values),
    )


def _mapping_source(device: DeviceDescription, outputs: Mapping, inputs: Mapping) -> str:
    """Return the source of the mapping: of its names or its OpMode, else of the description."""
    chosen = dict.fromkeys(filter(None, (outputs.source, inputs.source)))
    return ", ".join(chosen) or device.mapping_source


def object_downloads(
    device: DeviceDescription, objects: Sequence[StartUp]
) -> tuple[tuple[Download, ...], tuple[Download, ...]]:
    """Return the downloads of start-up objects before the mapping, and those after it.

    Raises:
        ConfigurationError: The device has no CoE mailbox, or the type of an object is unknown.
        ValueError: A value is out of range.
        TypeError: A value does not agree with its type.
    """
    before: list[Download] = []
    after: list[Download] = []
    for each in objects:
        (before if each.before_mapping else after).append(_object_download(device, each))
    return tuple(before), tuple(after)


def _object_download(device: DeviceDescription, requested: StartUp) -> Download:
    if not device.coe:
        raise ConfigurationError(
            f"{device}: start-up object {requested.place} cannot be written: the device has no CoE "
            "mailbox",
            hint="give start_up= only to devices with an object dictionary",
        )
    kind = requested.type
    known = device.documented_object(requested.index, requested.subindex)
    if requested.needs_type:
        kind = _dictionary_type(device, requested, known)
    return Download(
        requested.index,
        requested.subindex,
        requested.encode(kind),
        verify=requested.verify
        and not requested.complete_access
        and (known is None or known.readable),
        text=requested.text(kind),
        complete_access=requested.complete_access,
    )


def _dictionary_type(
    device: DeviceDescription, requested: StartUp, known: ObjectInformation | None
) -> Scalar:
    if known is not None and known.data_type:
        with suppress(ValueError):
            return cast(Scalar, by_index(known.data_type))
    if known is None or not known.bit_length:
        why = "the object dictionary does not describe it"
    elif known.data_type:
        why = f"its data type 0x{known.data_type:04X} is not a base data type"
    else:
        why = f"the device does not report its data type ({known.bit_length} bits)"
    raise ConfigurationError(
        f"{device}: the type of start-up object {requested.place} is unknown: {why}",
        hint="give the type from the manual, StartUp(..., type=types.UDINT), or bytes; "
        "`catenary sdo` lists the objects of a device; an ESI file may have its type",
    )


def restoring_downloads(device: DeviceDescription, plan: DevicePlan) -> tuple[Download, ...]:
    """Return the downloads that restore the mapping that the device had before the plan."""
    downloads: list[Download] = []
    for direction in Direction:
        difference = _difference(device, direction, plan.assignments(direction))
        changed = {pdo.index for pdo in difference.rewritten}
        before = device.assignments(direction)
        touched = {*difference.reassigned} | {
            each.sync_manager
            for each in plan.assignments(direction)
            if any(pdo.index in changed for pdo in each.pdos)
        }
        rewritten = tuple(pdo for pdo in device.pdos(direction) if pdo.index in changed)
        downloads += mapping_downloads(Mapping(before, rewritten, tuple(touched)))
    return tuple(downloads)


def renewed(plan: DevicePlan, device: DeviceDescription) -> DevicePlan:
    """Return the plan for a restarted device, with only the necessary mapping changes.

    Args:
        plan: Plan of the device.
        device: Description with the present mapping of the device.
    """
    mappings = [_difference(device, each, plan.assignments(each)) for each in Direction]
    written = tuple(step for mapping in mappings for step in mapping_downloads(mapping))
    return replace(
        plan,
        mapping=written,
        mapping_changed=any(mapping.changed for mapping in mappings),
    )


def compared(plan: DevicePlan, device: DeviceDescription) -> DevicePlan:
    """Return the plan with the changes of a mapping that differs from that of its description.

    Args:
        plan: Plan of the device, such as one for other modules in its slots.
        device: Description with the present mapping of the device.
    """
    changes: list[Change] = []
    for each in Direction:
        difference = _difference(device, each, plan.assignments(each))
        changes += mapping_changes(device, each, difference)
    values = (change for change in plan.changes if ":" in change.what)
    return replace(renewed(plan, device), changes=(*changes, *values))


def _difference(
    device: DeviceDescription, direction: Direction, requested: tuple[Assignment, ...]
) -> Mapping:
    now = device.assignments(direction)
    lists = {each.sync_manager: [pdo.index for pdo in each.pdos] for each in now}
    return Mapping(
        requested,
        rewritten=differing(device, direction, mapped_pdos(requested)),
        reassigned=tuple(
            each.sync_manager
            for each in requested
            if lists.get(each.sync_manager, []) != [pdo.index for pdo in each.pdos]
        ),
    )


def mapping_downloads(mapping: Mapping) -> tuple[Download, ...]:
    """Return the downloads that write a mapping; empty if the device already has it."""
    rewritten = {pdo.index for pdo in mapping.rewritten}
    downloads: list[Download] = []
    for assignment in mapping.assignments:
        touched = assignment.sync_manager in mapping.reassigned or any(
            pdo.index in rewritten for pdo in assignment.pdos
        )
        if not touched:
            continue
        contents = [
            step
            for pdo in assignment.pdos
            if pdo.index in rewritten
            for step in _pdo_downloads(pdo)
        ]
        keeps_list = assignment.fixed and assignment.sync_manager not in mapping.reassigned
        downloads += contents if keeps_list else _assignment_downloads(assignment, contents)
    return tuple(downloads)


def _assignment_downloads(assignment: Assignment, contents: Sequence[Download]) -> list[Download]:
    index = ASSIGNMENT_BASE + assignment.sync_manager
    ranks = enumerate(assignment.pdos, start=1)
    return [
        Download(index, 0, b"\x00"),
        *contents,
        *(Download(index, rank, struct.pack("<H", pdo.index)) for rank, pdo in ranks),
        Download(index, 0, bytes([len(assignment.pdos)])),
    ]


def _pdo_downloads(pdo: Pdo) -> list[Download]:
    downloads = [Download(pdo.index, 0, b"\x00")]
    for rank, entry in enumerate(pdo.entries, start=1):
        if entry.bit_length > BITS_MAX:
            raise MappingError(
                f"PDO 0x{pdo.index:04X} cannot be written: {entry} is longer than {BITS_MAX} bits",
                hint="split it into several entries, or keep the entries of the device",
            )
        word = entry.index << 16 | entry.subindex << 8 | entry.bit_length
        downloads.append(Download(pdo.index, rank, struct.pack("<I", word), entry))
    downloads.append(Download(pdo.index, 0, bytes([len(pdo.entries)])))
    return downloads
