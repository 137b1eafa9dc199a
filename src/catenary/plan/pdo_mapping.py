"""Mapping: the process data of one device in one direction, and the difference from now."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from catenary.errors import MappingError
from catenary.model.device import Assignment, DeviceDescription, Direction, Pdo, mapped_pdos

if TYPE_CHECKING:  # wish.py needs NumPy, a scan does not
    from catenary.plan.wish import ObjectReference


ASSIGNMENT_BASE = 0x1C10  # + SyncManager


@dataclass(frozen=True, slots=True)
class Mapping:
    """The process data of one device in one direction, and what must be written to get it."""

    assignments: tuple[Assignment, ...]
    rewritten: tuple[Pdo, ...] = ()  # PDOs with new entries
    reassigned: tuple[int, ...] = ()  # SyncManagers with another list of PDOs
    rejected: tuple[str, ...] = ()  # alternatives that change less, and why each failed
    left_out: tuple[ObjectReference, ...] = ()  # optional objects that it does not carry

    @property
    def changed(self) -> bool:
        return bool(self.rewritten or self.reassigned)

    @property
    def pdos(self) -> tuple[Pdo, ...]:
        """PDOs of all its assignments, in their order."""
        return mapped_pdos(self.assignments)


def process_data_channel(device: DeviceDescription, direction: Direction) -> int | None:
    """Return the SyncManager of the process data of a direction; None: there is none."""
    for assignment in device.assignments(direction):
        return assignment.sync_manager
    for channel in device.sync_managers:
        if channel.use is direction.use:
            return channel.index
    return None


def check_channel(device: DeviceDescription, direction: Direction) -> int:
    """Return the SyncManager of the process data of a direction.

    Raises:
        MappingError: There is none.
    """
    channel = process_data_channel(device, direction)
    if channel is None:
        raise MappingError(
            f"{device} has no SyncManager for {direction.noun}",
            hint=f"ask this device for no {direction.noun}; `catenary sii` shows its SyncManagers",
        )
    return channel


def with_pdos(device: DeviceDescription, direction: Direction, pdos: Sequence[Pdo]) -> Mapping:
    """Return the mapping with these PDOs on the SyncManager of process data.

    What differs from the device's own is marked as rewritten or reassigned.
    """
    channel = check_channel(device, direction)
    now = {each.sync_manager: each for each in device.assignments(direction)}
    before = now.get(channel, Assignment(channel, ()))
    now[channel] = replace(before, pdos=tuple(pdos))
    known = {pdo.index: shape(pdo) for pdo in device.pdos(direction)}
    same = [pdo.index for pdo in before.pdos] == [pdo.index for pdo in pdos]
    return Mapping(
        tuple(now[channel] for channel in sorted(now)),
        rewritten=tuple(pdo for pdo in pdos if known.get(pdo.index) != shape(pdo)),
        reassigned=() if same else (channel,),
    )


def shape(pdo: Pdo) -> tuple[tuple[int, int, int], ...]:
    """Return the entries without their names: index, subindex, length."""
    return tuple(entry.place for entry in pdo.entries)
