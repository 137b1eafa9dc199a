"""Mapping: the process data of one device in one direction, and the changes to obtain it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from collections.abc import Mapping as Lists
from dataclasses import dataclass, replace
from itertools import chain
from typing import TYPE_CHECKING, NamedTuple

from catenary.errors import MappingError
from catenary.model.device import Assignment, DeviceDescription, Direction, Pdo, mapped_pdos

if TYPE_CHECKING:  # request.py imports NumPy, which a scan does not need
    from catenary.plan.request import ObjectReference


ASSIGNMENT_BASE = 0x1C10  # + SyncManager


@dataclass(frozen=True, slots=True)
class Mapping:
    """Process data of one device in one direction, and the changes to obtain it."""

    assignments: tuple[Assignment, ...]
    rewritten: tuple[Pdo, ...] = ()  # PDOs with new entries
    reassigned: tuple[int, ...] = ()  # SyncManagers with another list of PDOs
    rejected: tuple[str, ...] = ()  # alternatives that change less, and their obstacles
    left_out: tuple[ObjectReference, ...] = ()  # optional objects that are not mapped
    source: str = ""  # of the OpMode or the named mapping that chose the PDOs

    @property
    def changed(self) -> bool:
        return bool(self.rewritten or self.reassigned)

    @property
    def pdos(self) -> tuple[Pdo, ...]:
        """PDOs of all assignments, in order."""
        return mapped_pdos(self.assignments)


class AvailablePdos(NamedTuple):
    """PDOs of a device in one direction, by their assignment."""

    assigned: tuple[Pdo, ...]  # to the SyncManager of process data
    offered: tuple[Pdo, ...]  # all that can be assigned to this SyncManager, `assigned` included
    elsewhere: tuple[Pdo, ...]  # assigned to other SyncManagers


def process_data_channel(device: DeviceDescription, direction: Direction) -> int | None:
    """Return the index of the SyncManager for the process data of a direction; None if absent."""
    for assignment in device.assignments(direction):
        return assignment.sync_manager
    for channel in device.sync_managers:
        if channel.use is direction.use:
            return channel.index
    return None


def check_channel(device: DeviceDescription, direction: Direction) -> int:
    """Return the index of the SyncManager for the process data of a direction.

    Raises:
        MappingError: The device has no such SyncManager.
    """
    channel = process_data_channel(device, direction)
    if channel is None:
        raise MappingError(
            f"{device} has no SyncManager for {direction.noun}",
            hint=f"request no {direction.noun} of it; `catenary sii` shows its SyncManagers",
        )
    return channel


def available_pdos(device: DeviceDescription, direction: Direction) -> AvailablePdos:
    """Return the PDOs of a direction, by their assignment."""
    channel = process_data_channel(device, direction)
    assignments = device.assignments(direction)
    elsewhere = mapped_pdos(each for each in assignments if each.sync_manager != channel)
    taken = {pdo.index for pdo in elsewhere}
    return AvailablePdos(
        assigned=mapped_pdos(each for each in assignments if each.sync_manager == channel),
        offered=tuple(
            pdo for pdo in device.pdos(direction) if pdo.index not in taken and not pdo.missing
        ),
        elsewhere=elsewhere,
    )


def assignment_refusal(device: DeviceDescription, direction: Direction) -> str:
    """Return the reason why the assignment cannot be changed; empty if it can be changed.

    Raises:
        MappingError: The device has a CoE mailbox, but no SyncManager for the direction.
    """
    if device.mailbox is None or not device.coe:
        return "it has no CoE mailbox to change its assignment"
    channel = check_channel(device, direction)
    index = ASSIGNMENT_BASE + channel
    if not device.mailbox.pdo_assign:
        return f"its SII does not allow changes of 0x{index:04X}"
    if any(a.fixed for a in device.assignments(direction) if a.sync_manager == channel):
        return f"0x{index:04X} is read-only in its dictionary"
    return ""


def with_pdos(device: DeviceDescription, direction: Direction, pdos: Sequence[Pdo]) -> Mapping:
    """Return the mapping with these PDOs on the SyncManager for process data.

    Differences from the device's own mapping are marked as rewritten or reassigned.

    Raises:
        MappingError: The device has no SyncManager for the direction.
    """
    return with_lists(device, direction, {check_channel(device, direction): pdos})


def with_lists(
    device: DeviceDescription, direction: Direction, lists: Lists[int, Sequence[Pdo]]
) -> Mapping:
    """Return the mapping with other lists of PDOs on some SyncManagers.

    Differences from the device's own mapping are marked as rewritten or reassigned.

    Args:
        device: The device, with its present mapping.
        direction: Outputs or inputs.
        lists: PDOs by SyncManager.
    """
    now = {each.sync_manager: each for each in device.assignments(direction)}
    reassigned = []
    for channel, pdos in lists.items():
        before = now.get(channel, Assignment(channel, ()))
        if [pdo.index for pdo in before.pdos] != [pdo.index for pdo in pdos]:
            reassigned.append(channel)
        now[channel] = replace(before, pdos=tuple(pdos))
    return Mapping(
        tuple(now[channel] for channel in sorted(now)),
        rewritten=differing(device, direction, chain.from_iterable(lists.values())),
        reassigned=tuple(reassigned),
    )


def differing(
    device: DeviceDescription, direction: Direction, pdos: Iterable[Pdo]
) -> tuple[Pdo, ...]:
    """Return the PDOs whose entries differ from those of the device, and so are to be written."""
    known = {pdo.index: shape(pdo) for pdo in device.pdos(direction)}
    return tuple(pdo for pdo in pdos if not pdo.sample and known.get(pdo.index) != shape(pdo))


def shape(pdo: Pdo) -> tuple[tuple[int, int, int], ...]:
    """Return the entries without their names: index, subindex, length."""
    return tuple(entry.place for entry in pdo.entries)
