"""Drawings of segments as text, and with Graphviz if it is installed."""

from __future__ import annotations

import shutil
import subprocess

import pytest

from catenary.cli.drawing import Drawing, Node, as_text, error_text, indents
from catenary.cli.drawing_dot import as_dot
from catenary.model.topology import make_topology
from catenary.wire.error_counters import ErrorCounters, PortErrors
from tests.model.tables import END, LINE, STAR, counted, line

FORK = (True, True, False, True)
TREE = [LINE, STAR, LINE, END, FORK, END, END, LINE, END]


def drawing(errors: dict[int, ErrorCounters] | None = None) -> Drawing:
    topology = make_topology(TREE)
    nodes = tuple(
        Node(f'name "{n}" <&>', n, "OP", 100 * n if n else None, (errors or {}).get(n))
        for n in range(len(TREE))
    )
    return Drawing("eth0", topology, nodes)


def test_a_line_is_drawn_as_a_column() -> None:
    assert indents(make_topology(line(4))) == ("", "", "", "")


def test_branches_are_indented_except_the_last_one() -> None:
    assert indents(make_topology(TREE)) == ("", "", "├─", "│ ", "├─", "│ ├─", "│ ", "", "")


def test_text_has_a_line_for_each_device_with_its_cable() -> None:
    heading, *lines = as_text(drawing()).splitlines()
    assert heading.split() == ["device", "cable", "from", "delay", "state", "alias", "errors"]
    assert len(lines) == len(TREE)
    assert "eth0" in lines[0]
    assert "│ ├─5" in lines[5]
    assert "4 port 3    500 ns" in lines[5]


def test_text_shows_contradictions() -> None:
    nodes = (Node("a", 0, "INIT", None, None), Node("b", 0, "INIT", None, None))
    text = as_text(Drawing("eth0", make_topology([LINE, LINE]), nodes))
    assert text.splitlines()[-1].startswith("! device 1 port 1 is open, but no device answers")


def test_error_text() -> None:
    errors = counted(p0=PortErrors(14, 3), p1=PortErrors(lost_links=1), processing_unit=14, pdi=2)
    assert error_text(errors) == "port 0: 14 broken, 3 symbol; port 1: 1 lost link; PDI 2"
    assert error_text(ErrorCounters()) == error_text(None) == ""


def test_dot_has_a_node_for_each_device_and_an_edge_for_each_cable() -> None:
    text = as_dot(drawing({3: counted(p0=PortErrors(14, 3))}))
    assert text.count(" -- ") == len(TREE)
    assert 'd1:p2 -- d7:p0 [color="#777777", label="700 ns"];' in text
    assert 'd2:p1 -- d3:p0 [color="#c62828", label="300 ns\\n14 broken, 3 symbol"];' in text
    assert 'name "5" &lt;&amp;&gt;' in text


@pytest.mark.skipif(shutil.which("dot") is None, reason="Graphviz is not installed")
def test_graphviz_accepts_the_graph() -> None:
    done = subprocess.run(
        ["dot", "-Tplain"], input=as_dot(drawing()), capture_output=True, text=True, timeout=60
    )
    assert done.stderr == ""
    assert done.stdout.count("\nnode ") == len(TREE) + 1
    assert done.stdout.count("\nedge ") == len(TREE)
