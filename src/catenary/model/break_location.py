"""From the devices that do not answer to the place where the segment is interrupted. Pure."""

from __future__ import annotations

from collections.abc import Collection

from catenary.model.finding import Finding, Kind, Names
from catenary.model.topology import Topology

_BREAK = "look at the plugs of that cable, and whether the device has power"
_FORGOT = "it was switched off and on, or reset itself: bring it up again (scan)"


def judge_silence(topology: Topology, names: Names, silent: Collection[int]) -> tuple[Finding, ...]:
    """Where devices stopped answering: the first of each branch, with what hangs behind it.

    A device that forwards frames and does not answer has lost its station address: those behind
    it still answer.
    """
    found = []
    for position in sorted(silent):
        parent = topology.places[position].parent
        if parent is not None and parent in silent and _cut(topology, parent, silent):
            continue
        found.append(_finding(topology, names, position, silent))
    return tuple(found)


def behind(topology: Topology, position: int) -> tuple[int, ...]:
    """The positions of all devices that hang behind one."""
    found: list[int] = []
    waiting = [cable.lower for cable in topology.children(position)]
    while waiting:
        found.append(waiting.pop())
        waiting += [cable.lower for cable in topology.children(found[-1])]
    return tuple(sorted(found))


def _cut(topology: Topology, position: int, silent: Collection[int]) -> bool:
    """Whether nobody behind a silent device answers either."""
    return all(each in silent for each in behind(topology, position))


def _finding(topology: Topology, names: Names, position: int, silent: Collection[int]) -> Finding:
    who = names.device(position)
    others = behind(topology, position)
    if others and not _cut(topology, position, silent):
        evidence = "it does not answer, and those behind it do: it has lost its station address"
        return Finding(Kind.SILENT, who, evidence, _FORGOT, (position,))
    cable = topology.cable_at(position, 0)
    where = f"{names.cable(cable)}, or the power of {who}" if cable else who
    also = f" and the {len(others)} behind it" * bool(others)
    evidence = f"{who}{also} {'do' if others else 'does'} not answer"
    return Finding(Kind.SILENT, where, evidence, _BREAK, (position, *others), cable)
