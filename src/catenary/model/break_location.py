"""Location of a break in the segment, based on the devices that do not answer."""

from __future__ import annotations

from collections.abc import Collection

from catenary.model.finding import Finding, Kind, Names
from catenary.model.topology import Topology

_BREAK = "check the plugs of that cable and the power of the device"
_ADDRESS_LOST = "it was power-cycled or has reset itself: scan again to start it up"


def judge_silence(topology: Topology, names: Names, silent: Collection[int]) -> tuple[Finding, ...]:
    """Return one finding for the first silent device of each branch.

    A silent device that still forwards frames has lost its station address. The devices behind it
    answer.

    Args:
        topology: The tree of the devices.
        names: The names of the devices.
        silent: Positions of the devices that do not answer.
    """
    found = []
    for position in sorted(silent):
        parent = topology.places[position].parent
        if parent is not None and parent in silent and _is_cut_off(topology, parent, silent):
            continue
        found.append(_finding(topology, names, position, silent))
    return tuple(found)


def behind(topology: Topology, position: int) -> tuple[int, ...]:
    """Return the positions of all devices behind a device.

    Args:
        topology: The tree of the devices.
        position: Position of the device.
    """
    found: list[int] = []
    waiting = [cable.lower for cable in topology.children(position)]
    while waiting:
        found.append(waiting.pop())
        waiting += [cable.lower for cable in topology.children(found[-1])]
    return tuple(sorted(found))


def _is_cut_off(topology: Topology, position: int, silent: Collection[int]) -> bool:
    """Return True if all devices behind a silent device are also silent."""
    return all(each in silent for each in behind(topology, position))


def _finding(topology: Topology, names: Names, position: int, silent: Collection[int]) -> Finding:
    name = names.device(position)
    others = behind(topology, position)
    if others and not _is_cut_off(topology, position, silent):
        evidence = (
            "it does not answer, but the devices behind it do: it has lost its station address"
        )
        return Finding(Kind.SILENT, name, evidence, _ADDRESS_LOST, (position,))
    cable = topology.cable_at(position, 0)
    where = f"{names.cable(cable)}, or the power of {name}" if cable else name
    also = f" and the {len(others)} behind it" * bool(others)
    evidence = f"{name}{also} {'do' if others else 'does'} not answer"
    return Finding(Kind.SILENT, where, evidence, _BREAK, (position, *others), cable)
