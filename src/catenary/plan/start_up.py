"""What is written to one device between PRE-OP and SAFE-OP: SDOs, then registers.

The order inside a changed mapping is the one of ETG.1020 §"PDO mapping": empty the assignment,
empty and fill the mapping, fill the assignment. Only what differs is written. An assignment that
cannot be changed is not emptied.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace

from catenary.model.device import Assignment, DeviceDescription, Direction, Entry, Identity, Pdo
from catenary.plan.changes import Change, mapping_changes, value_changes
from catenary.plan.clocks import SyncPlan
from catenary.plan.layout import DeviceLayout
from catenary.plan.pdo_mapping import ASSIGNMENT_BASE, Mapping, shape
from catenary.wire.register import watchdog_unit_ns

WATCHDOG_DIVIDER = 2498  # the controller's reset value
WATCHDOG_UNIT_NS = watchdog_unit_ns(WATCHDOG_DIVIDER)  # 100 µs


@dataclass(frozen=True, slots=True)
class Download:
    """One SDO download. `entry`: what is being mapped by it, for the error that names it."""

    index: int
    subindex: int
    data: bytes
    entry: Entry | None = None
    optional: bool = False  # a device that has no such object, or one that is fixed, is left alone


@dataclass(frozen=True, slots=True)
class DevicePlan:
    """All that one device is told, and what it is expected to be."""

    position: int
    name: str
    station_address: int
    identity: Identity
    outputs: tuple[Assignment, ...]
    inputs: tuple[Assignment, ...]
    layout: DeviceLayout
    downloads: tuple[Download, ...]
    start_up: tuple[Download, ...]  # the last of the downloads: what wishes asked for
    mapping_changed: bool  # the downloads begin with a new mapping
    watchdog_ns: int  # of process data; 0: off
    sync: SyncPlan | None = None  # None: no SYNC signals
    changes: tuple[Change, ...] = ()  # what the downloads change, with old and new values
    rejected: tuple[str, ...] = ()  # mappings that change less, and why each failed
    left_out: tuple[str, ...] = ()  # optional objects that are not exchanged

    @property
    def new_mapping(self) -> tuple[Download, ...]:
        """The first downloads: the new mapping."""
        return self.downloads[: len(self.downloads) - len(self.start_up)]

    @property
    def watchdog_count(self) -> int:
        """Value of register 0x0420."""
        return self.watchdog_ns // WATCHDOG_UNIT_NS

    def assignments(self, direction: Direction) -> tuple[Assignment, ...]:
        return self.outputs if direction is Direction.OUTPUT else self.inputs


def make_device_plan(
    device: DeviceDescription,
    outputs: Mapping,
    inputs: Mapping,
    layout: DeviceLayout,
    start_up: Sequence[tuple[int, int, bytes]],
    watchdog_ns: int,
    sync: SyncPlan | None = None,
) -> DevicePlan:
    wished = tuple(Download(index, subindex, data) for index, subindex, data in start_up)
    told = sync.objects if sync is not None and device.coe else ()
    clocks = tuple(Download(*each, optional=True) for each in told)
    return DevicePlan(
        position=device.position,
        name=device.name,
        station_address=device.station_address,
        identity=device.identity,
        outputs=outputs.assignments,
        inputs=inputs.assignments,
        layout=layout,
        downloads=(*mapping_downloads(outputs), *mapping_downloads(inputs), *wished, *clocks),
        start_up=(*wished, *clocks),
        mapping_changed=outputs.changed or inputs.changed,
        watchdog_ns=watchdog_ns,
        sync=sync,
        changes=(
            *mapping_changes(device, Direction.OUTPUT, outputs),
            *mapping_changes(device, Direction.INPUT, inputs),
            *value_changes(device, [(d.index, d.subindex, d.data) for d in (*wished, *clocks)]),
        ),
        rejected=outputs.rejected + inputs.rejected,
        left_out=tuple(
            f"0x{each.index:04X}:{each.subindex:02X}" for each in outputs.left_out + inputs.left_out
        ),
    )


def restoring_downloads(device: DeviceDescription, plan: DevicePlan) -> tuple[Download, ...]:
    """Return the downloads that bring back the mapping that the device had before the plan."""
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
    """The plan for a device that begins again: the mapping is written where what it has now
    (`device`) differs."""
    mappings = [_difference(device, each, plan.assignments(each)) for each in Direction]
    written = tuple(step for mapping in mappings for step in mapping_downloads(mapping))
    return replace(
        plan,
        downloads=(*written, *plan.start_up),
        mapping_changed=any(mapping.changed for mapping in mappings),
    )


def _difference(
    device: DeviceDescription, direction: Direction, wanted: tuple[Assignment, ...]
) -> Mapping:
    entries = {pdo.index: shape(pdo) for pdo in device.pdos(direction)}
    now = device.assignments(direction)
    lists = {each.sync_manager: [pdo.index for pdo in each.pdos] for each in now}
    return Mapping(
        wanted,
        rewritten=tuple(
            pdo for each in wanted for pdo in each.pdos if entries.get(pdo.index) != shape(pdo)
        ),
        reassigned=tuple(
            each.sync_manager
            for each in wanted
            if lists.get(each.sync_manager, []) != [pdo.index for pdo in each.pdos]
        ),
    )


def mapping_downloads(mapping: Mapping) -> tuple[Download, ...]:
    """The downloads that make a mapping so; none where it is the device's own."""
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
        downloads += contents if keeps_list else _assigned(assignment, contents)
    return tuple(downloads)


def _assigned(assignment: Assignment, contents: Sequence[Download]) -> list[Download]:
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
        word = entry.index << 16 | entry.subindex << 8 | entry.bit_length
        downloads.append(Download(pdo.index, rank, struct.pack("<I", word), entry))
    downloads.append(Download(pdo.index, 0, bytes([len(pdo.entries)])))
    return downloads
