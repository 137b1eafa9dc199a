"""Comparison of two clones: devices that are missing, added, exchanged or moved, and open ports.

A device is behind a port of its parent. Devices that are missing, added or moved are skipped on the
way to the parent, so that only the cause of a difference is reported.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

from catenary.line.change import ABSENT, Change, ChangedDevice, Part, Severity
from catenary.line.pairing import Pairing
from catenary.line.sides import Sides
from catenary.line.values import ClonedDevice, Line
from catenary.model.topology import open_ports
from catenary.wire.register import DL_STATUS

_PORTS = range(1, 4)


def compare_topology(old: Line, new: Line, pairing: Pairing) -> Iterator[Change]:
    """Yield the changes of the tree, without those that follow from another one.

    Args:
        old: The earlier clone.
        new: The present clone.
        pairing: Their pairs.
    """
    for position in pairing.missing:
        device = old.devices[position]
        missing = ChangedDevice(device.name, position, None)
        note = f"it was {_behind(old, device.parent, device.parent_port)}"
        yield Change(
            missing, Part.DEVICE, "", identity_text(device), "missing", Severity.EFFECT, note
        )
    for position in pairing.added:
        device = new.devices[position]
        added = ChangedDevice(device.name, None, position)
        note = f"it is {_behind(new, device.parent, device.parent_port)}"
        yield Change(added, Part.DEVICE, "", ABSENT, identity_text(device), Severity.EFFECT, note)
    yield from _places(old, new, pairing)
    yield from _open_ports(old, new, pairing)


def identity_text(device: ClonedDevice) -> str:
    """Return the identity of a device; its name if the identity was not read."""
    return device.name if device.identity is None else f"{device.name}, {device.identity}"


def _places(old: Line, new: Line, pairing: Pairing) -> Iterator[Change]:
    new_of = dict(pairing.pairs)
    fixed = {position for position in new_of if position not in pairing.moved}
    fixed_now = {new_of[position] for position in fixed}
    for before, now in pairing.pairs:
        sides = Sides(old.devices[before], new.devices[now])
        if before in pairing.moved:
            if not _moved_with_parent(sides, pairing, new_of):
                yield _moved(old, new, sides)
            continue
        parent, port = _parent(old.devices, before, fixed)
        present = _parent(new.devices, now, fixed_now)
        expected = None if parent is None else new_of[parent]
        if (expected, port) != present:
            texts = _behind(old, parent, port), _behind(new, *present)
            yield sides.change(Part.TOPOLOGY, "cable", texts)


def _parent(
    devices: Sequence[ClonedDevice], position: int, fixed: Collection[int]
) -> tuple[int | None, int | None]:
    """Return the next fixed device on the way to the MainDevice, and its port."""
    device = devices[position]
    while device.parent is not None and device.parent not in fixed:
        device = devices[device.parent]
    return device.parent, device.parent_port


def _moved_with_parent(sides: Sides, pairing: Pairing, new_of: dict[int, int]) -> bool:
    """Return True if the device is still at the same port of a device that has moved itself."""
    parent = sides.old.parent
    return (
        parent is not None
        and parent in pairing.moved
        and new_of[parent] == sides.new.parent
        and sides.old.parent_port == sides.new.parent_port
    )


def _moved(old: Line, new: Line, sides: Sides) -> Change:
    before, now = (
        f"position {device.position}, {_behind(line, device.parent, device.parent_port)}"
        for line, device in ((old, sides.old), (new, sides.new))
    )
    return sides.change(Part.TOPOLOGY, "order", (before, now), note="moved, or cables swapped")


def _behind(line: Line, parent: int | None, port: int | None) -> str:
    if parent is None:
        return "behind the MainDevice"
    return f"behind device {parent} ({line.devices[parent].name}) port {port}"


def _open_ports(old: Line, new: Line, pairing: Pairing) -> Iterator[Change]:
    """Yield ports that opened or closed without a device behind them."""
    taken, taken_now = _taken(old), _taken(new)
    for before, now in pairing.pairs:
        sides = Sides(old.devices[before], new.devices[now])
        if any(DL_STATUS.address not in each.registers for each in (sides.old, sides.new)):
            continue
        ports, present = (open_ports(each.dl_status) for each in (sides.old, sides.new))
        for port in _PORTS:
            explained = ((before, port) in taken) != ((now, port) in taken_now)
            if ports[port] != present[port] and not explained:
                texts = _open_text(ports[port]), _open_text(present[port])
                yield sides.change(Part.TOPOLOGY, f"port {port}", texts)


def _taken(line: Line) -> set[tuple[int | None, int | None]]:
    return {(device.parent, device.parent_port) for device in line.devices}


def _open_text(is_open: bool) -> str:
    return "open" if is_open else "closed"
