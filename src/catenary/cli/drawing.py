"""Drawing of a segment: its content, and its representation as text."""

from __future__ import annotations

from dataclasses import dataclass

from catenary.cli.plain import plain
from catenary.cli.tables import table
from catenary.model.topology import Topology
from catenary.wire.error_counters import ErrorCounters, PortErrors


@dataclass(frozen=True, slots=True)
class Node:
    """Device in a drawing.

    `delay_ns` is the one-way delay of its cable and the previous device; None if it is unknown.
    """

    name: str
    alias: int
    state: str
    delay_ns: int | None
    errors: ErrorCounters | None  # None if the device does not answer


@dataclass(frozen=True, slots=True)
class Drawing:
    """Tree of a segment, and its devices by position."""

    target: str
    topology: Topology
    nodes: tuple[Node, ...]


HEADINGS = ("device", "cable from", "delay", "state", "alias", "errors")


def as_text(drawing: Drawing) -> str:
    """Return the drawing as text. Devices in a line form a column; branches are indented."""
    rows = [
        (f"{indent}{position} {node.name}", _from(drawing, position), *_facts(node))
        for position, (indent, node) in enumerate(
            zip(indents(drawing.topology), drawing.nodes, strict=True)
        )
    ]
    notes = [f"! {text}" for text in drawing.topology.contradictions]
    return "\n".join([table([HEADINGS, *rows]), *notes])


def as_values(drawing: Drawing) -> dict[str, object]:
    """Return the drawing for JSON."""
    topology = drawing.topology
    return {
        "target": drawing.target,
        "devices": [
            {
                "position": position,
                "name": node.name,
                "alias": node.alias,
                "state": node.state,
                "parent": topology.places[position].parent,
                "parent_port": topology.places[position].parent_port,
                "open_ports": [
                    port for port, open_ in enumerate(topology.ports[position]) if open_
                ],
                "delay_ns": node.delay_ns,
                "errors": plain(node.errors),
            }
            for position, node in enumerate(drawing.nodes)
        ],
        "cables": [each._asdict() for each in topology.cables],
        "contradictions": list(topology.contradictions),
    }


def indents(topology: Topology) -> tuple[str, ...]:
    """Return the indentation of each device: `├─` starts a branch, `│ ` continues past one."""
    found: list[str] = []
    depths: list[int] = []
    for position, place in enumerate(topology.places):
        if place.parent is None:
            depth, begins = 0, False
        else:
            siblings = topology.children(place.parent)
            begins = siblings[-1].lower != position
            depth = depths[place.parent] + begins
        depths.append(depth)
        bars = "│ " * (depth - begins)
        found.append(bars + "├─" * begins)
    return tuple(found)


def _from(drawing: Drawing, position: int) -> str:
    place = drawing.topology.places[position]
    if place.parent is None:
        return drawing.target if position == 0 else "?"
    return f"{place.parent} port {place.parent_port}"


def _facts(node: Node) -> tuple[str, ...]:
    delay = "" if node.delay_ns is None else f"{node.delay_ns} ns"
    return (delay, node.state, str(node.alias or ""), error_text(node.errors))


def error_text(errors: ErrorCounters | None) -> str:
    """Return the counters that are not zero, as text."""
    if errors is None:
        return ""
    parts = [f"port {n}: {port_text(port)}" for n, port in enumerate(errors.ports) if port]
    return "; ".join([*parts, inner_text(errors)] if inner_text(errors) else parts)


def inner_text(errors: ErrorCounters | None) -> str:
    """Return the counters of the PDI, and of the processing unit if port 0 counted no errors."""
    if errors is None:
        return ""
    outside = errors.ports[0].invalid_frames or errors.ports[0].forwarded
    numbers = ((0 if outside else errors.processing_unit, "processing unit"), (errors.pdi, "PDI"))
    return ", ".join(f"{what} {count}" for count, what in numbers if count)


def port_text(port: PortErrors) -> str:
    numbers = (
        (port.invalid_frames, "broken"),
        (port.symbol_errors, "symbol"),
        (port.forwarded, "forwarded"),
        (port.lost_links, "lost link" if port.lost_links == 1 else "lost links"),
    )
    return ", ".join(f"{count} {what}" for count, what in numbers if count)
