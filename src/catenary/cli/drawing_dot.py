"""Drawing of a segment as a Graphviz graph: `catenary graph eth0 --dot | dot -Tsvg`."""

from __future__ import annotations

from collections.abc import Iterator

from catenary.cli.drawing import Drawing, Node, inner_text, port_text
from catenary.cli.text import escaped
from catenary.model.topology import PORT_ORDER, Cable
from catenary.wire.error_counters import PortErrors

_HEAD = (
    "graph segment {",
    "  rankdir=LR;",
    '  graph [fontname="Helvetica"];',
    '  node [fontname="Helvetica", fontsize=11, shape=plaintext];',
    '  edge [fontname="Helvetica", fontsize=9];',
)
_GOOD, _BAD, _GREY = "#2f5d8a", "#c62828", "#777777"


def as_dot(drawing: Drawing) -> str:
    """Return a Graphviz graph with a node per device and an edge per cable; errors are red."""
    lines = [*_HEAD, f"  main [shape=box, style=rounded, label={_quoted(drawing.target)}];"]
    for position, node in enumerate(drawing.nodes):
        lines.append(f"  d{position} [label={_label(drawing, position, node)}];")
    lines += [f"  {line}" for line in _edges(drawing)]
    lines += [f"  // {text}" for text in drawing.topology.contradictions]
    return "\n".join([*lines, "}"])


def _label(drawing: Drawing, position: int, node: Node) -> str:
    """Return a node label: port 0 on the left, other ports on the right in frame order."""
    onwards = [port for port in PORT_ORDER if drawing.topology.ports[position][port]]
    rows = max(1, len(onwards))
    alias = f"alias {node.alias}" if node.alias else ""
    inner = inner_text(node.errors)
    words = [f"<b>{position}</b> {_escaped(node.name)}", alias, node.state, inner]
    name = "<br/>".join(word for word in words if word)
    first, *others = [_port(port) for port in onwards] or [""]
    left = _port(0, rows) if drawing.topology.ports[position][0] else ""
    body = f'<tr>{left}<td rowspan="{rows}">{name}</td>{first}</tr>'
    body += "".join(f"<tr>{port}</tr>" for port in others)
    color = (
        _BAD if inner or "ERROR" in node.state else _GOOD
    )  # the edges show the errors of the ports
    return (
        f'<<table border="1" color="{color}" cellborder="0" cellspacing="0" cellpadding="4">'
        f"{body}</table>>"
    )


def _port(number: int, rows: int = 1) -> str:
    small = f'<font point-size="9">{number}</font>'
    return f'<td port="p{number}" rowspan="{rows}">{small}</td>'


def _edges(drawing: Drawing) -> Iterator[str]:
    for cable in drawing.topology.cables:
        upper = "main" if cable.upper is None else f"d{cable.upper}:p{cable.upper_port}"
        lower = f"d{cable.lower}"
        if drawing.topology.ports[cable.lower][cable.lower_port]:
            lower += f":p{cable.lower_port}"
        noisy = any(
            end and (end.invalid_frames or end.symbol_errors) for end in _ends(drawing, cable)
        )
        lost = any(end and end.lost_links for end in _ends(drawing, cable))
        color = _BAD if noisy or lost else _GREY
        words = [
            _delay(drawing.nodes[cable.lower]),
            *(_port_label(end) for end in _ends(drawing, cable)),
        ]
        label = "\\n".join(word for word in words if word)
        yield f'{upper} -- {lower} [color="{color}", label="{label}"];'


def _ends(drawing: Drawing, cable: Cable) -> list[PortErrors | None]:
    found: list[PortErrors | None] = []
    for position, port in (cable[:2], cable[2:]):
        errors = None if position is None else drawing.nodes[position].errors
        found.append(None if errors is None or port is None else errors.ports[port])
    return found


def _port_label(end: PortErrors | None) -> str:
    return port_text(end) if end else ""


def _delay(node: Node) -> str:
    return "" if node.delay_ns is None else f"{node.delay_ns} ns"


def _escaped(text: str) -> str:
    return escaped(text).replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
