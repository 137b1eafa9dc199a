"""Changes that a plan makes to a device, as text: old and new values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from catenary.model.device import DeviceDescription, Direction
from catenary.plan.pdo_mapping import ASSIGNMENT_BASE, Mapping, shape
from catenary.plan.pdo_search import pdo_names, place_names


class Change(NamedTuple):
    """Change of an object of a device. `old` is empty if the old value is not known.

    `what` is "0x1C13" or "0x1A00" for a list of PDOs or entries, "0x6060:00" for a value.
    """

    what: str
    old: str
    new: str


def mapping_changes(
    device: DeviceDescription, direction: Direction, mapping: Mapping
) -> list[Change]:
    """Return the lists of PDOs and of entries that change."""
    before = {each.sync_manager: each.pdos for each in device.assignments(direction)}
    known = {pdo.index: pdo for pdo in device.pdos(direction)}
    changes = [
        Change(
            f"0x{ASSIGNMENT_BASE + each.sync_manager:04X}",
            pdo_names(before.get(each.sync_manager, ()), empty="none"),
            pdo_names(each.pdos, empty="none"),
        )
        for each in mapping.assignments
        if each.sync_manager in mapping.reassigned
    ]
    for pdo in mapping.rewritten:
        old = place_names(shape(known[pdo.index]), empty="none") if pdo.index in known else ""
        changes.append(Change(f"0x{pdo.index:04X}", old, place_names(shape(pdo), empty="none")))
    return changes


def value_changes(
    device: DeviceDescription, start_up: Sequence[tuple[int, int, bytes]]
) -> list[Change]:
    """Return the objects of a start-up list that change a value.

    An object whose present value is unknown counts as a change.
    """
    changes = []
    for index, subindex, data in start_up:
        old = device.known_value(index, subindex)
        if old != data:
            text = "" if old is None else old.hex(" ")
            changes.append(Change(f"0x{index:04X}:{subindex:02X}", text, data.hex(" ")))
    return changes
